"""What is said while work goes on."""

from __future__ import annotations

import pytest

from caldrive.progress import LINES_EVERY, progress_lines


def test_without_a_terminal_there_is_a_line_now_and_then(capsys: pytest.CaptureFixture[str]) -> None:
    times = iter((0.0, 1.0, LINES_EVERY, LINES_EVERY, LINES_EVERY + 1, 2 * LINES_EVERY, 2 * LINES_EVERY))
    say = progress_lines(clock=lambda: next(times))
    for step in range(1, 5):
        say(f"step {step}", step / 4)
    assert capsys.readouterr().err.splitlines() == ["step 2 (50%)", "step 4 (100%)"]
