"""CARLA as a world, with the embedded world's own server in its place: the same drive through the protocol."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from caldrive.affordances import SPECS
from caldrive.benchmark.run_folder import RunFolder
from caldrive.benchmark.suites import suite, to_json
from caldrive.recordings.reader import read_episode
from caldrive.recordings.writer import episode_path
from caldrive.results import Outcome
from caldrive.world.embedded import EmbeddedWorld
from tests.carla_bridge.client.programs.drives import AHEAD, OTHERS, driven, looked
from tests.carla_bridge.server.wire_client import free_port

PORT, NOBODY = free_port(), free_port()
ROOT = Path(__file__).parents[3]
PATIENCE = 900.0  # s
REACHED = Outcome.SUCCESS.value
PROGRAMS = "tests.carla_bridge.client.programs"
pytestmark = pytest.mark.skipif(find_spec("carla") is None, reason="needs the wheel of CARLA's client")


def environment() -> dict[str, str]:
    path = os.pathsep.join((str(ROOT / "src"), str(ROOT), os.environ.get("PYTHONPATH", "")))
    return {"HOME": str(ROOT), **os.environ, "PYTHONPATH": path}


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """One that keeps what clients leave, as CARLA does."""
    said = tmp_path_factory.mktemp("server") / "said.txt"
    command = [sys.executable, "-m", "caldrive", "serve-carla", "--port", str(PORT), "--keep"]
    with said.open("wb") as file, subprocess.Popen(command, env=environment(), stderr=file, stdout=file) as process:
        deadline = time.monotonic() + PATIENCE
        while "may connect" not in said.read_text():
            assert process.poll() is None, said.read_text()
            assert time.monotonic() < deadline
            time.sleep(0.1)
        yield
        process.terminate()
    assert "found a fault" not in said.read_text()


def run(*command: str, code: int = 0) -> Any:
    """What a command of Python prints as JSON, in a process of its own: CARLA's client may end its process."""
    done = subprocess.run(
        [sys.executable, "-m", *command], env=environment(), cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE
    )
    assert done.returncode == code, done.stderr
    return json.loads(done.stdout) if done.stdout else None


@pytest.fixture(scope="module")
def through(server: None) -> dict[str, Any]:
    """What `drives` found through the protocol."""
    found: dict[str, Any] = run(f"{PROGRAMS}.drives", str(PORT))
    return found


@pytest.fixture(scope="module")
def embedded() -> Iterator[EmbeddedWorld]:
    with closing(EmbeddedWorld(AHEAD)) as world:
        yield world


def test_the_oracle_drives_as_in_the_embedded_world(through: dict[str, Any], embedded: EmbeddedWorld) -> None:
    outcome, rows = driven(embedded, "town01")
    assert (through["outcome"], outcome) == (REACHED, REACHED)
    assert len(through["rows"]) == len(rows)
    assert Path(through["town"]).name == "town01.xodr"  # the roads come from the server, and are read
    there, here = (np.array(figures, dtype=float) for figures in (through["rows"], rows))
    assert np.abs(there[:, :5] - here[:, :5]).max() < 0.01  # s, m, m, rad, m/s
    for k, spec in enumerate(SPECS, start=5):
        np.testing.assert_allclose(there[:, k], here[:, k], atol=0.01, err_msg=spec.name)
    assert np.abs(there[:, 11:] - here[:, 11:]).max() < 0.05  # m, m, km/h


def test_cameras_anywhere_on_the_car_see_the_same(through: dict[str, Any], embedded: EmbeddedWorld) -> None:
    there, here = through["looked"], looked(embedded, "town01")
    for name in ("first", "images"):
        assert np.abs(np.array(there[name]) - np.array(here[name])).mean() < 0.5  # of 255
    assert (np.array(there["classes"]) == np.array(here["classes"])).mean() > 0.99
    np.testing.assert_allclose(np.array(there["labels"], float), np.array(here["labels"], float), atol=0.01)
    assert there["others"] == here["others"]


def test_as_many_others_as_a_scenario_wants_drive_and_walk(through: dict[str, Any]) -> None:
    assert through["counts"] == [[OTHERS, OTHERS]] * 2
    assert max(through["cars"]) > 1.0  # m/s
    assert max(through["people"]) > 0.5


def test_nothing_is_left_behind(through: dict[str, Any]) -> None:
    assert (through["left"], through["sync"]) == (0, False)


def test_what_a_killed_process_left_is_removed_and_a_dead_server_is_a_sentence(server: None) -> None:
    run(f"{PROGRAMS}.is_killed", str(PORT), code=9)
    found = run(f"{PROGRAMS}.comes_after", str(PORT), str(NOBODY))
    assert found["left"] == 4  # the ego, its camera, and what it touches and when
    assert (found["after"], found["delta"], found["sync"]) == (0, 0.1, False)
    assert found["error"].startswith(f"found no answer from CARLA at 127.0.0.1:{NOBODY}, wanted a server there")


def test_a_server_that_a_killed_process_left_waiting_goes_by_itself_again(server: None) -> None:
    run(f"{PROGRAMS}.is_killed", str(PORT), "early", code=9)
    found = run(f"{PROGRAMS}.comes_after", str(PORT), str(NOBODY))
    assert (found["left"], found["delta"], found["sync"]) == (0, 0.1, False)


def test_the_checklist_has_nothing_to_say_against_our_server(server: None) -> None:
    checks = run("caldrive", "check-carla", "--port", str(PORT), "--json")["checks"]
    assert len(checks) > 10
    assert [check for check in checks if not check["ok"]] == []


def test_a_benchmark_and_a_recording_are_made_in_carla(server: None, tmp_path: Path) -> None:
    where = ("--world", "carla", "--port", str(PORT), "--json", "--out")
    rows = json.loads(to_json(suite("quick")[:1]))
    rows[0]["scenario"]["time_limit"] = 1.0
    (tmp_path / "short.json").write_text(json.dumps(rows))
    suite_file, out, recording = (str(tmp_path / name) for name in ("short.json", "run", "recording"))
    run("caldrive", "benchmark", "--suite", suite_file, "--agent", "oracle", *where, out)
    assert (RunFolder(Path(out)).driver.world, RunFolder(Path(out)).driver.port) == ("carla", PORT)
    assert len(RunFolder(Path(out)).results()) == 1
    short = ["--episodes", "1", "--duration", "0.5", "--cars", "0", "--people", "0", "--tailgating", "0", "--semantic"]
    run("caldrive", "collect", *short, *where, recording)
    episode = read_episode(episode_path(Path(recording), 0), semantic=True)
    assert len(episode) == 15  # five steps, three cameras
