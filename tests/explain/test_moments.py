"""When and at what to look in an episode that failed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from caldrive.agents.settings import AgentSettings
from caldrive.benchmark.failure_causes import failure_cause
from caldrive.benchmark.report.runs import Explanation, Failure
from caldrive.benchmark.suites import TrialResult, suite
from caldrive.explain.moments import plan
from caldrive.results import EpisodeResult, Infraction, InfractionKind, Outcome
from tests.benchmark.traces import after, trace

CAL = AgentSettings(cap=20.0)


def failed(*infractions: Infraction, outcome: Outcome = Outcome.SUCCESS, **more: Any) -> Failure:
    """A failure of a minute."""
    trial = suite("quick")[0]
    result = EpisodeResult(
        scenario=trial.scenario, outcome=outcome, duration=59.9, distance=250.0, route_done=200.0, route_length=250.0,
        infractions=infractions,
    )  # fmt: skip
    return Failure("cal", TrialResult(trial, result, {}), (), **more)


def broke(time: float, *, at_fault: bool = True) -> Infraction:
    return Infraction(InfractionKind.RED_LIGHT, time=time, x=0.0, y=0.0, at_fault=at_fault)


def test_the_moments_are_those_before_the_first_infraction_of_its_own_fault() -> None:
    looked = plan(failed(broke(5.0, at_fault=False), broke(30.0), broke(40.0)), trace(), CAL).glances
    assert [(glance.step, glance.title) for glance in looked] == [
        (280, "2 s before"), (290, "1 s before"), (300, "red light at 30.0 s"),
    ]  # fmt: skip


def test_what_lies_before_the_start_is_no_moment() -> None:
    assert [glance.step for glance in plan(failed(broke(1.2)), trace(), CAL).glances] == [2, 12]


def test_a_missed_goal_is_looked_at_where_it_began_or_at_its_end() -> None:
    seen = trace(state=after(200, "hazard stop", before="cruising"), speed=after(200, 0.0, before=5.0))
    began = failed(outcome=Outcome.TIMEOUT, cause=failure_cause(seen))
    assert plan(began, seen, CAL).glances[-1].title == "stopped without a hazard at 20.0 s"
    last = plan(failed(outcome=Outcome.TIMEOUT), trace(), CAL).glances[-1]
    assert (last.step, last.title) == (599, "ran out of time at 59.9 s")


WRONG = trace(
    true_red_light=after(100, 1.0), true_center_distance=after(285, 0.5), true_speed_sign=after(100, 30, before=None)
)


@pytest.mark.parametrize(
    ("blamed", "cap", "chosen"),
    [
        ((), 20.0, "red_light"),  # wrong in all steps, the distance by less and not in all
        (("hazard stop",), 20.0, "hazard_stop"),  # whom the truth rescues is looked at, however right it was
        (("hazard stop", "center distance"), 20.0, "center_distance"),
        (("several affordances together",), 20.0, "red_light"),
        (("speed sign",), None, "speed_sign"),
    ],
    ids=str,
)
def test_the_affordance_to_blame_is_looked_at_or_else_the_one_most_wrong(
    blamed: tuple[str, ...], cap: float | None, chosen: str
) -> None:
    failure = failed(broke(30.0), explanation=Explanation(blamed=blamed))
    assert plan(failure, WRONG, AgentSettings(cap=cap)).affordance == chosen


def test_signs_count_for_who_is_not_slower_anyway() -> None:
    signs = trace(true_speed_sign=after(100, 30, before=None), true_hazard_stop=after(295, 1.0))
    assert plan(failed(broke(30.0)), signs, CAL).affordance == "hazard_stop"
    free = plan(failed(broke(30.0)), signs, AgentSettings(cap=None))
    assert free.affordance == "speed_sign"
    assert free.glances[-1].text == "speed sign: seen none, true 30"


def test_what_was_seen_and_what_was_true_is_said_in_words() -> None:
    seen = WRONG | {"predicted_red_light": [0.03] * 600}
    assert plan(failed(broke(30.0)), seen, CAL).glances[-1].text == "red light: seen 3 %, true yes"
    blind = replace(CAL, blind=("red_light",))
    assert plan(failed(broke(30.0)), seen, blind).glances[0].text == "red light: not seen, true yes"
    aside = failed(broke(30.0), explanation=Explanation(blamed=("center distance",)))
    assert plan(aside, WRONG, CAL).glances[-1].text == "center distance: seen +0.00 m, true +0.50 m"


def test_an_agent_without_affordances_has_moments_without_words() -> None:
    unseen = {name: [None] * 600 for name in trace() if name.startswith("predicted_")}
    looked = plan(failed(broke(30.0)), trace() | unseen, CAL)
    assert looked.affordance is None
    assert [glance.text for glance in looked.glances] == [""] * 3
