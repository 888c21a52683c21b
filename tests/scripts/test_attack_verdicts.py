"""The fuzzer tells outcomes apart, and no child escapes its limits."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from scripts.attack import campaign
from scripts.attack.attempt import Attempt, keep
from scripts.attack.runner import Ended
from scripts.attack.verdicts import Outcome, verdict
from tests.documentation import ROOT

RAN = Ended(code=0, stopped="", seconds=1.0, cpu=1.0, stdout="fine", stderr="")
SENTENCE = "caldrive: found 3, wanted 4: type --cars 4\n"


@pytest.mark.parametrize(
    ("ended", "outcome"),
    [
        (RAN, Outcome.RAN),
        (Ended(1, "", 1, 1, "not equal", ""), Outcome.RAN),
        (Ended(2, "", 1, 1, "", SENTENCE), Outcome.REFUSED),
        (Ended(2, "", 1, 1, "", "pictures (20%)\n" + SENTENCE), Outcome.REFUSED),
        (Ended(2, "", 1, 1, "", 2 * SENTENCE), Outcome.UGLY),
        (Ended(2, "", 1, 1, "", SENTENCE.replace("3", "\x1b[31m")), Outcome.UGLY),
        (Ended(2, "", 1, 1, "half an answer", SENTENCE), Outcome.UGLY),
        (Ended(2, "", 1, 1, "", ""), Outcome.UGLY),
        (Ended(3, "", 1, 1, "", SENTENCE), Outcome.UGLY),
        (Ended(2, "", 1, 1, "", "caldrive: found a fault of the program (KeyError: 3)"), Outcome.TRACEBACK),
        (Ended(1, "", 1, 1, "", "Traceback (most recent call last)"), Outcome.TRACEBACK),
        (Ended(-11, "", 1, 1, "", ""), Outcome.TRACEBACK),
        (Ended(-9, "time", 1, 1, "", ""), Outcome.HANG),
        (Ended(-9, "time", 1, 1, "", "recording, 1 of 1800 episodes (0%)\n"), Outcome.RAN),
        (Ended(0, "", 1, 1, "", "", orphans=1), Outcome.HANG),
        (Ended(-9, "memory", 1, 1, "", ""), Outcome.MEMORY),
        (Ended(2, "", 1, 1, "", "caldrive: found too little memory for this, wanted more"), Outcome.MEMORY),
        (Ended(0, "", 1, 1, "speed: nan km/h", ""), Outcome.NONSENSE),
    ],
)
def test_outcomes_are_told_apart(ended: Ended, outcome: Outcome, tmp_path: Path) -> None:
    assert verdict(Attempt("suite", ()), ended, tmp_path / "work", {}).outcome is outcome


def test_what_is_known_to_be_bad_must_not_run(tmp_path: Path) -> None:
    assert verdict(Attempt("suite", (), bad="cap is nan"), RAN, tmp_path / "work", {}).outcome is Outcome.NONSENSE


@pytest.mark.parametrize(("said", "outcome"), [('{"a": 1}', Outcome.RAN), ('{"a": NaN}', Outcome.NONSENSE)])
def test_an_answer_in_json_is_read(said: str, outcome: Outcome, tmp_path: Path) -> None:
    assert (
        verdict(Attempt("suite", ("--json",)), Ended(0, "", 1, 1, said, ""), tmp_path / "work", {}).outcome is outcome
    )


CHILDREN = """
import os, sys, time
from pathlib import Path
import caldrive.cli
from scripts.attack.runner import Limits, run

def main(words):
    match words[0]:
        case "says": print("here", os.getcwd()); print("there", file=sys.stderr); return 2
        case "fails": raise KeyError(3)
        case "sleeps": time.sleep(60)
        case "works": [None for _ in iter(int, 1)]
        case "takes": bytearray(b"x") * 300_000_000; time.sleep(60)
        case "leaves": os.fork() or time.sleep(60); return 0

caldrive.cli.main = main
work = Path(sys.argv[1]) / "work"
for name in ("says", "fails", "sleeps", "works", "takes", "leaves"):
    folder = Path(sys.argv[1]) / name / "work"
    folder.mkdir(parents=True)
    ended = run([name], folder, Limits(seconds=0.5 if name == "sleeps" else 30, cpu_seconds=0.5, gigabytes=0.25))
    print(name, ended.code, ended.stopped or "-", ended.orphans, ended.stdout.strip() == f"here {folder}", flush=True)
"""


def test_a_child_keeps_within_its_limits_or_is_ended(tmp_path: Path) -> None:
    command = [sys.executable, "-c", CHILDREN, str(tmp_path)]
    found = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    assert found.stdout.splitlines() == [
        "says 2 - 0 True",
        "fails 98 - 0 False",
        "sleeps -9 time 0 False",
        "works -9 time 0 False",
        "takes -9 memory 0 False",
        "leaves 0 - 1 False",
    ]


def test_the_table_counts_kinds_and_outcomes(tmp_path: Path) -> None:
    rows = [campaign.Row(k, "suite", outcome, "", 1.0, 0.5, "") for k, outcome in enumerate(("RAN", "RAN", "HANG"))]
    text = campaign.summary(rows, minutes=1.0)
    assert [line.split() for line in text.splitlines()[1:3]] == [["suite", "2", "1"], ["all", "2", "1"]]
    assert text.splitlines()[3] == "3 inputs, 0.50 s of a processor each, 180 an hour"
    assert [row.number for row in campaign.faults(rows)] == [2]


def test_an_attempt_that_was_kept_is_tried_again(tmp_path: Path) -> None:
    keep(Attempt("command line", ("town", "--width", "-5")), tmp_path, {})
    command = [sys.executable, "-m", "scripts.attack", "--replay", str(tmp_path)]
    found = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    assert found.returncode == 0, found
    assert "found --width -5" in found.stdout
    assert "refused in one sentence , exit code 2" in found.stdout
