"""Pictures of failures: drawn once, of the drive that failed, with attention where a network drove."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from caldrive.agents.settings import AgentSettings
from caldrive.benchmark.report.runs import BenchmarkRun, load_run
from caldrive.datatypes import (
    Affordances,
    CameraConfig,
    Command,
    Control,
    Image,
    Observation,
    Pose,
    Step,
    Truth,
    VehicleState,
)
from caldrive.explain import failure_pictures
from caldrive.explain.failure_pictures import (
    FOLDER,
    NO_NETWORK,
    OTHERWISE,
    STILL,
    Snapshot,
    draw_pictures,
    with_pictures,
)
from caldrive.explain.moments import Glance, Plan
from caldrive.perception.network.network import Network
from tests.command_line import run_json
from tests.explain.test_activation_maps import CONFIG, pictures

TEXT = "red light: seen 3 %, true yes"
WANTED = Plan("red_light", (Glance(3, 3.0, 0.0, "1 s before", TEXT), Glance(13, 13.0, 0.0, "red light", TEXT)))


@pytest.fixture
def run(blind_run: Path, tmp_path: Path) -> BenchmarkRun:
    """The run of the oracle that sees no light, in a folder of its own."""
    return load_run(shutil.copytree(blind_run, tmp_path / "run"))


@pytest.fixture
def network() -> Network:
    torch.manual_seed(1)
    return Network(CONFIG).eval()


def snapshots(n: int) -> list[Snapshot]:
    still = np.full((STILL.height, STILL.width, 3), 90, np.uint8)
    return [Snapshot(still, tuple(pictures(3, seed=k)), Command.STRAIGHT) for k in range(n)]


def test_an_agent_without_a_network_has_stills_without_attention_that_are_drawn_once(run: BenchmarkRun) -> None:
    answer = run_json("report", str(run.folder), "--attention", "--out", str(run.folder / "report"))
    assert (answer["failures"], answer["pictured"]) == (1, 1)
    (why,) = with_pictures(run).explanations.values()
    assert [moment.attention for moment in why.moments] == [None] * 3
    assert why.moments[0].text == "red light: not seen, true yes"
    assert why.note == NO_NETWORK
    page = (run.folder / "report" / "report.html").read_text()
    assert page.count('<img alt="still"') == 3
    assert why.moments[-1].title in page
    before = {path: path.stat().st_mtime_ns for path in (run.folder / FOLDER).iterdir()}
    draw_pictures([run])
    assert {path: path.stat().st_mtime_ns for path in (run.folder / FOLDER).iterdir()} == before


def test_a_run_of_other_code_is_not_driven_again_for_pictures(run: BenchmarkRun) -> None:
    about = run.folder / "run.json"
    about.write_text(about.read_text().replace('"code": "behaviour-', '"code": "other-'))
    with pytest.raises(ValueError, match=r"results with code other-.*drive the benchmark again"):
        draw_pictures([load_run(run.folder)])


def test_attention_lies_beside_each_still(run: BenchmarkRun, network: Network) -> None:
    key = run.failures[0].result.trial.key
    failure_pictures._save(run, key, WANTED, snapshots(2), network)
    (why,) = with_pictures(run).explanations.values()
    assert (len(why.moments), why.note) == (2, "")
    for moment in why.moments:
        assert moment.attention is not None
        assert moment.attention != moment.still
    assert f"{TEXT}; the network says " in why.moments[0].text  # its driver is blind
    other = replace(run, description=run.description | {"model": "another"})
    assert not with_pictures(other).explanations


class Camera:
    """A world that is only looked at."""

    roads = route = object()

    def images(self, mounts: Sequence[CameraConfig]) -> list[Image]:
        return [np.zeros((mount.height, mount.width, 3), np.uint8) for mount in mounts]


def drive(speed: float) -> Iterator[Step]:
    """Straight on, so many metres a step; the number of the step is the brightness."""
    for k in range(20):
        observation = Observation(k / 10, np.full((2, 2, 3), k, np.uint8), 5.0, Command.LEFT)
        yield Step(observation, Truth(k / 10, VehicleState(Pose(speed * k, 0.0, 0.0)), Affordances()), Control())


def test_the_network_is_shown_the_images_until_each_moment() -> None:
    world: Any = Camera()
    seen = list(failure_pictures._snapshots(world, drive(1.0), WANTED.glances, span=5))
    assert [[int(image[0, 0, 0]) for image in one.images] for one in seen] == [[0, 1, 2, 3], [9, 10, 11, 12, 13]]
    assert (seen[0].still.shape, seen[0].command) == ((141, 320, 3), Command.LEFT)


def test_a_car_that_is_elsewhere_than_it_was_is_not_looked_at() -> None:
    world: Any = Camera()
    assert not list(failure_pictures._snapshots(world, drive(1.1), WANTED.glances, span=5))


def test_pictures_of_a_drive_that_goes_otherwise_are_not_shown(run: BenchmarkRun, network: Network) -> None:
    key = run.failures[0].result.trial.key
    for n in (2, 1):  # what is drawn of an earlier drive goes
        failure_pictures._save(run, key, WANTED, snapshots(n), network)
    (why,) = with_pictures(run).explanations.values()
    assert (why.moments, why.note) == ((), OTHERWISE)


def test_a_damaged_file_is_named(run: BenchmarkRun, network: Network) -> None:
    key = run.failures[0].result.trial.key
    failure_pictures._save(run, key, WANTED, snapshots(2), network)
    (run.folder / FOLDER / f"{key}.json").write_text("{")
    with pytest.raises(ValueError, match=r"damaged .*: remove it"):
        with_pictures(run)


def test_without_captum_nothing_is_driven(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "captum.attr", None)
    with pytest.raises(RuntimeError, match="found no Captum"):
        failure_pictures._network(AgentSettings(agent="cal"))
