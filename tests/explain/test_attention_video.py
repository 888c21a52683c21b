"""Videos of where the network looks."""

from __future__ import annotations

import weakref
from collections.abc import Iterator
from pathlib import Path

import av
import numpy as np
import pytest
import torch
from PIL import Image as Picture

from caldrive.datatypes import Affordances, Command, Image
from caldrive.explain.activation_maps import Question
from caldrive.explain.attention_video import PANEL_WIDTH, Scene, _write, grid, look, panels
from caldrive.perception.network.network import Network
from caldrive.progress import silent
from tests.command_line import run_json
from tests.explain.test_activation_maps import CONFIG, pictures


def frames_of(path: Path) -> list[np.ndarray]:
    with av.open(str(path)) as video:
        return [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]


def test_each_scene_has_the_ones_before_it_as_its_history() -> None:
    torch.manual_seed(1)
    network, images = Network(CONFIG).eval(), pictures(4)

    def scenes() -> Iterator[Scene]:
        yield from (Scene(image, Command.LEFT, 0.5) for image in images)

    looked = list(look(network, scenes(), [Question("hazard_stop"), Question("relative_angle")], "hirescam"))
    assert len(looked) == 4
    assert [len(one.attentions) for one in looked] == [2] * 4
    alone = next(look(network, iter([Scene(images[3], Command.LEFT, 0.5)]), [Question("hazard_stop")], "hirescam"))
    assert (looked[3].attentions[0].now != alone.attentions[0].now).any()
    assert panels(looked[0], (1.0, 1.0)).shape[1] == 2 * PANEL_WIDTH


def test_what_is_true_stands_beside_what_the_network_says() -> None:
    torch.manual_seed(1)
    network, (image,) = Network(CONFIG).eval(), pictures(1)
    questions = [Question("red_light"), Question("speed_sign"), Question("vehicle_distance")]
    truth = Affordances(red_light=1.0, speed_sign=None, vehicle_distance=7.0)
    (known,) = look(network, [Scene(image, Command.LEFT, 0.5, truth)], questions, "hirescam")
    (unknown,) = look(network, [Scene(image, Command.LEFT, 0.5)], questions, "hirescam")
    assert known.truths == ("yes", "none", "7.00")
    assert unknown.truths == ("", "", "")
    assert (panels(known, (1.0,) * 3) != panels(unknown, (1.0,) * 3)).any()


def test_a_long_video_is_not_kept_in_memory(tmp_path: Path) -> None:
    torch.manual_seed(1)
    network, alive, most = Network(CONFIG).eval(), list[weakref.ref[Image]](), 0

    def scenes() -> Iterator[Scene]:
        nonlocal most
        for image in pictures(12):
            image = image.copy()
            alive.append(weakref.ref(image))
            most = max(most, sum(one() is not None for one in alive))
            yield Scene(image, Command.LEFT, 0.5)

    out = tmp_path / "attention.mp4"
    assert _write(network, scenes(), [Question("hazard_stop")], "hirescam", out, 10.0, silent) == 12
    assert most <= network.span + 2
    assert len(frames_of(out)) == 12
    assert list(tmp_path.iterdir()) == [out]


def test_pictures_of_different_heights_stand_beside_each_other() -> None:
    low, high = (np.full((height, 10, 3), height, np.uint8) for height in (4, 6))
    page = grid([low, high, low])
    assert page.shape == (10, 20, 3)
    assert (page[:4, :10] == 4).all()
    assert (page[4:6, :10] != 4).all()
    assert (page[:6, 10:] == 6).all()


def test_a_drive_is_filmed(tmp_path: Path) -> None:
    out = tmp_path / "attention.mp4"
    answer = run_json(
        "explain", "drive", "--agent", "oracle", "--seconds", "0.5", "--affordance", "speed_sign", "--out", str(out)
    )
    assert answer["frames"] == len(frames_of(out)) == 6


def test_pictures_of_ones_own_are_filmed(tmp_path: Path) -> None:
    folder = tmp_path / "pictures"
    folder.mkdir()
    for k, image in enumerate(pictures(2)):
        Picture.fromarray(image).save(folder / f"{k}.png")
    out = tmp_path / "attention.mp4"
    answer = run_json(
        "explain", "pictures", str(folder), "--crop", "10:80", "--affordance", "red_light", "--out", str(out)
    )
    assert answer["frames"] == 2


def test_rows_that_a_picture_does_not_have_are_named(tmp_path: Path) -> None:
    path = tmp_path / "low.png"
    Picture.fromarray(pictures(1)[0]).save(path)
    refused = run_json("explain", "pictures", str(path), "--crop", "88:400", "--out", str(tmp_path / "x.mp4"), code=2)
    assert "found --crop 88:400 where low.png has 88 rows" in refused["error"]


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("drive", "--affordance", "lights"), "found affordance 'lights', wanted one of hazard_stop"),
        (
            ("drive", "--affordance", "speed_sign=50"),
            "found class 50 of speed sign, wanted one of its classes (0, 30, 60, 90): type speed_sign=90",
        ),
        (("drive", "--out", "x.txt"), "wanted a name that ends in .mp4"),
        (("recording", "none"), "there is no episode"),
        (("recording", "none", "--out", "x.jpg"), "wanted a name that ends in .png"),
        (("recording", "none", "--examples", "0"), "found --examples 0, wanted 1 to 100"),
    ],
    ids=str,
)
def test_what_cannot_be_explained_ends_in_a_sentence(options: tuple[str, ...], sentence: str) -> None:
    assert sentence in run_json("explain", *options, code=2)["error"]
