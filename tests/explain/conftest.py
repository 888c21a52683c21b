"""What the tests of explanations share: a run that failed."""

from __future__ import annotations

from pathlib import Path

import pytest

from caldrive.benchmark.runner import benchmark
from caldrive.benchmark.settings import BenchmarkSettings
from caldrive.benchmark.suites import Trial, suite, to_json


@pytest.fixture(scope="session")
def blind_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run of an oracle that sees no red light, in a short episode that has one."""
    folder = tmp_path_factory.mktemp("blame")
    straight = [trial.scenario for trial in suite("quick") if trial.scenario.task == "straight"]
    shortest = min(straight, key=lambda scenario: scenario.time_limit)
    (folder / "suite.json").write_text(to_json([Trial("light", "training", shortest)]))
    settings = BenchmarkSettings(
        suite=str(folder / "suite.json"), out=folder / "run", agent="oracle", blind=("red_light",), workers=1
    )
    list(benchmark(settings))
    return folder / "run"
