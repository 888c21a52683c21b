"""Where the network looks while a car drives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from caldrive.datatypes import CameraConfig, Command, Observation
from caldrive.explain.attention_video import PANEL_WIDTH
from caldrive.explain.live_attention import LiveAttention
from caldrive.perception.network.network import Network
from tests.command_line import run_json
from tests.explain.test_activation_maps import CONFIG, pictures

AGENT = """
from caldrive import CameraConfig, Control

class Own:
    camera = CameraConfig(width=320, height=144)

    def reset(self):
        pass

    def act(self, observation):
        return Control()
"""


def test_attention_is_drawn_while_a_car_drives(monkeypatch: pytest.MonkeyPatch) -> None:
    torch.manual_seed(1)
    network = Network(CONFIG).eval()
    monkeypatch.setattr("caldrive.explain.live_attention.load_network", lambda path: (network, None))
    live, images = LiveAttention("relative_angle", CameraConfig()), pictures(2)

    def at(time: float, image: np.ndarray, command: Command = Command.LEFT) -> Observation:
        return Observation(time, image, 5.0, command)

    left = live(at(0.0, images[0]))
    assert left is not None
    assert left.shape[1] == PANEL_WIDTH
    assert live(at(0.1, images[1][:40])) is None
    right = LiveAttention("relative_angle", CameraConfig())(at(0.0, images[0], Command.RIGHT))
    assert right is not None
    assert (left != right).any()


def test_a_drive_that_nobody_records_draws_no_attention() -> None:
    refused = run_json("drive", "--agent", "oracle", "--attention", "red_light", "--no-video", code=2)
    assert "found --attention red_light in a drive that is not recorded" in refused["error"]


def test_an_agent_whose_images_the_network_does_not_take_is_told_before_it_drives(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(AGENT)
    recorded = ("--record", str(tmp_path / "drive.mcap"), "--out", str(tmp_path / "out"))
    refused = run_json(
        "drive", "--agent", f"{tmp_path / 'own.py'}:Own", "--attention", "red_light", "--seconds", "1", *recorded,
        code=2,
    )  # fmt: skip
    assert "found an agent whose camera gives 320 x 144, wanted 200 x 88" in refused["error"]
    assert not (tmp_path / "out").exists()
