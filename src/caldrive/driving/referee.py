"""The referee: watches the truth and nothing else, says when an episode ends and which rules were broken.

Counting follows the CoRL-2017 benchmark: a lane or sidewalk infraction is a rise of the car's share there within 10
frames, a collision an impulse above what the `rules` say, and each kind then rests for some frames before it counts
again. Every touch, however soft, is noted beside.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection
from dataclasses import replace

from caldrive.datatypes import Contact, ContactKind, LightState, TrafficLight, Truth, VehicleState
from caldrive.driving.comfort import comfort
from caldrive.driving.rules import (
    APART_FRAMES,
    COLLISION,
    CORL2017,
    CROSSING,
    MOST_FRAMES,
    REST_FRAMES,
    RISE_FRAMES,
    SHARE_RISE,
    Intensity,
    Rules,
)
from caldrive.driving.speeding import SpeedWatch
from caldrive.geometry import added_up, moved, wrap_angle
from caldrive.results import EpisodeResult, Infraction, InfractionKind, Outcome
from caldrive.scenarios import Scenario

GOAL_RADIUS = 2.0  # m
ROUTE_SHARE = 0.9  # of the route, to be driven: where start and goal lie near each other, standing is no success
NEVER = -1000  # a frame long before the first one
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


def runs(light: TrafficLight, last: VehicleState, ego: VehicleState) -> bool:
    """Whether the ego's front crossed this light's stop line, and the light was meant for it."""
    turned = abs(wrap_angle(light.pose.heading - ego.pose.heading))
    return turned <= MAX_LIGHT_ANGLE and crosses(light, front(last), front(ego))


class Referee:
    """One episode's referee.

    fatal: infractions that end the episode as a failure. rules: what counts as one. signs: whether the speed signs
    count, too, or the car is told another speed. infractions: those so far, each once, with its time and place.
    touches: likewise everything that was touched. outcome: None while the episode goes on.
    """

    def __init__(
        self,
        scenario: Scenario,
        fatal: Collection[InfractionKind] = (),
        rules: Rules = CORL2017,
        *,
        signs: bool = False,
    ) -> None:
        self.scenario, self.fatal, self.rules, self.signs = scenario, fatal, rules, signs
        self.infractions: list[Infraction] = []
        self.touches: list[Infraction] = []
        self.outcome: Outcome | None = None
        self._last_counted: dict[InfractionKind, tuple[int, int]] = {}  # frame and number of the last one of its kind
        self._shares = {kind: deque[float](maxlen=RISE_FRAMES + 1) for kind in SHARE_RISE}
        self._contacts = deque[tuple[Contact, ...]](maxlen=MOST_FRAMES)
        self._touched: dict[str, int] = {}  # frame of the last touch, by what was touched
        self._speed = SpeedWatch()
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
        if self._speed.is_too_fast(truth) and self.signs:
            self._count(InfractionKind.SPEEDING, truth)
            _, number = self._last_counted[InfractionKind.SPEEDING]
            self._last_counted[InfractionKind.SPEEDING] = len(self._times), number  # it lasts
        self._keep(truth)
        if any(infraction.kind in self.fatal for infraction in self.infractions):
            self.outcome = Outcome.FAILED
        elif is_there(truth):
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
            rules=self.rules.name,
            touches=tuple(self.touches),
            comfort=comfort(self._times, self._speeds, self._headings, self._centers),
            speeding=self._speed.share,
            worst_excess=self._speed.worst,
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
        self._contacts.append(truth.contacts)
        for contact in truth.contacts:
            name = f"{contact.kind.value} {contact.id}"
            if len(self._times) - self._touched.get(name, NEVER) > APART_FRAMES:
                touch = _infraction(COLLISION[contact.kind], truth, contact.at_fault)
                self.touches.append(touch)
                if self.rules.collisions is None:
                    self.infractions.append(touch)
            self._touched[name] = len(self._times)
        if self.rules.collisions is None:
            return
        for kind, intensity in self.rules.collisions.items():
            if (at_fault := self._hit(kind, intensity)) is not None:
                self._count(COLLISION[kind], truth, at_fault)

    def _hit(self, kind: ContactKind, intensity: Intensity) -> bool | None:
        """Whether contacts of a kind that add up to a collision are the ego's fault, None where they are too soft."""
        recent = [c for frame in list(self._contacts)[-intensity.frames :] for c in frame if c.kind is kind]
        is_hard = added_up(contact.impulse for contact in recent) > intensity.least
        return any(contact.at_fault for contact in recent) if is_hard else None

    def _watch_lights(self, truth: Truth) -> None:
        if self._last is None:
            return
        for light in truth.lights:
            if light.state in self.rules.closed and runs(light, self._last.ego, truth.ego):
                self._count(CROSSING[light.state], truth, at_fault=light.state is LightState.RED)

    def _count(self, kind: InfractionKind, truth: Truth, at_fault: bool = True) -> None:
        """One more infraction, unless one of its kind was counted shortly before: that becomes the ego's own where this
        is."""
        frame, (before, number) = len(self._times), self._last_counted.get(kind, (NEVER, NEVER))
        if frame - before > REST_FRAMES[kind]:
            self._last_counted[kind] = frame, len(self.infractions)
            self.infractions.append(_infraction(kind, truth, at_fault))
        elif at_fault and not self.infractions[number].at_fault:
            self.infractions[number] = replace(self.infractions[number], at_fault=True)

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


def is_there(truth: Truth) -> bool:
    """Whether the ego is at its goal, and has driven there; a world without a route does not say how."""
    has_driven = math.isinf(truth.route_length) or truth.route_done >= ROUTE_SHARE * truth.route_length
    return truth.goal_distance <= GOAL_RADIUS and has_driven


def _infraction(kind: InfractionKind, truth: Truth, at_fault: bool) -> Infraction:
    place = truth.ego.pose
    return Infraction(kind=kind, time=truth.time, x=place.x, y=place.y, at_fault=at_fault)
