"""A short part of the fuzzer, in this process: what is known to be bad is refused in one sentence."""

from __future__ import annotations

import os
import random
import shutil
from pathlib import Path

import pytest

from caldrive.cli import main
from scripts.attack import by_hand
from scripts.attack.attempt import Attempt, lay_out
from scripts.attack.good import written_by_hand
from scripts.attack.outputs import snapshot
from scripts.attack.runner import Ended
from scripts.attack.verdicts import Outcome, verdict

HERE = ("drive", "benchmark", "collect", "town", "caldrive", "speed world")  # verbs that need only what is made by hand
ELSEWHERE = ("--out run", "--model", "/dev/zero", "recording --", "run/", "fly")  # what the whole campaign tries
SEED, N = 0, 50
GOOD = written_by_hand()


def attempts() -> list[Attempt]:
    """Some command lines, settings and suites that are refused before anything heavy begins."""
    light = [
        attempt
        for attempt in by_hand.attempts(GOOD)
        if attempt.kind != by_hand.CODE
        and " ".join(attempt.arguments).startswith(HERE)
        and not any(words in " ".join(attempt.arguments) for words in ELSEWHERE)
    ]
    return random.Random(SEED).sample(light, N)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("attack")


@pytest.mark.parametrize("attempt", attempts(), ids=lambda attempt: f"{attempt.arguments[0]}: {attempt.bad[:60]}")
def test_what_is_known_to_be_bad_is_refused_in_one_sentence(
    attempt: Attempt, place: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    work = lay_out(attempt, place)
    monkeypatch.chdir(work)
    try:
        before = snapshot(work)
        code = main(list(attempt.arguments))
        said = capfd.readouterr()
        ended = Ended(code=code, stopped="", seconds=0.0, cpu=0.0, stdout=said.out, stderr=said.err)
        found = verdict(attempt, ended, work, before)
    finally:
        os.chdir(place)
        shutil.rmtree(place / work.relative_to(place).parts[0])
    assert found.outcome is Outcome.REFUSED, (found, said.err)
