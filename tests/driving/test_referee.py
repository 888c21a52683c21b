from __future__ import annotations

import math
from dataclasses import replace

import pytest

from caldrive.datatypes import Affordances, Contact, ContactKind, LightState, Pose, TrafficLight, Truth, VehicleState
from caldrive.driving.referee import Referee
from caldrive.driving.rules import CORL2017, NOCRASH, REST_FRAMES, STRICT, Rules
from caldrive.results import InfractionKind, Outcome
from caldrive.scenarios import Scenario

SCENARIO = Scenario("town", 1, Pose(0, 0, 0), Pose(1000, 0, 0), time_limit=1000.0)
SHARES = [
    (InfractionKind.OPPOSITE_LANE, "opposite_share", 0.4),
    (InfractionKind.SIDEWALK, "sidewalk_share", 0.3),
]
COLLISIONS = [
    (InfractionKind.COLLISION_OBJECT, ContactKind.OBJECT, 400.0, 20),
    (InfractionKind.COLLISION_CAR, ContactKind.CAR, 400.0, 30),
    (InfractionKind.COLLISION_PERSON, ContactKind.PERSON, 300.0, 100),
]


def frame(i: int, x: float | None = None, heading: float = 0.0, **rest: object) -> Truth:
    """Frame i at 10 Hz of a car 4 m long at 10 m/s, its centre at x."""
    pose = Pose(float(i) if x is None else x, 0.0, heading)
    return Truth(0.1 * i, VehicleState(pose, 10.0, 4.0, 1.8), Affordances(), **rest)  # type: ignore[arg-type]


def kinds(referee: Referee) -> list[InfractionKind]:
    return [infraction.kind for infraction in referee.infractions]


def watched(frames: list[Truth], rules: Rules = CORL2017, signs: bool = False) -> Referee:
    referee = Referee(SCENARIO, rules=rules, signs=signs)
    for truth in frames:
        assert referee.watch(truth) is None
    return referee


@pytest.mark.parametrize(("kind", "name", "threshold"), SHARES)
def test_a_fast_rise_of_the_share_counts_once_with_time_and_place(
    kind: InfractionKind, name: str, threshold: float
) -> None:
    shares = [0.0] * 5 + [threshold + 0.05] * 60
    referee = watched([frame(i, **{name: share}) for i, share in enumerate(shares)])
    assert kinds(referee) == [kind]
    assert referee.infractions[0].time == pytest.approx(0.5)
    assert referee.infractions[0].x == 5.0


@pytest.mark.parametrize(("kind", "name", "threshold"), SHARES)
def test_a_small_or_slow_rise_does_not_count(kind: InfractionKind, name: str, threshold: float) -> None:
    small = [0.0] * 5 + [threshold] * 20
    slow = [min(1.0, i * threshold / 12) for i in range(40)]
    for shares in (small, slow):
        assert kinds(watched([frame(i, **{name: share}) for i, share in enumerate(shares)])) == []


@pytest.mark.parametrize(("kind", "name", "threshold"), SHARES)
def test_a_share_counts_again_after_its_rest(kind: InfractionKind, name: str, threshold: float) -> None:
    def count(pause: int) -> int:
        shares = [0.0, 0.9] + [0.0] * pause + [0.9] + [0.0] * 5
        return len(kinds(watched([frame(i, **{name: share}) for i, share in enumerate(shares)])))

    assert count(pause=5) == 1
    assert count(pause=25) == 2


@pytest.mark.parametrize(("kind", "contact", "threshold", "rest"), COLLISIONS)
def test_a_collision_is_counted_once_and_is_ones_own_where_any_part_of_it_is(
    kind: InfractionKind, contact: ContactKind, threshold: float, rest: int
) -> None:
    theirs, own = ((Contact(contact, "it", threshold + 1, at_fault=fault),) for fault in (False, True))
    seen = watched([frame(0, contacts=theirs), frame(1, contacts=own), frame(2, contacts=theirs)])
    assert [(infraction.time, infraction.at_fault) for infraction in seen.infractions] == [(0.0, True)]
    seen = watched([frame(0, contacts=theirs), frame(1, contacts=theirs)])
    assert [infraction.at_fault for infraction in seen.infractions] == [False]


