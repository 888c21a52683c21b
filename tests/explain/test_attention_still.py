"""Where the network looks in one picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from PIL import Image as Picture

from caldrive.datatypes import Command
from caldrive.explain.activation_maps import Question
from caldrive.explain.attention_still import _still
from caldrive.explain.attention_video import PANEL_WIDTH, Scene
from caldrive.perception.network.network import Network
from tests.command_line import run_json
from tests.explain.test_activation_maps import CONFIG, pictures


def read(path: Path) -> np.ndarray:
    with Picture.open(path) as picture:
        return np.asarray(picture)


def test_the_raw_picture_stands_beside_each_affordance(tmp_path: Path) -> None:
    (image,), out = pictures(1), tmp_path / "attention.png"
    Picture.fromarray(image).save(tmp_path / "own.png")
    asked = ("--affordance", "red_light", "--affordance", "speed_sign=60")
    answer = run_json("explain", "pictures", str(tmp_path / "own.png"), *asked, "--out", str(out))
    assert answer == {"still": str(out)}
    page = read(out)
    height = round(PANEL_WIDTH * image.shape[0] / image.shape[1])
    assert page.shape[1] == 2 * PANEL_WIDTH
    small = Picture.fromarray(page[:height, :PANEL_WIDTH]).resize((image.shape[1], image.shape[0]))
    assert np.abs(np.asarray(small).astype(int) - image).mean() < 25  # enlarged and made small again
    assert (page[:height, PANEL_WIDTH:] != page[:height, :PANEL_WIDTH]).any()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["attention.png", "own.png"]


def test_the_pictures_before_the_last_are_its_history(tmp_path: Path) -> None:
    torch.manual_seed(1)
    network, images = Network(CONFIG).eval(), pictures(5)
    scenes = [Scene(image, Command.LEFT, 0.5) for image in images]
    question = [Question("hazard_stop")]
    assert _still(network, scenes, question, "hirescam") == _still(network, iter(scenes), question, "hirescam")
    assert _still(network, scenes, question, "hirescam") != _still(network, scenes[-1:], question, "hirescam")
