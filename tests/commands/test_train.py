"""The verb `train`, end to end and small, and what its options, its presets and a file of settings say."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from caldrive.cli import main, parse
from caldrive.perception.network.config import NETWORKS
from caldrive.perception.training.config import TRAININGS, LossWeights
from tests.command_line import run_json
from tests.commands.test_commands import DRIVE


def parsed(*options: str) -> Any:
    return parse(["train", *options])


def test_what_is_collected_can_be_trained_on_and_the_result_drives(tmp_path: Path) -> None:
    recording, training = str(tmp_path / "recording"), str(tmp_path / "training")
    answer = run_json("collect", "--out", recording, "--episodes", "2", "--duration", "1", "--workers", "1")
    assert sum(answer["counts"]["hazard_stop"].values()) == 2 * 10 * 3  # episodes, time steps, cameras
    small = ("--steps", "5", "--batch", "2", "--window", "3", "--save-every", "1")
    second_stage = ("--history-steps", "3", "--history-batch", "8")
    model = run_json("train", "--data", recording, "--out", training, *small, *second_stage)["model"]
    another = ("--initial", model, "--network.hazard-stop.dilation", "3", "--out", str(tmp_path / "another"))
    answer = run_json("train", "--data", recording, *another, "--steps", "1", "--batch", "2", "--history-steps", "0")
    assert answer["new_blocks"] == ["hazard_stop"]
    evaluation = run_json("evaluate", "--data", recording, "--model", model, "--held-out")
    assert 0 < evaluation["frames"] <= 10 * 3  # one of the two episodes
    assert 0 <= evaluation["overall"]["relative_angle/mae"] <= math.pi
    assert evaluation["paper"]["red_light/iou"] == 0.9395
    checked = run_json("data", recording, "--picture", str(tmp_path / "labels.png"))
    assert (checked["episodes"], checked["damaged"]) == (2, [])
    driven = run_json(*DRIVE, "--model", model, "--seconds", "1", "--no-video", "--out", str(tmp_path / "drive"))
    assert driven["episodes"][0]["duration"] == pytest.approx(1.0)


def test_without_options_the_small_network_is_trained() -> None:
    train = parsed()
    assert (train.training, train.network) == (TRAININGS["small"], NETWORKS["small"])


def test_every_setting_of_the_training_and_of_the_network_is_an_option() -> None:
    train = parsed(
        *("--batch", "32", "--rate", "1e-4", "--loss-weights.red-light", "2", "--recolour.shadows", "1"),
        *("--augmentation.enabled", "False", "--network.red-light.layer", "gru", "--network.red-light.nodes", "100"),
    )
    small = TRAININGS["small"]
    assert train.training == replace(
        small,
        batch=32,
        learning_rate=1e-4,
        loss_weights=LossWeights(red_light=2.0, relative_angle=5.0),
        augmentation=replace(small.augmentation, enabled=False),
        recolour=replace(small.recolour, shadows=1),
    )
    network = NETWORKS["small"]
    assert train.network == replace(network, red_light=replace(network.red_light, layer="gru", nodes=100))


def test_a_preset_gives_the_defaults_of_all_other_options() -> None:
    train = parsed("--preset", "paper", "--steps", "9")
    assert train.training == replace(TRAININGS["paper"], steps=9)
    assert train.network == NETWORKS["paper"]


def test_a_file_holds_the_same_settings_and_the_command_line_goes_before_it(tmp_path: Path) -> None:
    file = tmp_path / "settings.toml"
    file.write_text(
        'preset = "paper"\nsteps = 12\nbatch = 8\n[augmentation]\nblur = 0.5\n[network.red_light]\nnodes = 7\n'
    )
    train = parsed("--config", str(file), "--steps", "13")
    paper, network = TRAININGS["paper"], NETWORKS["paper"]
    blur = replace(paper.augmentation, blur=0.5)
    assert train.training == replace(paper, steps=13, batch=8, augmentation=blur)
    assert train.network == replace(network, red_light=replace(network.red_light, nodes=7))
    assert parsed("--config", str(file), "--preset", "small").network.width == NETWORKS["small"].width


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("--network.red-light.nodes", "0"), "found a task block of 0 nodes"),
        (("--network.red-light.layer", "perceptron"), "wanted one of dense, lstm, gru, tconv"),
        (("--network.width", "-1"), "found a network of width -1.0"),
        (("--preset", "huge"), "wanted one of small, paper: type --preset small"),
        (("--steps", "2", "--history-steps", "2"), "found --history-steps 2, wanted 0 to 1: type --history-steps 0"),
        (("--cache-gb", "-1"), "found --cache-gb -1.0, wanted 0.0 or more"),
        (("--batch", "0"), "found --batch 0, wanted 1 to 100000: type --batch 64"),
        (("--balance", "2"), "type --balance 0.5"),
        (("--recolour.patches", "-1"), "found --recolour.patches -1, wanted 0 or more: type --recolour.patches 12"),
        (("--loss-weights.red-light", "-1"), "wanted 0.0 or more: type --loss-weights.red-light 1.0"),
        (("--augmentation.rare-share", "1.5"), "wanted 0 to 1.0: type --augmentation.rare-share 0.2"),
        (("--initial", "a.safetensors", "--imagenet", "b.pth"), "wanted one network to begin with"),
        (("--initial", "gone.safetensors"), "found no file gone.safetensors, wanted a network"),
    ],
    ids=str,
)
def test_settings_that_cannot_be_end_in_a_sentence(
    options: tuple[str, ...],
    sentence: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["train", *options]) == 2
    message = capsys.readouterr().err
    assert sentence in message
    assert message.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_training_says_which_blocks_begin_with_new_weights(tmp_path: Path) -> None:
    from caldrive.perception.network.checkpoint import CheckpointInfo, save_network
    from caldrive.perception.network.network import Network
    from caldrive.perception.training.initial import untrained_blocks

    usual, initial = NETWORKS["small"], tmp_path / "other.safetensors"
    other = replace(usual, hazard_stop=replace(usual.hazard_stop, dilation=5))
    save_network(initial, Network(other), CheckpointInfo(other))
    assert untrained_blocks(replace(TRAININGS["small"], initial=str(initial)), usual) == ["hazard_stop"]
    assert untrained_blocks(TRAININGS["small"], usual) == []


def test_imagenets_weights_are_asked_for_by_a_training_that_begins_and_not_by_one_that_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("TORCH_HOME", str(tmp_path / "hub"))
    train = ["train", "--preset", "paper", "--data", str(tmp_path / "none"), "--out", str(tmp_path / "out")]
    assert main(train) == 2
    assert "found no vgg16-*.pth" in capsys.readouterr().err
    (tmp_path / "out").mkdir(exist_ok=True)
    (tmp_path / "out" / "state.safetensors").touch()
    assert main(train) == 2
    assert "there is no episode" in capsys.readouterr().err
