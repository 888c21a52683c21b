"""Traffic lights: one approach at a time, yellow before red, and nobody who waits is forgotten."""

from __future__ import annotations

from dataclasses import replace
from itertools import groupby, pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from caldrive.datatypes import LightState, VehicleState
from caldrive.geometry import boxes_of, moved
from caldrive.world.roads.network import LightPost, RoadNetwork
from caldrive.world.traffic.traffic_lights import (
    LONGEST_CLEARING,
    LONGEST_GREEN,
    SHORTEST_CLEARING,
    SHORTEST_GREEN,
    YELLOW,
    Phase,
    TrafficLights,
    next_phase,
)

DT, N = 0.1, 3
GREEN, AMBER, RED = LightState.GREEN, LightState.YELLOW, LightState.RED
# Who waits and whether the junction is occupied, for some seconds each.
demand = st.tuples(st.lists(st.booleans(), min_size=N, max_size=N), st.booleans(), st.floats(0.2, 30))
demands = st.lists(demand, min_size=1, max_size=8)


def run(demands: list[tuple[list[bool], bool, float]], first: int = 0) -> list[tuple[float, Phase, list[bool]]]:
    """The phases of a junction, step by step: time, phase, who waits."""
    phase, time, phases = Phase(first, GREEN, 0.0), 0.0, []
    for waiting, occupied, seconds in demands:
        for _ in range(round(seconds / DT)):
            time = round(time + DT, 6)
            phase = next_phase(phase, time, waiting, occupied)
            phases.append((time, phase, waiting))
    return phases


def spells(phases: list[tuple[float, Phase, list[bool]]]) -> list[tuple[Phase, float]]:
    """Each phase with the time it lasted in s, the last and unfinished one left out."""
    begins = [next(group) for _, group in groupby(phases, key=lambda row: row[1])]
    return [(phase, after[1].since - phase.since) for (_, phase, _), after in pairwise(begins)]


@given(demands)
def test_green_turns_yellow_then_red_and_only_then_is_another_green(
    wanted: list[tuple[list[bool], bool, float]],
) -> None:
    order = [phase.state for phase, _ in spells(run(wanted))]
    follow = {GREEN: AMBER, AMBER: RED, RED: GREEN}
    assert all(follow[a] is b for a, b in pairwise(order))
    for (a, _), (b, _) in pairwise(spells(run(wanted))):
        assert a.approach == b.approach or a.state is RED


@given(demands)
def test_every_phase_keeps_its_times(wanted: list[tuple[list[bool], bool, float]]) -> None:
    shortest = {GREEN: SHORTEST_GREEN, AMBER: YELLOW, RED: SHORTEST_CLEARING}
    for phase, lasted in spells(run(wanted)):
        assert lasted > shortest[phase.state] - 1e-6
        assert phase.state is not AMBER or lasted < YELLOW + DT + 1e-6
        assert phase.state is not RED or lasted < LONGEST_CLEARING + DT + 1e-6


@given(demands)
def test_whoever_goes_on_waiting_gets_green(wanted: list[tuple[list[bool], bool, float]]) -> None:
    bound = N * (LONGEST_GREEN + YELLOW + LONGEST_CLEARING + 3 * DT)
    since = dict.fromkeys(range(N), 0.0)
    for time, phase, waiting in run(wanted):
        for k in range(N):
            if not waiting[k] or (phase.state is GREEN and phase.approach == k):
                since[k] = time
            assert time - since[k] < bound


@given(st.integers(0, N - 1), st.booleans())
def test_while_nobody_waits_elsewhere_green_stays(first: int, own: bool) -> None:
    waiting = [own and k == first for k in range(N)]
    assert {phase for _, phase, _ in run([(waiting, True, 60)], first)} == {Phase(first, GREEN, 0.0)}


def test_somebody_alone_gets_green_after_one_short_change() -> None:
    phases = run([([False] * N, False, 10.0), ([False, True, False], False, 30.0)])
    green = next(time for time, phase, _ in phases if phase == Phase(1, GREEN, phase.since))
    assert green - 10.0 < YELLOW + SHORTEST_CLEARING + 4 * DT


def test_under_constant_demand_the_approaches_take_turns() -> None:
    greens = [phase.approach for phase, _ in spells(run([([True] * N, False, 90.0)])) if phase.state is GREEN]
    assert greens[:6] == [0, 1, 2, 0, 1, 2]


def test_green_is_cut_short_when_its_own_approach_is_empty() -> None:
    own, empty = (
        next(s for phase, s in spells(run([(waiting, False, 30)])) if phase.state is GREEN)
        for waiting in ([True, True, False], [False, True, False])
    )
    assert own == pytest.approx(LONGEST_GREEN, abs=2 * DT)
    assert empty == pytest.approx(SHORTEST_GREEN, abs=2 * DT)


def test_an_occupied_junction_is_cleared_for_longer() -> None:
    waiting = [True, True, False]
    times = [
        next(s for phase, s in spells(run([(waiting, occupied, 40)])) if phase.state is RED)
        for occupied in (False, True)
    ]
    assert times == pytest.approx([SHORTEST_CLEARING, LONGEST_CLEARING], abs=2 * DT)


