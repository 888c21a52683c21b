"""The rule-based planner: five states, and the waypoints of each (S.2.1).

What it knows is the ground as the cameras see it, whether a junction is near, and the command. The shapes of a turn
(the constants below) are those of town01's junctions; the paper's were tuned in its town 1, too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from caldrive.agents.modular_pipeline.ground import GroundGrid
from caldrive.agents.modular_pipeline.road_edge import ACROSS, LOST, ROAD, TARGET, Edge, edge_points, fit_edge, opening
from caldrive.agents.modular_pipeline.scene import JUNCTION_AHEAD
from caldrive.datatypes import Command, Points, Pose
from caldrive.geometry import moved, to_local, to_world, wrap_angle

EDGE_DISTANCE = 2.0  # m from the right edge of the road to the middle of the lane
USUAL_EDGE = Edge(-EDGE_DISTANCE)  # of a lane, along its middle
CAR = Pose(0.0, 0.0, 0.0)
AHEAD = np.arange(1.0, 14.0, 0.5)  # m along the lane at which waypoints lie
ROAD_WIDTH = 8.0  # m
JUNCTION, NO_JUNCTION = 0.5, 0.2  # smoothed probabilities from which there is one, and until which one is left
SMOOTHING = 0.4  # share of a new probability
LIKELY = (2.0, 14.0)  # m between which an opening may be that of a junction that has just been noticed
CORNER = 5.0  # m from the junction's begin to where a corner's kerb is 1 m off the line
OPENING = {  # m ahead at which a side of the road may be seen to open: the left one lies far to the side
    Command.LEFT: np.arange(8.5, 17.0, 0.5),
    Command.RIGHT: np.arange(4.5, 16.0, 0.5),
}
EXIT = {  # the middle of the lane that a turn leads into, seen from where the own lane enters the junction
    Command.LEFT: Pose(13.0, 13.0, math.pi / 2),
    Command.RIGHT: Pose(9.0, -9.0, -math.pi / 2),
}
SKEW, MIDDLE = 0.21, 7.0  # rad to the left of the lane, and m in that direction to the middle of the junction
EXIT_STATIONS = np.arange(0.0, 9.0, 0.5)  # m along the target lane at which its edge is looked for
FOUND, IN_VIEW = 4, 8  # points of an edge that keep it in sight, and that make it seen
REFINED = 1.0  # m before the junction up to which the turn is planned anew
SPACING = 0.5  # m between two waypoints
CIRCLE = 1.17  # of the gap, the tangents with which a cubic is a quarter of a circle, nearly
AFTER = 8.0  # m of the lane that follow a turn
FINISHED, TURNED = 3.0, 0.35  # m to the target lane, or rad from its heading, at which a turn ends


class State(StrEnum):
    """What the planner does."""

    ROAD_FOLLOWING = "road following"
    LEFT_TURN = "left turn"
    RIGHT_TURN = "right turn"
    STRAIGHT_ON = "straight on"
    HAZARD_STOP = "hazard stop"


TURN_STATES = {Command.LEFT: State.LEFT_TURN, Command.RIGHT: State.RIGHT_TURN}


@dataclass(frozen=True)
class Turn:
    """A turn on its way, seen from the car."""

    command: Command
    entry: Pose
    """The middle of the own lane where the junction begins."""
    exit: Pose
    """The middle of the target lane where the junction ends."""
    start: Pose | None = None
    """Where the smooth row of waypoints begins; None in the first part of a left turn, before the target lane has come
    into view."""


@dataclass(frozen=True)
class Memory:
    """What is carried from one step to the next, seen from the car."""

    state: State = State.ROAD_FOLLOWING
    edge: Edge = USUAL_EDGE
    entry: float | None = None
    """m to the junction where the road was seen to open, None while it was not."""
    turn: Turn | None = None
    done: bool = False
    """Whether the turn of this junction is done."""
    junction: float = 0.0
    """The probability of a junction, smoothed."""


@dataclass(frozen=True)
class Plan:
    """What is to be done: the state, and waypoints (N, 2) in the car's frame; and what is to be remembered."""

    state: State
    waypoints: Points
    memory: Memory


def plan(grid: GroundGrid, junction: float, command: Command, motion: Pose, memory: Memory) -> Plan:
    """The next plan. motion: the car's pose in the frame that it had at the last one."""
    memory = seen_from(memory, motion)
    smoothed = memory.junction + SMOOTHING * (junction - memory.junction)
    done = memory.done and command is not Command.STRAIGHT and smoothed > NO_JUNCTION
    near = smoothed > JUNCTION
    memory = replace(memory, edge=_track(grid, memory.edge, near), junction=smoothed, done=done)
    memory = replace(memory, entry=_entry(grid, command, memory))
    if memory.turn is None and command in TURN_STATES and near and not done:
        is_likely = memory.entry is not None and LIKELY[0] < memory.entry < LIKELY[1]
        memory = replace(memory, entry=memory.entry if is_likely else JUNCTION_AHEAD)
        memory = replace(memory, turn=_planned(command, memory))
    if memory.turn is not None:
        return _turn(grid, memory, memory.turn)
    state = State.STRAIGHT_ON if near else State.ROAD_FOLLOWING
    return Plan(state, memory.edge.beside(EDGE_DISTANCE, AHEAD), replace(memory, state=state))