@pytest.mark.parametrize(("kind", "contact", "threshold", "rest"), COLLISIONS)
def test_a_collision_within_the_rest_counts_when_it_is_over(
    kind: InfractionKind, contact: ContactKind, threshold: float, rest: int
) -> None:
    hard = (Contact(contact, "it", threshold + 1, at_fault=True),)
    for pause, counted in ((rest - 2, 2), (rest // 2, 1)):
        seen = watched([frame(i, contacts=hard if i in (5, 5 + pause) else ()) for i in range(rest + 20)])
        assert kinds(seen) == [kind] * counted


@pytest.mark.parametrize(("kind", "contact", "threshold", "rest"), COLLISIONS)
def test_soft_touches_add_up_to_a_collision_within_their_frames_only(
    kind: InfractionKind, contact: ContactKind, threshold: float, rest: int
) -> None:
    frames = 5 if contact is ContactKind.PERSON else 10
    part = (Contact(contact, "it", threshold / frames, at_fault=True),)
    more = (Contact(contact, "it", threshold / frames + 1, at_fault=True),)
    assert kinds(watched([frame(i, contacts=part) for i in range(3 * frames)])) == []
    assert kinds(watched([frame(i, contacts=more) for i in range(frames - 1)])) == []
    assert kinds(watched([frame(i, contacts=more) for i in range(frames)])) == [kind]
    apart = [frame(i, contacts=more if i % 2 else ()) for i in range(3 * frames)]
    assert kinds(watched(apart)) == []


@pytest.mark.parametrize(("kind", "contact", "threshold", "rest"), COLLISIONS)
def test_a_collision_that_ends_nocrash_is_half_as_hard_and_of_one_frame(
    kind: InfractionKind, contact: ContactKind, threshold: float, rest: int
) -> None:
    def counted(impulse: float) -> list[InfractionKind]:
        touch = (Contact(contact, "it", impulse, at_fault=True),)
        return kinds(watched([frame(i, contacts=touch) for i in range(20)], NOCRASH))

    assert counted(threshold / 2) == []
    assert counted(threshold / 2 + 1) == [kind]


@pytest.mark.parametrize(("kind", "contact", "threshold", "rest"), COLLISIONS)
def test_strict_rules_count_each_thing_that_is_touched_once_a_contact(
    kind: InfractionKind, contact: ContactKind, threshold: float, rest: int
) -> None:
    soft, other = (Contact(contact, name, 0.0, at_fault=True) for name in ("a", "b"))
    lasting = [frame(i, contacts=(soft, other)) for i in range(30)]
    again = [frame(i, contacts=(soft,)) for i in range(45, 50)]
    pause = [frame(i) for i in range(30, 45)]
    strict = watched([*lasting, *pause, *again], STRICT)
    assert kinds(strict) == [kind] * 3
    assert strict.touches == strict.infractions
    published = watched([*lasting, *pause, *again])
    assert kinds(published) == []
    assert len(published.touches) == 3


def test_a_contact_that_flickers_is_one() -> None:
    touch = (Contact(ContactKind.CAR, "it", 0.0, at_fault=True),)
    assert len(watched([frame(i, contacts=touch if i % 3 else ()) for i in range(30)]).touches) == 1


@pytest.mark.parametrize(("kind", "contact", "threshold", "rest"), COLLISIONS)
def test_collisions_count_above_their_impulse_and_again_after_their_rest(
    kind: InfractionKind, contact: ContactKind, threshold: float, rest: int
) -> None:
    hit = (Contact(contact, "it", threshold + 1, at_fault=True),)
    touch = (Contact(contact, "it", threshold, at_fault=True),)
    assert kinds(watched([frame(0), frame(1, contacts=touch)])) == []
    lasting = [frame(i, contacts=hit) for i in range(rest + 1)]
    assert kinds(watched(lasting)) == [kind]
    assert kinds(watched([*lasting, frame(rest + 1, contacts=hit)])) == [kind, kind]
    assert REST_FRAMES[kind] == rest


@pytest.mark.parametrize("at_fault", [True, False])
def test_a_collision_carries_whose_fault_it_was(at_fault: bool) -> None:
    referee = watched([frame(0, contacts=(Contact(ContactKind.CAR, "it", 1000.0, at_fault),))])
    assert referee.infractions[0].at_fault is at_fault


def test_kinds_are_counted_apart() -> None:
    contacts = (Contact(ContactKind.CAR, "a", 1000.0, True), Contact(ContactKind.PERSON, "b", 1000.0, True))
    referee = watched([frame(0), frame(1, contacts=contacts, sidewalk_share=0.9)])
    assert set(kinds(referee)) == {
        InfractionKind.COLLISION_CAR,
        InfractionKind.COLLISION_PERSON,
        InfractionKind.SIDEWALK,
    }


def light(state: LightState, heading: float = 0.0, flip: bool = False) -> tuple[TrafficLight, ...]:
    """A light whose stop line lies across the road at x = 20."""
    ends = ((20.0, -2.0), (20.0, 2.0))
    return (TrafficLight("light", Pose(26, -3, heading), state, ends[::-1] if flip else ends),)


def test_a_red_light_counts_when_the_front_crosses_its_line() -> None:
    for flip in (False, True):
        referee = watched([frame(i, lights=light(LightState.RED, flip=flip)) for i in range(40)])
        assert kinds(referee) == [InfractionKind.RED_LIGHT]
        assert referee.infractions[0].x == 19.0  # the front, 2 m ahead, stood on the line at 18


def test_standing_at_the_line_is_lawful() -> None:
    frames = [frame(i, x=min(float(i), 18.0), lights=light(LightState.RED)) for i in range(40)]
    assert kinds(watched(frames)) == []


def test_only_red_counts_and_only_at_the_crossing() -> None:
    for state in (LightState.GREEN, LightState.YELLOW):
        assert kinds(watched([frame(i, lights=light(state)) for i in range(40)])) == []
    late = [frame(i, lights=light(LightState.RED if i > 25 else LightState.GREEN)) for i in range(40)]
    assert kinds(watched(late)) == []


def test_nocrash_reports_a_yellow_light_that_is_crossed_and_nobody_is_to_blame() -> None:
    (crossing,) = watched([frame(i, lights=light(LightState.YELLOW)) for i in range(40)], NOCRASH).infractions
    assert (crossing.kind, crossing.at_fault) == (InfractionKind.YELLOW_LIGHT, False)


def test_a_light_for_another_direction_does_not_count() -> None:
    for heading, counted in ((1.0, 1), (1.1, 0), (math.pi, 0), (-1.1, 0)):
        frames = [frame(i, lights=light(LightState.RED, heading)) for i in range(40)]
        assert len(kinds(watched(frames))) == counted


def test_passing_beside_the_line_does_not_count() -> None:
    frames = [frame(i, lights=light(LightState.RED)) for i in range(40)]
    beside = [replace(truth, ego=replace(truth.ego, pose=Pose(truth.ego.pose.x, 3.0, 0.0))) for truth in frames]
    assert kinds(watched(beside)) == []


def test_goal_within_two_metres_is_success() -> None:
    referee = Referee(SCENARIO)
    assert referee.watch(frame(0, goal_distance=2.01)) is None
    assert referee.watch(frame(1, goal_distance=2.0)) is Outcome.SUCCESS
    assert referee.result().outcome is Outcome.SUCCESS


def test_a_goal_behind_the_start_is_reached_by_driving_the_route_only() -> None:
    referee = Referee(SCENARIO)
    assert referee.watch(frame(0, goal_distance=1.0, route_done=0.0, route_length=700.0)) is None
    assert referee.watch(frame(1, goal_distance=1.0, route_done=629.0, route_length=700.0)) is None
    assert referee.watch(frame(2, goal_distance=1.0, route_done=631.0, route_length=700.0)) is Outcome.SUCCESS


def test_time_is_up_at_the_limit_and_the_goal_goes_first() -> None:
    scenario = replace(SCENARIO, time_limit=0.5)
    assert Referee(scenario).watch(frame(4)) is None
    assert Referee(scenario).watch(frame(5)) is Outcome.TIMEOUT
    assert Referee(scenario).watch(frame(5, goal_distance=1.0)) is Outcome.SUCCESS


def test_a_fatal_infraction_ends_the_episode_even_at_the_goal() -> None:
    frames = [frame(i, lights=light(LightState.RED), goal_distance=50.0 - i) for i in range(60)]
    strict, lax = Referee(SCENARIO, fatal=(InfractionKind.RED_LIGHT,)), Referee(SCENARIO)
    assert next(outcome for frame in frames if (outcome := strict.watch(frame))) is Outcome.FAILED
    assert next(outcome for frame in frames if (outcome := lax.watch(frame))) is Outcome.SUCCESS
    assert [infraction.kind for infraction in lax.infractions] == [InfractionKind.RED_LIGHT]


def test_result_sums_up_the_drive() -> None:
    result = watched([frame(i, route_done=float(i), route_length=100.0) for i in range(31)]).result()
    assert result.outcome is Outcome.ABORTED
    assert (result.distance, result.duration) == (pytest.approx(30.0), pytest.approx(3.0))
    assert (result.route_done, result.route_length) == (30.0, 100.0)
    assert Referee(SCENARIO).result().distance == 0.0
