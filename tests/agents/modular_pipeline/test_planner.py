"""The planner's five states, on ground drawn from above."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from caldrive.agents.modular_pipeline.planner import (
    EXIT,
    TURN_STATES,
    Memory,
    Plan,
    State,
    plan,
    smooth_into,
)
from caldrive.agents.modular_pipeline.pursuit import waypoint_ahead
from caldrive.agents.modular_pipeline.road_edge import Edge
from caldrive.agents.modular_pipeline.scene import JUNCTION_AHEAD
from caldrive.datatypes import Command, Pose
from caldrive.geometry import moved, to_local
from tests.agents.modular_pipeline.grids import STREET, ground

STILL = Pose(0.0, 0.0, 0.0)
ANYWHERE = ground([STREET], seen=(0.0, 1.0, 0.0, 1.0))  # nothing is seen of the road


def after(plan_: Plan, command: Command, junction: float, steps: int, motion: Pose = STILL) -> Plan:
    """The plan so many steps later, blind."""
    for _ in range(steps):
        plan_ = plan(ANYWHERE, junction, command, motion, plan_.memory)
    return plan_


def first(command: Command, junction: float, memory: Memory | None = None) -> Plan:
    """The plan of a car that has seen such a junction for long."""
    return plan(ground([STREET]), junction, command, STILL, replace(memory or Memory(), junction=junction))


@pytest.mark.parametrize(
    ("command", "junction", "state"),
    [
        (Command.STRAIGHT, 0.1, State.ROAD_FOLLOWING),
        (Command.LEFT, 0.1, State.ROAD_FOLLOWING),
        (Command.RIGHT, 0.1, State.ROAD_FOLLOWING),
        (Command.STRAIGHT, 0.9, State.STRAIGHT_ON),
        (Command.LEFT, 0.9, State.LEFT_TURN),
        (Command.RIGHT, 0.9, State.RIGHT_TURN),
    ],
)
def test_the_state_follows_from_command_and_junction(command: Command, junction: float, state: State) -> None:
    assert first(command, junction).state is state


@pytest.mark.parametrize("aside", [-0.8, 0.0, 0.7])
def test_on_the_road_waypoints_lead_to_two_metres_from_the_right_edge(aside: float) -> None:
    grid = ground([(-1.0, 30.0, -2.0 - aside, 6.0 - aside)])
    found = plan(grid, 0.0, Command.STRAIGHT, STILL, Memory())
    for _ in range(30):
        found = plan(grid, 0.0, Command.STRAIGHT, STILL, found.memory)
    assert found.waypoints[:, 1] == pytest.approx(-aside, abs=0.1)


@pytest.mark.parametrize("command", [Command.LEFT, Command.RIGHT])
def test_a_turn_ends_where_the_target_lane_is(command: Command) -> None:
    memory = replace(Memory(), entry=6.0)
    waypoints = first(command, 0.9, memory).waypoints
    exit = moved(Pose(6.0, 0.0, 0.0), EXIT[command].x, EXIT[command].y, EXIT[command].heading)
    side = math.copysign(1.0, exit.y)
    ends = to_local(exit, waypoints[-10:])
    assert np.abs(ends[:, 1]).max() < 0.1  # on the lane's middle
    assert (np.diff(ends[:, 0]) > 0).all()  # along its heading
    assert waypoints[waypoints[:, 0] < 5.5][:, 1] == pytest.approx(0.0, abs=0.01)  # straight on up to the junction
    assert (side * waypoints[:, 1] > -0.2).all()


def test_a_right_turn_is_a_quarter_of_a_circle() -> None:
    centre, radius = np.array([0.0, -9.0]), 9.0
    row = smooth_into(STILL, EXIT[Command.RIGHT])
    curve = row[row[:, 1] > -9.0]
    assert np.hypot(*(curve - centre).T) == pytest.approx(radius, abs=0.1)


def test_a_left_turn_has_two_parts() -> None:
    """Before the target lane is in view the way leads to the middle of the junction, at an angle; then straight into
    the lane."""
    begun = first(Command.LEFT, 0.9, replace(Memory(), entry=6.0))
    blind = plan(ANYWHERE, 0.9, Command.LEFT, Pose(5.5, 0.0, 0.0), begun.memory)
    assert blind.memory.turn is not None
    assert blind.memory.turn.start is None
    angles = np.degrees(np.arctan2(*(blind.waypoints[4:10] - blind.waypoints[3]).T[::-1]))
    assert angles == pytest.approx(12.0, abs=1.0)
    crossing = ground([STREET, (6.0, 15.5, -22.0, 22.0)])  # its far kerb is half a metre farther than presumed
    seen = plan(crossing, 0.9, Command.LEFT, STILL, blind.memory)
    assert seen.memory.turn is not None
    assert seen.memory.turn.start == STILL
    assert seen.memory.turn.exit.x == pytest.approx(13.5, abs=0.15)


def test_a_turn_goes_on_whatever_the_junction_says_and_happens_once() -> None:
    begun = first(Command.RIGHT, 0.9, replace(Memory(), entry=6.0))
    begun = plan(ANYWHERE, 0.9, Command.RIGHT, Pose(5.5, 0.0, 0.0), begun.memory)
    step = Pose(0.4, 0.0, -0.045)  # along a circle of 9 m
    middle = after(begun, Command.RIGHT, 0.1, 15, step)
    assert middle.state is State.RIGHT_TURN
    done = after(middle, Command.RIGHT, 0.9, 22, step)
    assert done.memory.done
    assert done.state is State.STRAIGHT_ON
    assert after(done, Command.RIGHT, 0.9, 20).state is State.STRAIGHT_ON  # still in the same junction
    assert after(after(done, Command.RIGHT, 0.0, 1), Command.RIGHT, 0.9, 9).state is State.STRAIGHT_ON  # one bad look
    assert after(done, Command.RIGHT, 0.0, 5).state is State.ROAD_FOLLOWING
    assert after(after(done, Command.RIGHT, 0.0, 5), Command.RIGHT, 0.9, 3).state is State.RIGHT_TURN


def test_neither_one_look_nor_an_opening_alone_makes_a_junction() -> None:
    assert plan(ANYWHERE, 1.0, Command.RIGHT, STILL, Memory()).state is State.ROAD_FOLLOWING
    assert plan(ANYWHERE, 0.0, Command.RIGHT, STILL, Memory(entry=1.5)).state is State.ROAD_FOLLOWING


def test_an_opening_that_cannot_be_the_junctions_does_not_say_where_it_is() -> None:
    turn = plan(ANYWHERE, 0.9, Command.RIGHT, STILL, Memory(junction=0.9, entry=0.5)).memory.turn
    assert turn is not None
    assert turn.entry.x == JUNCTION_AHEAD


def test_without_a_seen_opening_the_junction_is_where_it_is_first_noticed() -> None:
    turn = plan(ANYWHERE, 0.9, Command.RIGHT, STILL, Memory(junction=0.9)).memory.turn
    assert turn is not None
    assert turn.entry.x == JUNCTION_AHEAD


@pytest.mark.parametrize("command", [Command.LEFT, Command.RIGHT])
def test_the_junction_is_found_where_the_road_opens(command: Command) -> None:
    side = (10.0, 14.0, 0.0, 22.0) if command is Command.LEFT else (10.0, 14.0, -22.0, 0.0)
    found = plan(ground([STREET, side]), 0.0, command, STILL, Memory())
    assert found.memory.entry == pytest.approx(5.0, abs=0.6)  # a rounded corner opens later than the junction begins
    assert plan(ground([STREET, side]), 0.0, Command.STRAIGHT, STILL, Memory()).memory.entry is None


def test_the_same_eyes_and_command_give_the_same_plan() -> None:
    plans = [first(Command.LEFT, 0.9) for _ in range(2)]
    assert (plans[0].waypoints == plans[1].waypoints).all()
    assert plans[0].memory == plans[1].memory


def test_a_car_that_moves_finds_what_it_remembers_where_it_is() -> None:
    memory = Memory(edge=Edge(-2.0), entry=8.0)
    found = plan(ANYWHERE, 0.0, Command.RIGHT, Pose(2.0, 0.5, 0.0), memory).memory
    assert found.entry == pytest.approx(6.0)
    assert found.edge.a == pytest.approx(-2.5)


def test_the_waypoint_steered_to_is_the_first_that_is_far_enough_ahead() -> None:
    points = np.array([(-9.0, 0.0), (1.0, 0.0), (4.0, 0.0), (6.0, 0.0)])
    assert waypoint_ahead(points, (0.0, 0.0), 3.0) == (4.0, 0.0)
    assert waypoint_ahead(points, (0.0, 0.0), 30.0) == (6.0, 0.0)


def test_every_command_that_turns_has_a_state() -> None:
    assert set(TURN_STATES) == set(EXIT) == {Command.LEFT, Command.RIGHT}
