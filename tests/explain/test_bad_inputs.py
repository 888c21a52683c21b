"""What cannot be explained ends in a sentence, before anything is driven or written."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from caldrive.affordances import describe
from caldrive.perception.network import checkpoint
from caldrive.perception.network.checkpoint import CheckpointInfo, save_network
from caldrive.perception.network.network import Network
from tests.command_line import run_json
from tests.explain.test_activation_maps import CONFIG
from tests.explain.test_live_attention import AGENT

COMMANDS = (
    ("drive", "--out", "out/attention.mp4"),
    ("pictures", "own.png", "--out", "out/attention.mp4"),
    ("pictures", "own.png", "--out", "out/attention.png"),
    ("recording", "recording", "--out", "out/attention.png"),
    ("counterfactuals", "--out", "out/counterfactuals"),
)


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_a_network_for_another_table_of_affordances_is_refused(
    command: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    torch.manual_seed(1)
    with monkeypatch.context() as other:
        other.setattr(checkpoint, "describe", lambda: describe()[:-1])
        save_network(tmp_path / "other.safetensors", Network(CONFIG), CheckpointInfo(CONFIG, ranges=(3.0,) * 13))
    monkeypatch.chdir(tmp_path)
    refused = run_json("explain", *command, "--model", "other.safetensors", code=2)
    assert "found in other.safetensors a network for other affordances, wanted those of this" in refused["error"]
    assert not (tmp_path / "out").exists()


def test_a_drive_of_an_agent_that_sees_something_else_is_refused(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(AGENT)
    out = tmp_path / "out" / "attention.mp4"
    refused = run_json("explain", "drive", "--agent", f"{tmp_path / 'own.py'}:Own", "--out", str(out), code=2)
    assert "found an agent whose camera gives 320 x 144, wanted 200 x 88" in refused["error"]
    assert not out.parent.exists()


def test_a_drive_of_an_agent_without_affordances_is_explained_by_the_network_of_the_package(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(AGENT.replace("width=320, height=144", "width=200, height=88"))
    out = tmp_path / "attention.mp4"
    answer = run_json(
        "explain", "drive", "--agent", f"{tmp_path / 'own.py'}:Own", "--seconds", "0.3", "--affordance", "red_light",
        "--out", str(out),
    )  # fmt: skip
    assert answer == {"video": str(out), "frames": 4}
