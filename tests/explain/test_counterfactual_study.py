"""A study from end to end: a short drive, and what cannot be studied."""

from __future__ import annotations

import io
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image as Picture

from caldrive.datatypes import CameraConfig, LightState, VehicleState
from caldrive.driving.choice import chosen_scenarios
from caldrive.driving.settings import EpisodeSettings
from caldrive.explain.cases import Case
from caldrive.explain.counterfactual_study import Study, sheet, study
from caldrive.explain.counterfactuals import Studio, see
from caldrive.explain.gradcam import Question
from caldrive.explain.interventions import INTERVENTIONS
from caldrive.perception.inference.predictor import NetworkPerception
from caldrive.perception.network.network import Network
from caldrive.perception.network.tensor_file import write_tensors
from caldrive.world.embedded import EmbeddedWorld
from caldrive.world.rendering.camera import CameraRig
from tests.command_line import run_json
from tests.explain.test_counterfactuals import case
from tests.explain.test_gradcam import CONFIG


@pytest.fixture(scope="module")
def network() -> Network:
    torch.manual_seed(1)
    return Network(CONFIG).eval()


def test_pictures_are_those_that_the_world_would_have_shown(network: Network, no_sumo_left: None) -> None:
    (scenario,) = chosen_scenarios(EpisodeSettings(cars=0, people=20), 1)
    with closing(EmbeddedWorld(CameraConfig())) as world:
        first, scene, rig = world.reset(scenario), world.scene(), CameraRig(world.town)
    posts, question = rig.town.roads.posts, Question("red_light")
    red = Case(case("red light").situation, posts[0].id, None, question, (scene,), 0)
    assert (see(Studio(rig, network), red).images[-1] == first.image).all()
    lane = rig.town.roads.lanes[posts[0].lane]
    before_it = VehicleState(lane.line.pose_at(lane.line.length - 12))
    scene = replace(scene, ego=before_it, lights=dict.fromkeys(scene.lights, LightState.RED))
    seen = see(Studio(rig, network), replace(red, states=(scene,)))
    green = seen.changed(INTERVENTIONS[0])
    assert green.is_seen
    difference = green.image[green.where].astype(int) - seen.images[-1][green.where]
    assert difference[:, 0].mean() < 0 < difference[:, 1].mean()
    assert green.before.probability != green.after.probability


def test_a_study_of_a_short_drive_gives_the_same_twice(network: Network, no_sumo_left: None) -> None:
    scenarios = chosen_scenarios(EpisodeSettings(task="navigation-dynamic", people=60, cars=3, seconds=5.0), 1)

    def once() -> tuple[Study, bytes]:
        found = study(network, NetworkPerception(network, watchdog=False), scenarios, cases=1, layer="coarse", seed=3)
        return replace(found, shown={}), sheet(found.shown)

    found, page = once()
    assert (found, page) == once()
    assert len(found.findings) == 7
    assert found.gap.cases == sum(n for n, _ in found.found.values()) > 0
    assert found.gap.other_answers == 0
    assert found.gap.difference == pytest.approx(0.0, abs=1e-5)
    with Picture.open(io.BytesIO(page)) as opened:
        assert np.asarray(opened).shape[2] == 3


def test_the_command_answers_with_effects_and_verdicts(tmp_path: Path, no_sumo_left: None) -> None:
    out = tmp_path / "sheet.png"
    answer = run_json(
        "explain",
        "counterfactuals",
        "--episodes",
        "1",
        "--seconds",
        "1.5",
        "--cars",
        "0",
        "--people",
        "5",
        "--cases",
        "1",
        "--out",
        str(out),
    )
    assert out.is_file()
    assert {"found", "effects", "observations", "at_the_wheel"} < answer.keys()
    assert {one["verdict"] for one in answer["observations"]} == {"too few cases"}


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("--weather", "15"), "found --weather 15, wanted 1 to 14"),
        (("--out", "x.jpg"), "wanted a name that ends in .png"),
        (("--cases", "0"), "found --cases 0, wanted 1 to 1000"),
        (("--episodes", "0"), "found --episodes 0, wanted 1 to 1000"),
        (("--town", "nowhere"), "nowhere"),
        (("--model", "nothing.safetensors"), "nothing.safetensors"),
    ],
    ids=str,
)
def test_what_cannot_be_studied_ends_in_a_sentence(options: tuple[str, ...], sentence: str) -> None:
    assert sentence in run_json("explain", "counterfactuals", *options, code=2)["error"]


def test_the_weights_of_another_agent_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "mp.safetensors"
    write_tensors(path, {"weight": torch.zeros(1)}, {"kind": "mp"})
    refused = run_json("explain", "counterfactuals", "--model", str(path), code=2)
    assert "weights of the agent mp, wanted those of cal" in refused["error"]
