"""Videos of where the network looks."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import av
import numpy as np
import pytest
import torch
from PIL import Image as Picture

from caldrive.datatypes import Command, Observation
from caldrive.explain.activation_maps import Question
from caldrive.explain.attention_video import PANEL_WIDTH, LiveAttention, Scene, look, panels
from caldrive.perception.network.network import Network
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


def test_attention_is_drawn_while_a_car_drives(monkeypatch: pytest.MonkeyPatch) -> None:
    torch.manual_seed(1)
    network = Network(CONFIG).eval()
    monkeypatch.setattr("caldrive.explain.attention_video.load_network", lambda path: (network, None))
    live, images = LiveAttention("relative_angle"), pictures(2)

    def at(time: float, image: np.ndarray, command: Command = Command.LEFT) -> Observation:
        return Observation(time, image, 5.0, command)

    left = live(at(0.0, images[0]))
    assert left is not None
    assert left.shape[1] == PANEL_WIDTH
    assert live(at(0.1, images[1][:40])) is None
    right = LiveAttention("relative_angle")(at(0.0, images[0], Command.RIGHT))
    assert right is not None
    assert (left != right).any()


def test_a_drive_that_nobody_records_draws_no_attention() -> None:
    refused = run_json("drive", "--agent", "oracle", "--attention", "red_light", "--no-video", code=2)
    assert "found --attention red_light in a drive that is not recorded" in refused["error"]


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("drive", "--affordance", "lights"), "found affordance 'lights', wanted one of hazard_stop"),
        (("drive", "--out", "x.txt"), "wanted a name that ends in .mp4"),
        (("recording", "none"), "there is no episode"),
        (("recording", "none", "--out", "x.jpg"), "wanted a name that ends in .png"),
        (("recording", "none", "--examples", "0"), "found --examples 0, wanted 1 to 100"),
    ],
    ids=str,
)
def test_what_cannot_be_explained_ends_in_a_sentence(options: tuple[str, ...], sentence: str) -> None:
    assert sentence in run_json("explain", *options, code=2)["error"]
