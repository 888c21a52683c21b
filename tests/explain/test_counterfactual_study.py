"""A study from end to end: short drives, a study that goes on, and what cannot be studied."""

from __future__ import annotations

import shutil
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
from caldrive.explain.activation_maps import Question
from caldrive.explain.cases import Case
from caldrive.explain.counterfactual_episode import StudyConfig, episode_path, shown_before
from caldrive.explain.counterfactual_study import study
from caldrive.explain.counterfactuals import Studio, see
from caldrive.explain.interventions import INTERVENTIONS
from caldrive.files import write_whole
from caldrive.perception.network.checkpoint import CheckpointInfo, save_network
from caldrive.perception.network.network import Network
from caldrive.perception.network.tensor_file import write_tensors
from caldrive.provenance import code_version
from caldrive.world.embedded import EmbeddedWorld
from caldrive.world.rendering.camera import CameraRig
from tests.command_line import run_json
from tests.explain.test_activation_maps import CONFIG
from tests.explain.test_counterfactuals import case


@pytest.fixture(scope="module")
def network() -> Network:
    torch.manual_seed(1)
    return Network(CONFIG).eval()


def test_pictures_are_those_that_the_world_would_have_shown(network: Network, no_sumo_left: None) -> None:
    (scenario,) = chosen_scenarios(EpisodeSettings(cars=0, people=20), 1)
    with closing(EmbeddedWorld(CameraConfig())) as world:
        first, scene, rig = world.reset(scenario), world.scene(), CameraRig(world.town)
    posts, question = rig.town.roads.posts, Question("red_light")
    red = Case(case("red light").situation, posts[0].id, None, question, (scene,))
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


@pytest.fixture
def config(network: Network, tmp_path: Path) -> StudyConfig:
    """Two short episodes, asked of a network that has learnt nothing."""
    path = tmp_path / "network.safetensors"
    save_network(path, network, CheckpointInfo(network.config))
    settings = EpisodeSettings(task="navigation-dynamic", people=60, cars=3, seconds=5.0)
    return StudyConfig(path, tuple(chosen_scenarios(settings, 2)), cases=2, method="gradcam", seed=3)


def test_a_study_that_was_killed_goes_on_to_the_same_end(
    config: StudyConfig, tmp_path: Path, no_sumo_left: None
) -> None:
    found = study(config, tmp_path / "whole")
    assert len(found.findings) == 7
    assert found.gap.cases == sum(n for n, _ in found.found.values()) > 0
    assert found.gap.other_answers == 0
    assert found.gap.difference == pytest.approx(0.0, abs=0.01)  # bf16 where the processor has it
    with Picture.open(found.sheet) as opened:
        assert np.asarray(opened).shape[2] == 3
    half = tmp_path / "half"
    shutil.copytree(found.sheet.parent, half)
    episode_path(half, 1).unlink()
    (half / "sheet.png").unlink()
    kept = episode_path(half, 0).stat().st_mtime_ns
    other = study(config, half)
    assert episode_path(half, 0).stat().st_mtime_ns == kept
    assert replace(other, sheet=found.sheet) == found
    assert other.sheet.read_bytes() == found.sheet.read_bytes()


def test_a_folder_holds_one_study_and_a_damaged_file_is_named(config: StudyConfig, tmp_path: Path) -> None:
    out = tmp_path / "study"
    for k in range(2):
        write_whole(episode_path(out, k), b"{}")
    study(config, out)
    with pytest.raises(ValueError, match=r"a study with seed 3, wanted 4: .* another --out"):
        study(replace(config, seed=4), out)
    write_whole(episode_path(out, 1), b'{"changes": 1}')
    with pytest.raises(ValueError, match=r"0001.json is damaged .*: remove it"):
        study(config, out)


def test_the_first_example_is_shown_whoever_was_faster(config: StudyConfig, tmp_path: Path) -> None:
    write_whole(episode_path(tmp_path, 1), b'{"rows": {"red light: the lamp is green": ""}}')
    assert shown_before(tmp_path, 0) == set()
    assert shown_before(tmp_path, 2) == {"red light: the lamp is green"}


def test_the_command_answers_with_effects_and_verdicts(tmp_path: Path, no_sumo_left: None) -> None:
    out = tmp_path / "study"
    words = f"--episodes 1 --seconds 1.5 --cars 0 --people 5 --cases 1 --workers 1 --out {out}"
    answer = run_json("explain", "counterfactuals", *words.split())
    assert (out / "sheet.png").is_file()
    assert {"found", "effects", "observations", "at_the_wheel"} < answer.keys()
    assert answer["code"] == code_version()
    assert {one["verdict"] for one in answer["observations"]} == {"too few cases"}


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("--weather", "15"), "found --weather 15, wanted 1 to 14"),
        (("--workers", "0"), "found --workers 0"),
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
