"""Every command, end to end and small."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from rich.table import Table
from rich.text import Text

from caldrive.agents.settings import AgentSettings
from caldrive.cli import _print, main, parse
from caldrive.commands import VERBS
from caldrive.commands.answer import Answer
from caldrive.datatypes import CameraConfig, Command, Image, Observation
from caldrive.driving.determinism import Comparison, EpisodeDigests, compare
from caldrive.perception.network.config import BlockConfig, NetworkConfig
from caldrive.timing import Stopwatch
from caldrive.visualization.hud import SIZE
from caldrive.world.embedded import EmbeddedWorld
from scripts.every_verb import COMMANDS, TAKE_DAYS, words
from tests.command_line import refusal, run_json

DRIVE = ["drive", "--town", "town02", "--task", "straight", "--cars", "3", "--people", "5"]
PREDICTED = ("hazard_stop", "red_light", "speed_sign", "vehicle_distance", "relative_angle", "center_distance")


@pytest.fixture(scope="session")
def model(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A network that has learnt nothing."""
    import torch

    from caldrive.perception.network.checkpoint import CheckpointInfo, save_network
    from caldrive.perception.network.network import Network

    torch.manual_seed(0)
    config = NetworkConfig(64, 32, 0.0625, vehicle_distance=BlockConfig("gru", 8, 0.0, length=3))
    path = tmp_path_factory.mktemp("model") / "random.safetensors"
    save_network(path, Network(config), CheckpointInfo(config, ranges=(3.0,) * 13))
    return str(path)


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    """Two seconds of each of two routes by the oracle: what is printed, and the folder."""
    out = tmp_path_factory.mktemp("drive") / "results"
    return run_json(*DRIVE, "--agent", "oracle", "--seconds", "2", "--episodes", "2", "--out", str(out)), out


def test_drive_reports_each_episode(driven: tuple[dict[str, Any], Path]) -> None:
    found, out = driven
    assert [one["file"] for one in found["episodes"]] == [str(out / f"episode-00{k}.json") for k in range(2)]
    for one in found["episodes"]:
        assert one["outcome"] == "timeout"
        assert one["duration"] == pytest.approx(2.0)
        assert 0 < one["distance"] < 15
        assert one["infractions"] == []
    assert found["episodes"][0]["scenario"]["goal"] != found["episodes"][1]["scenario"]["goal"]


def test_drive_writes_a_trace_of_every_step(driven: tuple[dict[str, Any], Path]) -> None:
    found, out = driven
    kept = json.loads((out / "episode-000.json").read_text())
    trace = kept["trace"]
    assert kept["result"] == {k: v for k, v in found["episodes"][0].items() if k != "file"}
    assert trace["time"] == pytest.approx([0.1 * i for i in range(21)])
    assert {len(column) for column in trace.values()} == {21}
    assert [trace["x"][0], trace["y"][0]] == pytest.approx(
        [kept["result"]["scenario"]["start"][k] for k in "xy"], abs=0.01
    )
    assert all(trace[f"predicted_{name}"] == trace[f"true_{name}"] for name in PREDICTED)


def test_drive_films_all_episodes_in_one_video(driven: tuple[dict[str, Any], Path]) -> None:
    found, out = driven
    assert found["video"] == str(out / "drive.mp4")
    with av.open(found["video"]) as film:
        shapes = [(frame.width, frame.height) for frame in film.decode(video=0)]
        assert film.streams.video[0].average_rate == 10
    assert shapes == [SIZE] * (2 * (21 + 15))
    assert sorted(p.name for p in out.iterdir()) == [
        *("drive.mp4", "episode-000.json", "episode-000.png", "episode-001.json", "episode-001.png")
    ]


def test_a_table_in_a_file_keeps_all_its_figures(capsys: pytest.CaptureFixture[str]) -> None:
    figures = [f"{k}0/100  {k}0 % (80-100)  paper 64" for k in range(5)]
    table = Table()
    table.add_row(*(Text(one, no_wrap=True) for one in figures))
    _print(Answer({}, table), as_json=False)
    shown = capsys.readouterr().out
    assert all(one in shown for one in figures)


