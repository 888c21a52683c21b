"""The wheel, installed into an empty environment without the sources: it drives, benchmarks, reports, and has types."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import tarfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

from caldrive.benchmark.suites import suite, to_json
from tests.documentation import ROOT, shorten_suites

TYPES = """\
from caldrive import CALAgent, run_episode, task_scenarios
reveal_type(CALAgent)
reveal_type(run_episode)
reveal_type(task_scenarios)
"""
# What mypy needs not look into for the types of caldrive's own names, which saves most of its time.
SKIP = "[mypy-{}.*]\nfollow_imports = skip\n"


def run(*command: str | Path, at: Path) -> str:
    """What a command prints in a folder that knows nothing of the sources."""
    clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    ended = subprocess.run(command, cwd=at, env=clean, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, f"{ended.stdout}\n{ended.stderr}"
    return ended.stdout


@dataclass(frozen=True)
class Installed:
    """An environment with the wheel and what it depends on. desk: an empty folder to work in."""

    environment: Path
    desk: Path

    @property
    def python(self) -> Path:
        return self.environment / "bin" / "python"

    def caldrive(self, *arguments: str) -> str:
        return run(self.environment / "bin" / "caldrive", *arguments, at=self.desk)


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Installed:
    """The wheel, built and installed. Its dependencies are this environment's, which saves gigabytes."""
    folder = tmp_path_factory.mktemp("wheel")
    pip: Sequence[str] = (sys.executable, "-m", "pip", "--disable-pip-version-check")
    run(*pip, "wheel", "--quiet", "--no-build-isolation", "--no-deps", "--wheel-dir", folder, ROOT, at=folder)
    [wheel] = folder.glob("*.whl")
    run(sys.executable, "-m", "venv", "--without-pip", folder / "environment", at=folder)
    desk = folder / "desk"
    desk.mkdir()
    there = Installed(folder / "environment", desk)
    packages = Path(run(there.python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", at=desk).strip())
    # A folder that a .pth file names is searched, but its own .pth files, such as an editable install, are not read.
    (packages / "dependencies.pth").write_text(sysconfig.get_path("purelib"))
    run(*pip, "--python", there.python, "install", "--quiet", "--no-deps", "--no-index", wheel, at=folder)
    return there


def test_the_wheel_is_used_and_not_the_sources(installed: Installed) -> None:
    home = run(installed.python, "-c", "import caldrive; print(caldrive.__file__)", at=installed.desk)
    assert Path(home.strip()).is_relative_to(installed.environment)


def test_the_wheel_drives_from_the_camera_and_films(installed: Installed) -> None:
    answer = installed.caldrive("drive", "--task", "navigation-dynamic", "--seconds", "1", "--out", "drive")
    assert "1 of 1" in answer or "0 of 1" in answer
    assert {path.name for path in (installed.desk / "drive").iterdir()} == {
        "drive.mp4", "episode-000.json", "episode-000.png",
    }  # fmt: skip


def test_the_wheel_benchmarks_and_reports(installed: Installed) -> None:
    (installed.desk / "suite.json").write_text(to_json(suite("quick")[:1]))
    shorten_suites(installed.desk)
    installed.caldrive("benchmark", "--agent", "oracle", "--suite", "suite.json", "--workers", "1", "--out", "run")
    assert len((installed.desk / "run" / "results.jsonl").read_text().splitlines()) == 1
    installed.caldrive("report", "run", "--out", "report")
    assert (installed.desk / "report" / "report.html").stat().st_size > 10_000


def test_a_type_checker_knows_the_public_names(installed: Installed) -> None:
    (installed.desk / "names.py").write_text(TYPES)
    skipped = ("torch", "openvino", "matplotlib", "scipy", "PIL", "av", "numba")
    (installed.desk / "mypy.ini").write_text("[mypy]\n" + "".join(map(SKIP.format, skipped)))
    mypy = (sys.executable, "-m", "mypy", "--python-executable", installed.python, "--cache-dir", "cache", "names.py")
    told = run(*mypy, at=installed.desk).splitlines()
    revealed = [line.partition("Revealed type is ")[2] for line in told if "Revealed type" in line]
    assert [text.partition("-> ")[2].strip('"') for text in revealed] == [
        "caldrive.agents.cal.CALAgent", "caldrive.results.EpisodeResult", "list[caldrive.scenarios.Scenario]",
    ]  # fmt: skip
    assert all("Any" not in text for text in revealed)


def test_the_source_archive_leaves_the_results_out(tmp_path: Path) -> None:
    run(sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", tmp_path, at=ROOT)
    [archive] = tmp_path.glob("*.tar.gz")
    with tarfile.open(archive) as content:
        names = [name.partition("/")[2] for name in content.getnames()]
    assert {"README.md", "docs/own/agent.md", "tests/test_wheel.py", "src/caldrive/py.typed"} <= set(names)
    assert [name for name in names if name.startswith("docs/results/")] == []
    assert archive.stat().st_size < 10e6
