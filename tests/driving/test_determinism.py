"""Two runs of one episode are compared step by step, and the first difference is named."""

from __future__ import annotations

import pytest

from caldrive.driving.determinism import EpisodeDigests, compare, drive_and_digest
from caldrive.driving.settings import DeterminismSettings

STEPS = tuple(("image", "truth", "decision", f"control{i}") for i in range(5))
OTHER_CONTROL = (*STEPS[:3], ("image", "truth", "decision", "another"), STEPS[4])
FIRST = EpisodeDigests(STEPS, result="r")


def test_equal_runs_are_equal() -> None:
    comparison = compare(FIRST, EpisodeDigests(STEPS, result="r"))
    assert (comparison.equal, comparison.steps) == (True, 5)


@pytest.mark.parametrize(
    ("second", "difference"),
    [
        (EpisodeDigests(OTHER_CONTROL, result="r"), "step 3 (0.3 s) differs in its control"),
        (EpisodeDigests(STEPS[:4], result="r"), "one run ends after 4 steps, the other goes on"),
        (EpisodeDigests(STEPS, result="q"), "the results differ, though no step does"),
    ],
)
def test_a_comparison_names_the_first_step_and_part_that_differ(second: EpisodeDigests, difference: str) -> None:
    comparison = compare(FIRST, second)
    assert not comparison.equal
    assert comparison.difference == difference


def test_the_time_of_a_difference_is_in_the_worlds_steps() -> None:
    slow = [EpisodeDigests(steps, result="r", dt=0.5) for steps in (STEPS, OTHER_CONTROL)]
    assert compare(*slow).difference == "step 3 (1.5 s) differs in its control"


@pytest.mark.usefixtures("no_sumo_left")
def test_every_step_of_a_drive_has_digests_of_its_own() -> None:
    driven = drive_and_digest(DeterminismSettings(agent="oracle", town="town02", seconds=1.0))
    images, truths, _, _ = zip(*driven.steps, strict=True)
    assert len(set(images)) == len(set(truths)) == len(driven.steps) == 11
