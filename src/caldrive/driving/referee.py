"""The referee: watches the truth and nothing else, says when an episode ends and which rules were broken.

Counting follows the CoRL-2017 benchmark: a lane or sidewalk infraction is a rise of the car's share there within 10
frames, a collision an impulse above a threshold, and each kind then rests for some frames before it counts again.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection

from caldrive.datatypes import ContactKind, LightState, TrafficLight, Truth, VehicleState
from caldrive.driving.comfort import comfort
from caldrive.geometry import moved, wrap_angle
from caldrive.results import EpisodeResult, Infraction, InfractionKind, Outcome
from caldrive.scenarios import Scenario

GOAL_RADIUS = 2.0  # m
RISE_FRAMES = 10
NEVER = -1000  # a frame long before the first one
REST_FRAMES = {
    InfractionKind.OPPOSITE_LANE: 20,
    InfractionKind.SIDEWALK: 20,
    InfractionKind.RED_LIGHT: 20,
    InfractionKind.COLLISION_OBJECT: 20,
    InfractionKind.COLLISION_CAR: 30,
    InfractionKind.COLLISION_PERSON: 100,
}
SHARE_RISE = {InfractionKind.OPPOSITE_LANE: 0.4, InfractionKind.SIDEWALK: 0.3}
COLLISIONS = {  # kind and impulse in N s above which it counts
    ContactKind.OBJECT: (InfractionKind.COLLISION_OBJECT, 400.0),
    ContactKind.CAR: (InfractionKind.COLLISION_CAR, 400.0),
    ContactKind.PERSON: (InfractionKind.COLLISION_PERSON, 300.0),
}
MAX_LIGHT_ANGLE = math.radians(60)  # a light further off the ego's heading is for others


def front(ego: VehicleState) -> tuple[float, float]:
    """The middle of the front bumper (x, y), m."""
    bumper = moved(ego.pose, forward=ego.length / 2)
    return bumper.x, bumper.y


def crosses(light: TrafficLight, before: tuple[float, float], after: tuple[float, float]) -> bool:
    """Whether a point (x, y) that moves from before to after passes the stop line in the sense of the light's
    traffic."""
    (ax, ay), (bx, by) = light.stop_line
    length = math.hypot(bx - ax, by - ay)
    tx, ty = (bx - ax) / length, (by - ay) / length
    if -ty * math.cos(light.pose.heading) + tx * math.sin(light.pose.heading) < 0:
        (ax, ay), (tx, ty) = (bx, by), (-tx, -ty)
    behind, ahead = (-ty * (x - ax) + tx * (y - ay) for x, y in (before, after))
    if not behind <= 0 < ahead:
        return False
    share = -behind / (ahead - behind)
    x, y = (p + share * (q - p) for p, q in zip(before, after, strict=True))
    return 0 <= tx * (x - ax) + ty * (y - ay) <= length


def runs_red(light: TrafficLight, last: VehicleState, ego: VehicleState) -> bool:
    """Whether the ego's front crossed this light's stop line while it showed red to the ego."""
    turned = abs(wrap_angle(light.pose.heading - ego.pose.heading))
    return light.state is LightState.RED and turned <= MAX_LIGHT_ANGLE and crosses(light, front(last), front(ego))


class Referee:
    """One episode's referee.

    fatal: infractions that end the episode as a failure. infractions: those so far, each once, with its time and place.
    outcome: None while the episode goes on.
    """

    def __init__(self, scenario: Scenario, fatal: Collection[InfractionKind] = ()) -> None:
        self.scenario, self.fatal = scenario, fatal
        self.infractions: list[Infraction] = []
        self.outcome: Outcome | None = None
        self._last_counted: dict[tuple[InfractionKind, bool], int] = {}  # frame of the last one of its kind and fault
        self._shares = {kind: deque[float](maxlen=RISE_FRAMES + 1) for kind in SHARE_RISE}
        self._last: Truth | None = None
        self._distance = 0.0
        self._times: list[float] = []
        self._speeds: list[float] = []
        self._headings: list[float] = []
        self._centers: list[float] = []

    def watch(self, truth: Truth) -> Outcome | None:
        """Judge one frame; the outcome if the episode is over, else None."""
        self._watch_shares(truth)
        self._watch_contacts(truth)
        self._watch_lights(truth)
        self._keep(truth)
        if any(infraction.kind in self.fatal for infraction in self.infractions):
            self.outcome = Outcome.FAILED
        elif truth.goal_distance <= GOAL_RADIUS:
            self.outcome = Outcome.SUCCESS
        elif truth.time >= self.scenario.time_limit:
            self.outcome = Outcome.TIMEOUT
        return self.outcome

    def result(self) -> EpisodeResult:
        """How it went up to the last frame; an episode without an end counts as aborted."""
        last = self._last
        return EpisodeResult(
            scenario=self.scenario,
            outcome=self.outcome or Outcome.ABORTED,
            duration=self._times[-1] - self._times[0] if self._times else 0.0,
            distance=self._distance,
            route_done=last.route_done if last else 0.0,
            route_length=last.route_length if last else math.inf,
            infractions=tuple(self.infractions),
            comfort=comfort(self._times, self._speeds, self._headings, self._centers),
        )

    def _watch_shares(self, truth: Truth) -> None:
        shares = {
            InfractionKind.OPPOSITE_LANE: truth.opposite_share,
            InfractionKind.SIDEWALK: truth.sidewalk_share,
        }
        for kind, share in shares.items():
            recent = self._shares[kind]
            recent.append(share)
            if share - min(recent) > SHARE_RISE[kind]:
                self._count(kind, truth)

    def _watch_contacts(self, truth: Truth) -> None:
        for contact in truth.contacts:
            kind, threshold = COLLISIONS[contact.kind]
            if contact.impulse > threshold:
                self._count(kind, truth, contact.at_fault)

    def _watch_lights(self, truth: Truth) -> None:
        if self._last is None:
            return
        if any(runs_red(light, self._last.ego, truth.ego) for light in truth.lights):
            self._count(InfractionKind.RED_LIGHT, truth)

    def _count(self, kind: InfractionKind, truth: Truth, at_fault: bool = True) -> None:
        """One more infraction, unless one of its kind and fault was counted shortly before."""
        frame = len(self._times)
        if frame - self._last_counted.get((kind, at_fault), NEVER) <= REST_FRAMES[kind]:
            return
        self._last_counted[kind, at_fault] = frame
        place = truth.ego.pose
        self.infractions.append(Infraction(kind=kind, time=truth.time, x=place.x, y=place.y, at_fault=at_fault))

    def _keep(self, truth: Truth) -> None:
        """What the result is made of."""
        if self._last is not None:
            before, now = self._last.ego.pose, truth.ego.pose
            self._distance += math.hypot(now.x - before.x, now.y - before.y)
        self._last = truth
        self._times.append(truth.time)
        self._speeds.append(truth.ego.speed)
        self._headings.append(truth.ego.pose.heading)
        self._centers.append(truth.affordances.center_distance)
