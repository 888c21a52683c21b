"""The manoeuvres that the controller must master, driven with true affordances: name, set-up, requirement."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import pytest

from caldrive.agents.cal import CALAgent, OraclePerception
from caldrive.control.controller import CALController
from caldrive.control.longitudinal import DriveState
from caldrive.control.presets import DEFAULT
from caldrive.datatypes import KMH, Command, Pose, Step
from caldrive.driving.referee import Referee
from caldrive.driving.rollout import rollout
from caldrive.results import InfractionKind
from caldrive.scenarios import Scenario
from tests.fakes import CAR, StraightRoad, turn_route

ORIGIN = Pose(0, 0, 0)


@dataclass(frozen=True)
class Drive:
    """What a requirement looks at: the steps, the kinds of infraction, and shorthands in m, km/h and rad."""

    steps: list[Step]
    infractions: list[InfractionKind]

    @property
    def speeds(self) -> list[float]:
        return [step.truth.ego.speed / KMH for step in self.steps]

    @property
    def gaps(self) -> list[float]:
        return [step.truth.affordances.vehicle_distance for step in self.steps]

    @property
    def offsets(self) -> list[float]:
        return [abs(step.truth.affordances.center_distance) for step in self.steps]

    @property
    def states(self) -> set[str | None]:
        return {step.decision.state for step in self.steps if step.decision}

    @property
    def end(self) -> Pose:
        return self.steps[-1].truth.ego.pose

    def after(self, time: float) -> Drive:
        return Drive([step for step in self.steps if step.truth.time >= time], self.infractions)

    def beyond(self, s: float) -> Drive:
        return Drive([step for step in self.steps if step.truth.route_done >= s], self.infractions)


def drive(world: StraightRoad, seconds: float, cap: float | None, limit: float, start: Pose) -> Drive:
    controller = CALController(replace(DEFAULT, cap=cap, initial_limit=limit), world.dt)
    agent = CALAgent(OraclePerception(world.truth), controller)
    scenario = Scenario("straight", 1, start, Pose(1e6, 0, 0), time_limit=seconds)
    referee, steps = Referee(scenario), []
    for step in rollout(world, agent, scenario):
        steps.append(step)
        if referee.watch(step.truth) or step.truth.route_done > step.truth.route_length - 5:
            break
    return Drive(steps, [infraction.kind for infraction in referee.infractions])


@dataclass(frozen=True)
class Maneuver:
    name: str
    world: StraightRoad
    required: Callable[[Drive], bool]
    seconds: float = 20.0
    cap: float | None = None
    limit: float = 30.0
    start: Pose = ORIGIN


def stands(run: Drive) -> bool:
    return run.speeds[-1] < 0.01 and run.steps[-1].control.brake > 0.1


def queues(run: Drive) -> bool:
    """Stands 5.2 to 6.5 m behind the other car, without an emergency stop."""
    return stands(run) and 5.2 < run.gaps[-1] < 6.5 and DriveState.HAZARD_STOP not in run.states


def holds(speed: float) -> Callable[[Drive], bool]:
    """Ends at this speed and is never more than 1 km/h above it."""
    return lambda run: abs(run.speeds[-1] - speed) < 0.3 and max(run.speeds) < speed + 1.0


def waits_at_red(run: Drive) -> bool:
    return run.infractions == [] and stands(run) and run.steps[-1].truth.affordances.red_light == 1.0


def turns(side: int) -> Callable[[Drive], bool]:
    """Through the quarter turn, within 0.5 m of the centre line, heading to the side at the end."""
    return lambda run: max(run.offsets) < 0.5 and abs(run.end.heading - side * math.pi / 2) < 0.05


def recovers(run: Drive) -> bool:
    """Back on the line to 10 cm within 4 s and never more than 10 cm across it."""
    lefts = [step.truth.affordances.center_distance for step in run.steps]
    return max(run.after(4.0).offsets) < 0.1 and min(lefts) > -0.1


def slow_car(t: float) -> float:
    return 40 + 10 * KMH * t


def stop_and_go(t: float) -> float:
    """A lead car that brakes from 20 km/h to a stop in 2 s, waits until 12 s and then drives at 15 km/h."""
    v = 20 * KMH
    return 12 + v * min(t, 2) - v * min(t, 2) ** 2 / 4 + 15 * KMH * max(0.0, t - 12)


def steps_out(t: float) -> tuple[float, float] | None:
    """A person who stands on the road, 8 m ahead of the front axle of a car that comes by at 30 km/h."""
    return (50.0, 0.5) if t >= (50.0 - 8.0 - CAR.front_axle) * 3.6 / 30 else None


def steps_away(t: float) -> tuple[float, float] | None:
    return (30.0, 0.0) if t < 10 else None


RIGHT, LEFT, BEND_LEFT, BEND_RIGHT = turn_route(6, -1), turn_route(10, 1), turn_route(18, 1), turn_route(18, -1)

MANEUVERS = [
    Maneuver("stops behind a standing car at 20 km/h", StraightRoad(speed=20, lead=lambda t: 60), queues, limit=20),
    Maneuver("stops behind a standing car at 30 km/h", StraightRoad(speed=30, lead=lambda t: 60), queues),
    Maneuver("stops behind a standing car at 60 km/h", StraightRoad(speed=60, lead=lambda t: 90), queues, limit=60),
    Maneuver(
        "stops behind a standing car from 90 km/h without touching it",
        StraightRoad(speed=90, lead=lambda t: 90),
        lambda run: stands(run) and run.gaps[-1] > 2.0,
        limit=90,
    ),
    Maneuver(
        "follows a slow car at a safe distance",
        StraightRoad(speed=30, lead=slow_car, lead_speed=10),
        lambda run: min(run.gaps) > 8.0 and abs(run.speeds[-1] - 10) < 0.5,
        seconds=40,
    ),
    Maneuver(
        "follows a car that stops and goes",
        StraightRoad(speed=20, lead=stop_and_go),
        lambda run: min(run.gaps) > 4.0 and min(run.after(2).speeds) < 0.1 and abs(run.speeds[-1] - 15) < 1.0,
        seconds=40,
    ),
    Maneuver("waits at a red light at 20 km/h", StraightRoad(speed=20, light=60), waits_at_red, cap=20, seconds=15),
    Maneuver(
        "stops at a red light from 30 km/h within the area", StraightRoad(speed=30, light=60), waits_at_red, seconds=15
    ),
    Maneuver(
        "rolls on a little before a light that stays red, but not past it",
        StraightRoad(speed=20, light=60),
        lambda run: waits_at_red(run) and 0.8 < run.end.x - run.after(15.0).steps[0].truth.ego.pose.x < 1.2,
        cap=20,
        seconds=200,
    ),
    Maneuver(
        "stays before a light that stays red for ever, however near it came to stand",
        StraightRoad(speed=30, light=60),
        waits_at_red,
        seconds=200,
    ),
    Maneuver(
        "goes when the light turns green",
        StraightRoad(speed=30, light=60, green_at=15),
        lambda run: run.infractions == [] and min(run.speeds) == 0 and run.end.x > 70 and run.speeds[-1] > 25,
        seconds=25,
    ),
    Maneuver(
        "passes a green light without slowing",
        StraightRoad(speed=30, light=60, green_at=0),
        lambda run: run.infractions == [] and min(run.speeds) > 28,
    ),
    *(
        Maneuver(f"cruises at {v} km/h without overshoot", StraightRoad(), holds(v), seconds=30, limit=v)
        for v in (20, 30, 60, 90)
    ),
    Maneuver(
        "obeys a 60 sign, then a 30 sign",
        StraightRoad(signs=((100, 60), (400, 30)), speed=30),
        lambda run: max(run.speeds) > 59 and max(run.speeds) < 61 and max(run.beyond(435).speeds) < 31,
        seconds=45,
    ),
    Maneuver("obeys a 90 sign", StraightRoad(speed=60, signs=((50, 90),)), holds(90), seconds=30, limit=60),
    Maneuver("keeps its cap of 20 km/h past a 90 sign", StraightRoad(signs=((50, 90),)), holds(20), cap=20),
    Maneuver(
        "slows for a turn and speeds up behind it",
        StraightRoad(RIGHT, speed=30, command=Command.RIGHT, turn_from=20),
        lambda run: max(run.beyond(38).speeds) < 16.5 and min(run.speeds) > 13,
    ),
    Maneuver("turns right", StraightRoad(RIGHT, speed=20, command=Command.RIGHT, turn_from=20), turns(-1)),
    Maneuver("turns left", StraightRoad(LEFT, speed=20, command=Command.LEFT, turn_from=20), turns(1)),
    Maneuver("takes a bend to the left at 30 km/h", StraightRoad(BEND_LEFT, speed=30), turns(1)),
    Maneuver("takes a bend to the right at 30 km/h", StraightRoad(BEND_RIGHT, speed=30), turns(-1)),
    Maneuver(
        "goes straight on command",
        StraightRoad(speed=30),
        lambda run: max(run.offsets) < 0.01 and min(run.speeds) > 28,
    ),
    *(
        Maneuver(f"recovers from {what} at {v} km/h", StraightRoad(speed=v), recovers, seconds=10, limit=v, start=start)
        for v in (20, 30, 60, 90)
        for what, start in (("1 m off the centre", Pose(0, -1, 0)), ("10° of heading", Pose(0, 0, -math.radians(10))))
    ),
    Maneuver(
        "stops in an emergency for a person at 30 km/h",
        StraightRoad(speed=30, person=steps_out),
        lambda run: stands(run) and DriveState.HAZARD_STOP in run.states and run.end.x + CAR.length / 2 < 49.0,
    ),
    Maneuver(
        "drives on when the person has left",
        StraightRoad(speed=20, person=steps_away),
        lambda run: min(run.speeds) == 0 and run.end.x > 40,
    ),
]


@pytest.mark.parametrize("maneuver", MANEUVERS, ids=lambda maneuver: maneuver.name)
def test_maneuver(maneuver: Maneuver) -> None:
    run = drive(maneuver.world, maneuver.seconds, maneuver.cap, maneuver.limit, maneuver.start)
    assert maneuver.required(run), f"ends at {run.end}, {run.speeds[-1]:.1f} km/h, {run.states}, {run.infractions}"
