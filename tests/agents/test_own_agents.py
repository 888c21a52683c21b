"""An agent of ten lines in a file drives wherever an agent is taken; one that returns nonsense ends in a sentence."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import av
import pytest

from caldrive import plugins
from caldrive.agents.registry import agent_entry
from caldrive.agents.settings import AgentSettings
from caldrive.benchmark.run_folder import RunFolder
from caldrive.benchmark.suites import suite, to_json
from caldrive.datatypes import CameraConfig
from caldrive.visualization.hud import SIZE
from tests.command_line import refusal, run_json, write_agent

pytestmark = pytest.mark.usefixtures("no_sumo_left")

CRUISER = """
from caldrive import Control

class Cruiser:
    def act(self, observation):
        return Control(throttle=0.4 if observation.speed < 4.0 else 0.0)
"""
DRIVE = ["drive", "--town", "town02", "--task", "straight", "--cars", "2", "--people", "3", "--seconds", "1"]


@pytest.fixture(scope="module")
def agent(tmp_path_factory: pytest.TempPathFactory) -> str:
    """What to type behind --agent for the agent of ten lines."""
    path = tmp_path_factory.mktemp("agent") / "cruiser.py"
    path.write_text(CRUISER)
    return f"{path}:Cruiser"


@pytest.fixture(scope="module")
def short_suite(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three trials of 6 s; in the second one, straight on leads over the sidewalk."""
    path = tmp_path_factory.mktemp("suite") / "short.json"
    trials = [replace(trial, scenario=replace(trial.scenario, time_limit=6.0)) for trial in suite("quick")[4:7]]
    path.write_text(to_json(trials))
    return path