def test_strict_ends_with_1_where_a_goal_was_not_reached(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = [*DRIVE, "--agent", "oracle", "--seconds", "0.5", "--no-video", "--out", str(tmp_path), "--strict"]
    assert main(arguments) == 1
    shown = capsys.readouterr().out
    assert "0 of 1 reached the goal" in shown
    assert str(tmp_path) in shown
    assert not (tmp_path / "drive.mp4").exists()


def test_cal_drives_from_the_image_and_its_trace_tells_seen_from_true(model: str, tmp_path: Path) -> None:
    run_json(*DRIVE, "--model", model, "--seconds", "0.5", "--no-video", "--out", str(tmp_path))
    trace = json.loads((tmp_path / "episode-000.json").read_text())["trace"]
    assert len(trace["time"]) == 6
    assert trace["predicted_vehicle_distance"] != trace["true_vehicle_distance"]


def test_an_image_that_tells_nothing_brakes_to_a_stand_and_says_why(model: str) -> None:
    from caldrive.agents.registry import agent_entry
    from caldrive.agents.rows import make_cal

    settings = AgentSettings(model=Path(model))
    agent, camera = make_cal(settings, 0.1), agent_entry("cal").camera(settings)
    assert camera is not None
    agent.reset()
    black = np.zeros((camera.height, camera.width, 3), np.uint8)
    for speed in (8.0, 3.0, 0.0):
        control = agent.act(Observation(0.0, black, speed, Command.STRAIGHT))
        assert control.throttle == 0.0
        assert control.brake >= 0.3
        assert agent.decision is not None
        assert "black" in agent.decision.note
    picture = black + np.linspace(0, 200, camera.width, dtype=np.uint8)[:, None]
    agent.act(Observation(0.0, picture, 0.0, Command.STRAIGHT))
    assert agent.decision is not None
    assert agent.decision.note == ""


def test_speed_world_says_where_the_time_goes() -> None:
    found = run_json("speed", "world", "--town", "town02", "--cars", "3", "--people", "5", "--steps", "10")
    assert {"camera", "traffic (SUMO)", "pedestrians", "lights", "labels and truth", "rest"} <= found["parts_ms"].keys()
    assert found["steps_per_second"] > 0
    assert found["first_frame"] > 0


def test_speed_is_compared_with_an_earlier_run_on_this_processor_only(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ("speed", "world", "--town", "town02", "--cars", "0", "--people", "0", "--steps", "3")
    found, file = run_json(*options), tmp_path / "before.json"
    file.write_text(json.dumps(found | {"median_ms": 2 * found["median_ms"]}))
    again = run_json(*options, "--against", str(file))
    assert again["ratios"]["whole step"] == pytest.approx(2 * found["median_ms"] / again["median_ms"])
    assert again["ratios"].keys() >= {"camera", "steps a second"}
    file.write_text(json.dumps(found | {"processor": "another"}))
    assert "found a measurement of another" in refusal(capsys, *options, "--against", str(file))
    file.write_text(json.dumps(found))
    assert "0 cars" in refusal(capsys, *options, "--cars", "3", "--against", str(file))
    file.write_text("{}")
    assert "no measurement" in refusal(capsys, *options, "--against", str(file))


def test_three_cameras_and_two_worlds_are_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    few = ("--town", "town02", "--cars", "0", "--people", "0", "--steps", "3")
    pictures, images = [0], EmbeddedWorld.images

    def counted(world: EmbeddedWorld, mounts: Sequence[CameraConfig]) -> list[Image]:
        pictures[-1] += len(mounts)
        return images(world, mounts)

    monkeypatch.setattr(EmbeddedWorld, "images", counted)
    for cameras in ("1", "3"):
        run_json("speed", "world", *few, "--cameras", cameras)
        pictures.append(0)
    assert pictures[1] - 1 == 3 * (pictures[0] - 1)  # the first is taken before the drive
    assert run_json("speed", "world", *few, "--workers", "2")["memory_mb"] > 100


def test_what_no_part_takes_is_the_rest() -> None:
    watch = Stopwatch()
    for _ in range(3):
        for _ in range(2):
            with watch.part("work"):
                pass
        watch.lap(1.0)
    assert [lap.keys() for lap in watch.laps] == [{"work", "rest"}] * 3
    assert all(sum(lap.values()) == pytest.approx(1.0) and 0 < lap["work"] < 1.0 for lap in watch.laps)


def test_speed_agent_gives_median_and_99th_percentile(model: str) -> None:
    found = run_json("speed", "agent", "--model", model, "--steps", "20")
    assert 0 < found["median_ms"] <= found["p99_ms"]
    assert (found["width"], found["height"]) == (64, 32)


def test_two_fresh_processes_drive_the_same_bytes() -> None:
    found = run_json("determinism", "--agent", "oracle", "--town", "town02", "--seconds", "1")
    assert found["equal"]
    assert found["steps"] == 11


def test_what_a_library_prints_is_not_in_the_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    def noisy(*_: object) -> Comparison:
        os.write(1, b"from C\n")
        print("from Python")
        return Comparison(steps=7, difference="", digest="")

    monkeypatch.setattr("caldrive.driving.determinism.check_determinism", noisy)
    assert run_json("determinism")["steps"] == 7


def test_every_verb_is_run_with_the_newest_libraries() -> None:
    assert {*COMMANDS, *TAKE_DAYS} == set(VERBS)
    for verb, options in COMMANDS.items():
        assert parse(words(f"{verb} {options}")).json


def test_runs_that_differ_end_with_1(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    different = compare(EpisodeDigests((("a",) * 4,), "r"), EpisodeDigests((("b",) * 4,), "r"))
    monkeypatch.setattr("caldrive.driving.determinism.check_determinism", lambda *_: different)
    assert main(["determinism"]) == 1
    assert "step 0 (0.0 s) differs in its image" in capsys.readouterr().out


def test_help_names_every_verb_and_loads_nothing_heavy() -> None:
    code = (
        "import sys\nfrom caldrive.cli import main\ntry: main(['--help'])\nexcept SystemExit: pass\n"
        "print('loaded', *{'torch', 'libsumo', 'numba', 'numpy', 'av'} & sys.modules.keys())"
    )
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert all(verb in shown for verb in ("drive", "see", "town", "speed", "determinism"))
    assert shown.splitlines()[-1].strip() == "loaded"
