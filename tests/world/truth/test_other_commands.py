"""What other commands would ask for at a junction, beside what the route asks for."""

from __future__ import annotations

import numpy as np
import pytest

from caldrive.datatypes import MAX_CENTER_DISTANCE, Command
from caldrive.geometry import moved
from caldrive.world.roads.route import Route, random_route
from caldrive.world.roads.towns import load_roads
from caldrive.world.truth.labels import to_line
from caldrive.world.truth.other_commands import alternatives, forks

TOWN = load_roads("town01")


def route_through(command: Command, seed: int = 0, away: float = 30.0) -> Route:
    """A route that begins some way before a turn and takes it."""
    rng = np.random.default_rng(seed)
    turns = [lane for lane in TOWN.lanes.values() if lane.turn is command]
    turn = turns[int(rng.integers(len(turns)))]
    (before,) = [lane for lane in TOWN.lanes.values() if turn.id in lane.successors]
    start = before.line.pose_at(max(0.0, before.line.length - away))
    return random_route(TOWN, start, 90.0, rng, through=turn.id)


@pytest.mark.parametrize("command", list(Command))
@pytest.mark.parametrize("seed", range(4))
def test_every_junction_of_the_town_has_one_other_way(command: Command, seed: int) -> None:
    route = route_through(command, seed)
    others = forks(TOWN, route)
    assert len(others) == len(route.turns)  # all junctions are T-junctions, and no street ends
    for fork, turn in zip(others, route.turns, strict=True):
        assert fork.command is not turn.command
        assert fork.end == turn.end
        assert turn.start - 20.0 <= fork.start <= turn.start


@pytest.mark.parametrize("command", list(Command))
def test_before_the_junction_both_ways_are_one(command: Command) -> None:
    route = route_through(command)
    turn = route.turns[0]
    for s in np.arange(max(1.0, turn.start - 15.0), turn.start - 1.0, 2.0):
        axle = moved(route.line.pose_at(float(s)), left=0.3, turn=0.05)
        (other,) = alternatives(axle, forks(TOWN, route), float(s))
        angle, distance, _ = to_line(axle, route.line, float(s))
        assert other.relative_angle == pytest.approx(angle, abs=0.02)
        assert other.center_distance == pytest.approx(distance, abs=0.05)


@pytest.mark.parametrize(
    ("taken", "asked", "sign"),
    [(Command.STRAIGHT, Command.LEFT, 1), (Command.STRAIGHT, Command.RIGHT, -1), (Command.LEFT, Command.RIGHT, -1)],
)
def test_inside_the_junction_another_command_asks_for_its_way(taken: Command, asked: Command, sign: int) -> None:
    route = next(r for r in (route_through(taken, seed) for seed in range(40)) if forks(TOWN, r)[0].command is asked)
    turn, ways = route.turns[0], forks(TOWN, route)
    others = []
    for s in np.arange(turn.start, turn.end, 0.5):
        others += alternatives(route.line.pose_at(float(s)), ways, float(s))
    assert {other.command for other in others} == {asked}
    angles = [sign * other.relative_angle for other in others]
    distances = [sign * other.center_distance for other in others]
    assert max(angles) > 0.4
    assert min(angles) > -0.05
    assert distances == sorted(distances)  # the ways part and do not meet again
    assert max(distances) == MAX_CENTER_DISTANCE


def test_far_from_a_way_its_command_is_not_given() -> None:
    route = route_through(Command.STRAIGHT)
    turn, ways = route.turns[0], forks(TOWN, route)
    assert not alternatives(route.line.pose_at(turn.end), ways, turn.end)
    assert not alternatives(route.line.pose_at(turn.start - 21.0), ways, turn.start - 21.0)


def test_a_route_that_begins_close_to_the_junction_knows_its_other_way_from_the_start() -> None:
    route = route_through(Command.LEFT, away=6.0)
    (fork, *_), turn = forks(TOWN, route), route.turns[0]
    assert turn.start == pytest.approx(6.0, abs=0.5)
    assert fork.start == 0.0
    (other,) = alternatives(moved(route.line.pose_at(1.0), left=-0.5), [fork], 1.0)
    assert other.center_distance == pytest.approx(0.5, abs=0.05)
