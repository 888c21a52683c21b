"""The verb `baselines`: which trainings there are, and that it goes on where it was stopped."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from caldrive.commands import baselines
from caldrive.commands.answer import Answer
from caldrive.commands.baselines import TRAININGS, Baselines
from caldrive.progress import silent
from tests.command_line import run_json


class FakeTraining:
    """Writes a network, or is killed."""

    killed: str | None = None

    def __init__(self, data: Path, out: Path) -> None:
        self.out = out

    def run(self, progress: Any) -> Answer:
        if self.out.name == FakeTraining.killed:
            raise KeyboardInterrupt
        self.out.mkdir(parents=True)
        (self.out / "model.safetensors").write_bytes(b"network")
        return Answer({}, "")


def test_every_system_has_its_variants_and_seeds() -> None:
    commands = {name: make(Path("data"), Path("out") / name) for name, make in TRAININGS.items()}
    assert {name for name in commands if name.startswith("cil")} == {
        f"cil-{preset}-{seed}" for preset in ("published", "cal-backbone") for seed in (0, 1, 2)
    }
    assert {name for name in commands if name.startswith("mp")} == {"mp-published", "mp-all-frames"}
    assert len([name for name in commands if name.startswith("rl")]) == 9
    assert commands["cil-cal-backbone-2"].training.seed == 2
    assert commands["cil-cal-backbone-2"].network.backbone == "cal"
    assert commands["mp-published"].training.frames == 2500
    assert (commands["rl-paper-0"].training.steps, commands["rl-modern-1"].training.steps) == (2_000_000, 3_000_000)
    assert commands["rl-modern-1"].training.encoder == Path("out/mp-all-frames/model.safetensors")
    order = list(commands)
    assert order.index("mp-all-frames") < order.index("rl-modern-0")
    firsts = ("mp-all-frames", "cil-published-0", "rl-affordances-0", "rl-paper-0")
    assert max(map(order.index, firsts)) < order.index("cil-published-1")  # each system before any other seed


def test_what_is_there_is_kept_and_a_run_that_was_stopped_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(baselines, "TRAININGS", dict.fromkeys(("one", "two", "three"), FakeTraining))
    monkeypatch.setattr(FakeTraining, "killed", "two")
    verb = Baselines(data=tmp_path, out=tmp_path / "out")
    with pytest.raises(KeyboardInterrupt):
        verb.run(silent)
    monkeypatch.setattr(FakeTraining, "killed", None)
    assert verb.run(silent).values["models"]["three"] == str(tmp_path / "out" / "three" / "model.safetensors")
    lines = [json.loads(line) for line in (tmp_path / "out" / "log.jsonl").read_text().splitlines()]
    assert [(line["training"], line["done"]) for line in lines if "done" in line] == [
        ("one", True), ("two", False), ("two", True), ("three", True),
    ]  # fmt: skip
    assert [line["training"] for line in lines if "began" in line] == ["one", "two", "two", "three"]
    replace(verb, only=("two",)).run(silent)
    assert len((tmp_path / "out" / "log.jsonl").read_text().splitlines()) == 8


def test_a_training_that_there_is_not_is_named(tmp_path: Path) -> None:
    refused = run_json("baselines", "--only", "cil-7", "--out", str(tmp_path / "out"), code=2)
    assert "found --only cil-7, wanted one of mp-" in refused["error"]
    assert not (tmp_path / "out").exists()


def test_what_a_training_needs_is_looked_for_before_the_first_begins(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(baselines, "LEARNERS", ("gymnasium", "no_such_learner"))
    out = str(tmp_path / "out")
    refused = run_json("baselines", "--data", str(tmp_path), "--only", "rl-paper-0", "--out", out, code=2)
    assert refused["error"] == "found no no_such_learner, wanted it: type pip install 'caldrive[rl]'"
    assert not (tmp_path / "out" / "log.jsonl").exists()
