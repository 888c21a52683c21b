"""Frames in which an affordance matters, found in a recording, and what is said of attention there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image as Picture

from caldrive.datatypes import Affordances, Command, Semantic
from caldrive.explain import recorded
from caldrive.explain.activation_maps import Map
from caldrive.explain.overlay import BAR, LABEL
from caldrive.explain.recorded import contact_sheet, figures
from caldrive.explain.situations import SITUATIONS, find_examples
from caldrive.perception.network.network import Network
from caldrive.recordings.writer import EpisodeError, EpisodeWriter
from tests.explain.test_activation_maps import CONFIG
from tests.perception.data import SCENARIO, make_frame

HEIGHT, WIDTH = CONFIG.image_size
LABELS = {
    "red light": Affordances(red_light=1.0), "hazard by a person": Affordances(hazard_stop=1.0),
    "hazard by a car": Affordances(hazard_stop=1.0, vehicle_distance=5.0), "speed sign": Affordances(speed_sign=60),
    "car ahead": Affordances(vehicle_distance=9.0), "turn": Affordances(relative_angle=0.4), "straight": Affordances(),
}  # fmt: skip


def record_situations(folder: Path) -> Path:
    """An episode for each situation: ten frames of three cameras, in which the thing is seen in the last five."""
    rng = np.random.default_rng(0)
    for number, situation in enumerate(SITUATIONS):
        scenario = replace(SCENARIO, seed=number)
        with EpisodeWriter(folder / f"episode-{number:05d}.parquet", scenario) as writer:
            for index in range(10):
                for camera in range(3):
                    semantic = np.full((HEIGHT, WIDTH), Semantic.ROAD, np.uint8)
                    if index >= 5 and situation.shows:
                        semantic[30:50, 90:110] = situation.shows[0]
                    frame = make_frame(index, camera=camera)
                    writer.append(
                        replace(
                            frame, affordances=LABELS[situation.name], semantic=semantic,
                            image=rng.integers(0, 255, (HEIGHT, WIDTH, 3), dtype=np.uint8), junction=number == 5,
                            command=Command.LEFT if number == 5 else Command.STRAIGHT, other=None,
                        )
                    )  # fmt: skip
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_situations(tmp_path_factory.mktemp("situations"))


@pytest.fixture(scope="module")
def network() -> Network:
    torch.manual_seed(1)
    return Network(CONFIG).eval()


def test_each_situation_is_found_with_its_history_and_the_thing_in_sight(folder: Path) -> None:
    found = find_examples(folder, n=1, history=4, seed=0)
    for number, (name, examples) in enumerate(found.items()):
        (example,) = examples
        assert len(example.images) == 5
        label = LABELS[SITUATIONS[int(example.source[8:13])].name]  # of the episode that it is from
        assert example.truth == pytest.approx(getattr(label, example.situation.affordance))
        if example.situation.shows:
            assert example.semantics is not None
            assert (example.semantics == example.situation.shows[0]).any()
            if name not in ("hazard by a car", "car ahead"):  # each shows the other, too
                assert example.source.startswith(f"episode-{number:05d}")
    assert found["turn"][0].command is Command.LEFT


def test_without_the_training_kept_episodes_the_folder_is_named(folder: Path) -> None:
    with pytest.raises(EpisodeError, match="found none of the episodes in"):
        find_examples(folder, n=1, history=4, seed=0, keys=["elsewhere"])


def test_episodes_that_are_too_short_end_in_a_sentence(folder: Path) -> None:
    with pytest.raises(EpisodeError, match=r"found no situation in .* with 400 frames before it, .*: record longer"):
        find_examples(folder, n=1, history=400, seed=0)


def test_the_sheet_has_a_row_for_each_situation(folder: Path, network: Network, tmp_path: Path) -> None:
    found = find_examples(folder, n=1, history=4, seed=0)
    (tmp_path / "sheet.png").write_bytes(contact_sheet(network, found, width=100))
    strips = 2 * (round(88 / 200 * (100 // 3)) + BAR + LABEL) + round(88 / 200 * (100 // 4)) + BAR + LABEL
    with Picture.open(tmp_path / "sheet.png") as sheet:  # hazards look at three frames, the centre line at four
        assert sheet.size == (100, len(SITUATIONS) * (24 + 44 + BAR) + strips)


def test_the_figures_are_shares_and_the_same_for_a_seed(folder: Path, network: Network) -> None:
    found = {"red light": find_examples(folder, n=1, history=4, seed=0)["red light"]}
    (one,), (again,) = figures(network, found), figures(network, found)
    assert one == again
    assert one.examples == 1
    assert one.area == pytest.approx(400 / (HEIGHT * WIDTH))
    for curve in (one.network, one.random, one.centred):
        assert 0 <= curve.deletion <= 1
        assert 0 <= curve.insertion <= 1
    assert len(one.cascade) == 6
    assert abs(one.cascade[-1]) < 0.9


def test_each_example_has_a_random_map_of_its_own_of_the_resolution_of_its_attention(
    folder: Path, network: Network, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[Map] = []

    def random_map(like: Map, size: tuple[int, int], rng: np.random.Generator) -> Map:
        drawn.append(rng.random(like.shape).astype(np.float32))
        return np.zeros(size, np.float32)

    monkeypatch.setattr(recorded, "random_map", random_map)
    found = find_examples(folder, n=2, history=4, seed=0)["straight"]
    figures(network, {"straight": found})
    assert [one.shape for one in drawn] == [(11, 25)] * 2 * 4  # of two examples, each of four frames
    assert len({one.tobytes() for one in drawn}) == len(drawn)