@pytest.fixture(scope="module")
def benchmarked(agent: str, short_suite: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a whole run with two workers."""
    out = tmp_path_factory.mktemp("benchmark") / "whole"
    run_json("benchmark", "--agent", agent, "--suite", str(short_suite), "--workers", "2", "--out", str(out))
    return out


def test_it_drives_and_is_filmed(agent: str, tmp_path: Path) -> None:
    report = run_json(*DRIVE, "--agent", agent, "--out", str(tmp_path))
    assert report["episodes"][0]["distance"] > 0.2
    with av.open(report["video"]) as film:
        assert [(frame.width, frame.height) for frame in film.decode(video=0)] == [SIZE] * (11 + 15)
    trace = json.loads((tmp_path / "episode-000.json").read_text())["trace"]
    assert trace["throttle"] == [0.4] * 11
    for column in ("state", "speed_limit", "target_speed", "note", "predicted_hazard_stop"):
        assert trace[column] == [None] * 11
    assert (tmp_path / "episode-000.png").stat().st_size > 1000


def test_it_may_be_a_class_of_a_module_or_offered_by_an_installed_package(
    agent: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.syspath_prepend(str(Path(agent.rpartition(":")[0]).parent))
    entry = EntryPoint("cruiser", "cruiser:Cruiser", "caldrive.agents")
    monkeypatch.setattr(plugins, "entry_points", lambda group, name="cruiser": [entry] if name == "cruiser" else [])
    drives = [run_json(*DRIVE, "--no-video", "--agent", name, "--out", str(tmp_path)) for name in (agent, "cruiser")]
    drives.append(run_json(*DRIVE, "--no-video", "--agent", "cruiser:Cruiser", "--out", str(tmp_path)))
    assert drives[0] == drives[1] == drives[2]
    refused = refusal(capsys, *DRIVE, "--agent", "crusier", "--out", str(tmp_path))
    assert (
        "found agent 'crusier', wanted one of cal, oracle, cil, mp, rl, rl-oracle, cruiser, or your own class"
        in refused
    )


def test_a_benchmark_broken_off_goes_on_to_the_same_results(
    agent: str, short_suite: Path, benchmarked: Path, tmp_path: Path
) -> None:
    whole = (benchmarked / "results.jsonl").read_bytes().splitlines(keepends=True)
    (tmp_path / "run.json").write_bytes((benchmarked / "run.json").read_bytes())
    (tmp_path / "results.jsonl").write_bytes(whole[0] + whole[1][:30])
    run_json("benchmark", "--agent", agent, "--suite", str(short_suite), "--workers", "1", "--out", str(tmp_path))
    assert sorted((tmp_path / "results.jsonl").read_bytes().splitlines(keepends=True)) == sorted(whole)


def test_an_episode_driven_again_is_the_same(benchmarked: Path, tmp_path: Path) -> None:
    key = next(key for key, line in RunFolder(benchmarked).lines().items() if line["result"]["infractions"])
    assert run_json("replay", str(benchmarked), key, "--out", str(tmp_path / "again.mp4"))["same"]


def test_its_report_has_no_affordances_and_says_so(benchmarked: Path, tmp_path: Path) -> None:
    report = run_json("report", str(benchmarked), "--out", str(tmp_path))
    assert report["runs"] == ["Cruiser"]
    assert report["failures"] == 3
    text, page = ((tmp_path / name).read_text() for name in ("report.md", "report.html"))
    for written in (text, page):
        assert "was too slow" in written
        assert "sidewalk at 4." in written
        assert "not known" in written
        assert "ffordances while driving" not in written
        assert "Errors of the affordances" not in written


def test_its_report_stands_beside_that_of_an_agent_with_affordances(
    short_suite: Path, benchmarked: Path, tmp_path: Path
) -> None:
    run_json(
        *("benchmark", "--agent", "oracle", "--suite", str(short_suite), "--workers", "1"),
        *("--out", str(tmp_path / "oracle")),
    )
    run_json("report", str(benchmarked), str(tmp_path / "oracle"), "--out", str(tmp_path))
    lines = (tmp_path / "report.md").read_text().splitlines()
    widths = {line.count("|") for line in lines[lines.index("## Affordances while driving") :][4:7]}
    assert widths == {3 + 6}
    assert "Errors of the affordances" in (tmp_path / "report.html").read_text()


def test_it_is_the_same_twice_and_can_be_timed(agent: str) -> None:
    assert run_json("determinism", "--agent", agent, "--town", "town02", "--seconds", "0.5")["equal"]
    speed = run_json("speed", "agent", "--agent", agent, "--steps", "5")
    assert 0 < speed["median_ms"] < 1
    assert (speed["width"], speed["height"]) == (200, 88)


def test_a_benchmark_does_not_go_on_with_a_changed_agent(
    short_suite: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "cruiser.py"
    path.write_text(CRUISER)
    arguments = ("benchmark", "--agent", f"{path}:Cruiser", "--suite", str(short_suite), "--workers", "1")
    run_json(*arguments, "--out", str(tmp_path / "run"))
    path.write_text(CRUISER + "# changed\n")
    assert "results with agent_source" in refusal(capsys, *arguments, "--out", str(tmp_path / "run"))


NONSENSE = {
    "nothing": ("return None", "returned None at step 0 (0.0 s), wanted a Control"),
    "a dictionary": ("return {'throttle': 1.0}", "returned {'throttle': 1.0} at step 0 (0.0 s), wanted a Control"),
    "too much throttle": ("return Control(throttle=1.5)", "ValueError: throttle is 1.5, but must lie in [0, 1]"),
    "a steering angle that is no number": ("return Control(steer=float('nan'))", "ValueError: steer is nan"),
    "an error": ("return 1 / observation.time", "at step 0 (0.0 s) (ZeroDivisionError: float division by zero, own"),
    "an error that is none of Python's usual ones": (
        "raise GeneratorExit",
        "failed at step 0 (0.0 s) (GeneratorExit: , own",
    ),
    "an end of the program": ("raise SystemExit(0)", "Own failed at step 0 (0.0 s) (SystemExit: 0, own"),
    "an array of numbers": ("return Control(np.array([0.1]))", "Own failed at step 0 (0.0 s) (TypeError: only 0-dim"),
    "an error later on": ("return 3 if observation.time > 0.25 else Control()", "returned 3 at step 3 (0.3 s), wanted"),
    "a decision that is none": (
        "self.decision = 'fast'\nreturn Control()",
        "is 'fast' at step 0 (0.0 s), wanted a Dec",
    ),
    "a decision without a control": (
        "self.decision = Decision(None)\nreturn Control()",
        "has control None at step 0 (0.0 s), wanted a Control",
    ),
    "a state that is no text": (
        "self.decision = Decision(Control(), state=3)\nreturn Control()",
        "has state 3 at step 0",
    ),
    "affordances that are none": (
        "self.decision = Decision(Control(), affordances={})\nreturn Control()",
        "has affordances {} at step 0 (0.0 s), wanted a Affordances",
    ),
    "an affordance that is no number": (
        "self.decision = Decision(Control(), Affordances(red_light='yes'))\nreturn Control()",
        "gives 'yes' as red_light at step 0 (0.0 s), wanted a number",
    ),
}


@pytest.mark.parametrize("nonsense", NONSENSE)
def test_nonsense_ends_in_a_sentence_with_the_step_and_the_value(
    nonsense: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    body, message = NONSENSE[nonsense]
    agent = write_agent(tmp_path, "def act(self, observation):\n    " + body.replace("\n", "\n    "))
    assert message in refusal(capsys, *DRIVE, "--no-video", "--agent", agent, "--out", str(tmp_path / "out"))
    assert message in refusal(capsys, "speed", "agent", "--agent", agent, "--steps", "5")


def test_nonsense_in_a_benchmarks_worker_names_the_episode(
    short_suite: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    agent = write_agent(tmp_path, "def act(self, observation):\n    return Control(0.0) if observation.time < 1 else 7")
    for workers in ("1", "2"):
        message = refusal(
            *(capsys, "benchmark", "--agent", agent, "--suite", str(short_suite), "--workers", workers),
            *("--out", str(tmp_path / "out")),
        )
        assert "Own returned 7 at step 10 (1.0 s), wanted a Control" in message
        assert "in episode town01-w01-" in message


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("def drive(self): pass", "Own has no method act"),
        ("camera = (200, 88)\ndef act(self, observation): pass", "Own has camera (200, 88), wanted a CameraConfig"),
        ("def __init__(self, speed): pass", "Own cannot be made (TypeError"),
        (
            "def act(self, observation): pass\ndef reset(self): raise KeyError('x')",
            "failed at its reset (KeyError: 'x'",
        ),
        (
            "def act(self, observation): pass\ndef __getattr__(self, name): raise RuntimeError(name)",
            "Own failed at its reset (RuntimeError: reset",
        ),
        ("def __getattr__(self, name): raise RuntimeError(name)", "Own fails when asked for act (RuntimeError: act"),
    ],
)
def test_a_class_that_is_no_agent_is_named(
    body: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    agent = write_agent(tmp_path, body)
    assert message in refusal(capsys, *DRIVE, "--no-video", "--agent", agent, "--out", str(tmp_path / "out"))


@pytest.mark.parametrize("option", ["model", "controller"])
def test_an_option_that_it_would_never_see_is_refused(
    option: str, agent: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    value = "paper" if option == "controller" else str(tmp_path)
    message = refusal(capsys, *DRIVE, "--agent", agent, f"--{option}", value, "--out", str(tmp_path / "out"))
    assert f"but Cruiser takes none: leave --{option} out" in message


def test_a_decision_may_say_some_things_only_and_in_numpys_numbers(short_suite: Path, tmp_path: Path) -> None:
    """The reasons are a state and a target, and after a while three of the six affordances."""
    agent = write_agent(
        tmp_path,
        "def act(self, observation):\n"
        "    known = {'hazard_stop': np.float32(0.25), 'red_light': float('nan'), 'vehicle_distance': float('nan'),\n"
        "             'relative_angle': float('nan'), 'center_distance': np.float32(0.5)}\n"
        "    seen = Affordances(**known) if observation.time > 0.55 else None\n"
        "    self.decision = Decision(Control(), seen, 'hazard stop', target_speed=np.float32(0.5))\n"
        "    return Control(throttle=np.float32(0.25), brake=np.float32(0.5))",
    )
    run_json(*DRIVE, "--agent", agent, "--out", str(tmp_path / "drive"))
    trace = json.loads((tmp_path / "drive" / "episode-000.json").read_text())["trace"]
    assert trace["throttle"] == [0.25] * 11
    assert trace["target_speed"] == [0.5] * 11
    assert trace["predicted_hazard_stop"] == [None] * 6 + [0.25] * 5
    assert trace["predicted_red_light"] == [None] * 11
    benchmark = tmp_path / "run"
    run_json("benchmark", "--agent", agent, "--suite", str(short_suite), "--workers", "1", "--out", str(benchmark))
    figures = next(iter(RunFolder(benchmark).lines().values()))["figures"]
    assert {name for name in figures if name.startswith("error/")} == {
        "error/hazard_stop", "error/speed_sign", "error/center_distance"
    }  # fmt: skip
    run_json("report", str(benchmark), "--out", str(tmp_path))
    assert "center distance m" in (tmp_path / "report.md").read_text()


@pytest.mark.parametrize(
    ("camera", "expected"),
    [
        ("", CameraConfig()),
        ("camera = CameraConfig(width=64, height=32)", CameraConfig(width=64, height=32)),
        ("camera = None", None),
    ],
)
def test_it_may_say_which_camera_it_wants(camera: str, expected: CameraConfig | None, tmp_path: Path) -> None:
    body = (
        f"{camera}\ndef act(self, observation):\n    assert observation.image.shape[:2] == SHAPE\n    return Control()"
    )
    shape = (expected.height, expected.width) if expected else (1, 1)
    agent = write_agent(tmp_path, body.replace("SHAPE", str(shape)))
    assert agent_entry(agent).camera(AgentSettings(agent=agent)) == expected
    run_json(*DRIVE, "--agent", agent, "--out", str(tmp_path / "out"))


def test_it_is_given_what_its_init_takes(tmp_path: Path) -> None:
    agent = write_agent(
        tmp_path,
        "def __init__(self, controller, cap, dt):\n"
        "    assert (cap, dt) == (25.0, 0.1) and controller.speed_limit == 25.0\n"
        "    self.controller = controller\n"
        "def act(self, observation):\n"
        "    self.decision = self.controller.step(Affordances(), observation.speed, observation.command)\n"
        "    return self.decision.control",
    )
    report: dict[str, Any] = run_json(
        *DRIVE, "--no-video", "--agent", agent, "--cap", "25", "--out", str(tmp_path / "out")
    )
    trace = json.loads(Path(report["episodes"][0]["file"]).read_text())["trace"]
    assert set(trace["state"]) == {"cruising"}
    assert math.isclose(trace["speed_limit"][-1], 25.0)