def seen_from(memory: Memory, motion: Pose) -> Memory:
    """The memory from where the car is now."""
    turn = memory.turn
    if turn is not None:
        start = None if turn.start is None else _pose_from(motion, turn.start)
        turn = replace(turn, entry=_pose_from(motion, turn.entry), exit=_pose_from(motion, turn.exit), start=start)
    entry = None if memory.entry is None else memory.entry - motion.x
    return replace(memory, edge=memory.edge.moved(motion), entry=entry, turn=turn)


def _pose_from(frame: Pose, pose: Pose) -> Pose:
    """A pose seen from a frame."""
    x, y = to_local(frame, np.array([[pose.x, pose.y]]))[0].tolist()
    return Pose(x, y, wrap_angle(pose.heading - frame.heading))


def _track(grid: GroundGrid, expected: Edge, near: bool) -> Edge:
    """The right edge, which near a junction is expected to go on as it is."""
    if near:
        expected = replace(expected, c=0.0)
    points = edge_points(grid, expected, CAR)
    if near or expected.points >= FOUND:
        return fit_edge(points, expected, ACROSS if near else ROAD)
    found = fit_edge(points, expected, LOST)
    return found if found.points >= IN_VIEW else fit_edge(points, expected, ROAD)


def _entry(grid: GroundGrid, command: Command, memory: Memory) -> float | None:
    """m to the junction that the command is for, by the side of the road that opens."""
    if command is Command.STRAIGHT or memory.done:
        return None
    if memory.turn is not None and memory.turn.entry.x < REFINED:
        return memory.entry
    side = ROAD_WIDTH if command is Command.LEFT else 0.0
    found = opening(grid, memory.edge, side=side, stations=OPENING[command])
    if found is None:
        return memory.entry
    found -= CORNER
    return found if memory.entry is None else memory.entry + 0.3 * (found - memory.entry)


def _planned(command: Command, memory: Memory) -> Turn:
    """A turn at the junction ahead."""
    assert memory.entry is not None
    ahead, edge = memory.entry, memory.edge
    slope = math.atan(edge.b + 2 * edge.c * ahead)
    x, y = edge.beside(EDGE_DISTANCE, np.array([ahead]))[0].tolist()
    entry, exit = Pose(x, y, slope), EXIT[command]
    start = None if command is Command.LEFT else entry
    return Turn(command, entry, moved(entry, exit.x, exit.y, exit.heading), start)


def _turn(grid: GroundGrid, memory: Memory, turn: Turn) -> Plan:
    """The next plan in a turn, or what follows it."""
    turn = _planned(turn.command, memory) if turn.entry.x > REFINED else _corrected(grid, turn)
    memory = replace(memory, turn=turn)
    state = TURN_STATES[turn.command]
    if turn.exit.x < FINISHED and abs(turn.exit.heading) < TURNED:
        slope = math.tan(turn.exit.heading)
        edge = Edge(turn.exit.y - EDGE_DISTANCE - slope * turn.exit.x, slope)
        memory = Memory(State.ROAD_FOLLOWING, edge, done=True, junction=memory.junction)
        return Plan(state, edge.beside(EDGE_DISTANCE, AHEAD), memory)
    return Plan(state, _turn_waypoints(turn), replace(memory, state=state))


def _corrected(grid: GroundGrid, turn: Turn) -> Turn:
    """The turn with its target lane where its edge is seen."""
    points = edge_points(grid, USUAL_EDGE, turn.exit, EXIT_STATIONS)
    seen = fit_edge(points, USUAL_EDGE, TARGET, EXIT_STATIONS)
    if seen.points < IN_VIEW:
        return turn
    exit = moved(turn.exit, left=seen.a + EDGE_DISTANCE, turn=math.atan(seen.b))
    return replace(turn, exit=exit, start=turn.start or CAR)


def _turn_waypoints(turn: Turn) -> Points:
    """Straight to the junction; to the left then at a skew angle to its middle, until the target lane is in view; and a
    smooth row into that lane."""
    middle = moved(moved(turn.entry, turn=SKEW), forward=MIDDLE)
    start = turn.start or middle
    legs = [(CAR, turn.entry)] if turn.entry.x > SPACING else []
    legs += [(turn.entry, middle)] if turn.start is None else []
    return np.concatenate([*(_straight_to(*leg) for leg in legs), smooth_into(start, turn.exit)])


def smooth_into(start: Pose, lane: Pose, spacing: float = SPACING) -> Points:
    """Points (N, 2) of a cubic from a pose into a lane (a point on its middle, with its heading), and AFTER m on."""
    gap = math.hypot(lane.x - start.x, lane.y - start.y)
    n = max(2, math.ceil(gap / spacing))
    u = np.linspace(0, 1, n)[:, None]
    tangent = [CIRCLE * gap * np.array([math.cos(p.heading), math.sin(p.heading)]) for p in (start, lane)]
    p, q = np.array([start.x, start.y]), np.array([lane.x, lane.y])
    curve = (
        (2 * u**3 - 3 * u**2 + 1) * p + (u**3 - 2 * u**2 + u) * tangent[0]
        + (3 * u**2 - 2 * u**3) * q + (u**3 - u**2) * tangent[1]
    )  # fmt: skip
    onward = np.arange(spacing, AFTER, spacing)
    return np.concatenate((curve, to_world(lane, np.stack((onward, 0 * onward), axis=1))))


def _straight_to(start: Pose, end: Pose) -> Points:
    """Points (N, 2) from one pose to another, without the last."""
    n = max(1, round(math.hypot(end.x - start.x, end.y - start.y) / SPACING))
    return np.linspace((start.x, start.y), (end.x, end.y), n, endpoint=False)