def waiting_car(post: LightPost, roads: RoadNetwork, before: float = 4.0, turn: float = 0.0) -> VehicleState:
    """A car whose centre stands that far before a stop line."""
    lane = roads.lanes[post.lane].line
    return VehicleState(moved(lane.pose_at(lane.length - before), turn=turn))


def state_of(lights: TrafficLights, post: LightPost) -> LightState:
    return next(light.state for light in lights.states() if light.id == post.id)


def drive(lights: TrafficLights, cars: list[VehicleState], seconds: float) -> list[tuple[LightState, ...]]:
    history = []
    for i in range(round(seconds / DT)):
        lights.step((i + 1) * DT, boxes_of(cars))
        history.append(tuple(light.state for light in lights.states()))
    return history


@pytest.mark.parametrize("index", range(6))
def test_a_car_at_a_stop_line_turns_its_light_green(index: int, town02: RoadNetwork) -> None:
    lights, post = TrafficLights(town02, np.random.default_rng(1)), town02.posts[index]
    drive(lights, [waiting_car(post, town02)], 15)
    assert state_of(lights, post) is GREEN


def test_who_waits_nearer_to_the_middle_than_others_does_not_keep_the_junction_red(town02: RoadNetwork) -> None:
    light = town02.posts[0].light
    near, *others = (post for post in town02.posts if post.light == light)
    away = [moved(post.pose, forward=-30.0) for post in others]
    lines = [((pose.x - 1.0, pose.y), (pose.x + 1.0, pose.y)) for pose in away]
    far = [replace(post, pose=pose, stop_line=line) for post, pose, line in zip(others, away, lines, strict=True)]
    lights = TrafficLights(replace(town02, posts=(near, *far)), np.random.default_rng(1))
    shown = [states[0] for states in drive(lights, [waiting_car(near, town02)], 15)]
    assert shown.index(GREEN) * DT < LONGEST_GREEN + YELLOW + SHORTEST_CLEARING + 1


@pytest.mark.parametrize(("before", "turn"), [(40.0, 0.0), (4.0, 3.14)], ids=["far away", "driving away"])
def test_a_car_that_does_not_wait_changes_nothing(before: float, turn: float, town01: RoadNetwork) -> None:
    long = next(post for post in town01.posts if town01.lanes[post.lane].line.length > before)
    lights = TrafficLights(town01, np.random.default_rng(1))
    start = [light.state for light in lights.states() if light.id.startswith(f"{long.light}/")]
    drive(lights, [waiting_car(long, town01, before, turn)], 15)
    assert [light.state for light in lights.states() if light.id.startswith(f"{long.light}/")] == start


def test_no_junction_ever_shows_two_approaches_anything_but_red(town02: RoadNetwork) -> None:
    lights = TrafficLights(town02, np.random.default_rng(1))
    cars = [waiting_car(post, town02) for post in town02.posts]
    names = [light.id.split("/")[0] for light in lights.states()]
    for states in drive(lights, cars, 60):
        going = [name for name, state in zip(names, states, strict=True) if state is not RED]
        assert len(going) == len(set(going))


def test_equal_seeds_show_equal_lights(town01: RoadNetwork) -> None:
    first, again, other = (TrafficLights(town01, np.random.default_rng(seed)).states() for seed in (1, 1, 2))
    assert first == again
    assert first != other


def test_every_post_is_shown_with_its_place_and_stop_line(town01: RoadNetwork) -> None:
    lights = TrafficLights(town01, np.random.default_rng(0)).states()
    assert {light.id: (light.pose, light.stop_line) for light in lights} == {
        post.id: (post.pose, post.stop_line) for post in town01.posts
    }


def test_a_town_without_lights_has_nothing_to_show() -> None:
    from types import SimpleNamespace

    lights = TrafficLights(SimpleNamespace(posts=()), np.random.default_rng(0))  # type: ignore[arg-type]
    lights.step(0.1, boxes_of(()))
    assert lights.states() == ()


def test_where_no_cars_drive_lights_turn_for_those_whom_nobody_sees(town01: RoadNetwork) -> None:
    def changes(demand: float) -> int:
        """Phases that end in five minutes."""
        lights, seen = TrafficLights(town01, np.random.default_rng(0), demand), list[object]()
        for k in range(3000):
            lights.step(0.1 * k, boxes_of(()))
            seen.append(tuple(junction.phase for junction in lights.junctions.values()))
        return sum(before != after for before, after in pairwise(seen))

    assert changes(0.0) == 0
    assert changes(1 / 45) > 10 * len(TrafficLights(town01, np.random.default_rng(0)).junctions)


def test_with_unseen_demand_no_light_stays_red_for_long(town01: RoadNetwork) -> None:
    lights, reds = TrafficLights(town01, np.random.default_rng(1), demand=1 / 45), list[int]()
    since = np.zeros(len(lights.states()), dtype=int)
    for k in range(6000):
        lights.step(0.1 * k, boxes_of(()))
        is_red = np.array([light.state is RED for light in lights.states()])
        reds += since[~is_red & (since > 0)].tolist()
        since = np.where(is_red, since + 1, 0)
    assert len(reds) > 100
    assert np.median(reds) * 0.1 < 90.0
