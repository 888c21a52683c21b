"""Rewards: each a sum of named terms with weights.

`carla2017` is that of the paper's RL (CARLA paper, supplement S.2.3); `roach` that of Roach and of Implicit Affordances
(Zhang et al. 2021; Toromanoff et al. 2020), from the truth alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from caldrive.datatypes import KMH, Control, LightState, Truth
from caldrive.geometry import added_up, to_local, wrap_angle

MOST_WANTED = 6.0  # m/s, the speed that `roach` wants on a free road
ROOM = 5.0  # m over which it falls to 0
BEFORE_CAR, BEFORE_PERSON, BEFORE_LIGHT = 8.0, 6.0, 5.0  # m, between middles, at which it is 0
CORRIDOR = 2.0  # m to either side in which somebody is ahead
FARTHEST_LIGHT = 15.0  # m
FACING = 0.5  # rad between the ways of the ego and of those for whom a light is
STEADY = 0.01  # of the steering, below which a change is none


@dataclass(frozen=True)
class Transition:
    """What a reward is made of: what was true before and is now, and how it was driven before and since."""

    before: Truth
    now: Truth
    last: Control
    control: Control
    broke: bool
    """Whether a rule was broken that ends the episode."""


Terms = Callable[[Transition], dict[str, float]]


@dataclass(frozen=True)
class Preset:
    """A reward."""

    terms: Terms
    """Without weights."""
    weights: Mapping[str, float]
    """By the names of the terms."""

    def rewards(self, transition: Transition, changed: Mapping[str, float]) -> dict[str, float]:
        """The terms with their weights; their sum is the reward. changed: weights in place of the preset's."""
        weights = {**self.weights, **changed}
        return {name: weights[name] * value for name, value in self.terms(transition).items()}


def carla2017_terms(transition: Transition) -> dict[str, float]:
    """S.2.3: kilometres towards the goal along the route, km/h gained, damage (impulses in N s), and how much more of
    the car is on the sidewalk and on the opposite lane. The paper's weight of damage, 0.00002, is for CARLA before 0.8,
    whose unit was a hundredth: its released agent multiplies newer impulses by 100."""
    before, now = transition.before, transition.now
    return {
        "distance": (now.route_done - before.route_done) / 1000,
        "speed": (now.ego.speed - before.ego.speed) / KMH,
        "damage": added_up(-contact.impulse for contact in now.contacts),
        "sidewalk": -(now.sidewalk_share - before.sidewalk_share),
        "opposite_lane": -(now.opposite_share - before.opposite_share),
    }


def roach_terms(transition: Transition) -> dict[str, float]:
    """Speed near the wanted one, distance to the centre line (m) and angle to the route (rad), changes of the steering,
    and the end by a broken rule."""
    now, seen = transition.now, transition.now.affordances
    return {
        "speed": 1 - abs(now.ego.speed - wanted_speed(now)) / MOST_WANTED,
        "position": -abs(seen.center_distance) / 2,
        "angle": -abs(seen.relative_angle),
        "steering": -float(abs(transition.control.steer - transition.last.steer) > STEADY),
        "end": -(1 + now.ego.speed) if transition.broke else 0.0,
    }


def wanted_speed(truth: Truth) -> float:
    """m/s: MOST_WANTED, and less the nearer a car, a person or a closed light is ahead."""
    seen = truth.affordances
    gaps = [seen.vehicle_distance + truth.ego.length - BEFORE_CAR]
    for person in truth.pedestrians:
        ahead, left = to_local(truth.ego.pose, (person.pose.x, person.pose.y)).tolist()  # type: ignore[arg-type]
        if ahead > 0 and abs(left) < CORRIDOR and person.on_road:
            gaps.append(ahead - BEFORE_PERSON)
    # Who is asked to stop may do so anywhere. The label ends where it is too late to stop, the fault does not.
    gaps.append(0.0 if seen.red_light else _to_closed_light(truth) - BEFORE_LIGHT)
    return MOST_WANTED * min(1.0, max(0.0, min(gaps) / ROOM))


def _to_closed_light(truth: Truth) -> float:
    """m from the ego's middle to the nearest stop line ahead whose light is not green."""
    aheads = [FARTHEST_LIGHT]
    for light in truth.lights:
        (x0, y0), (x1, y1) = light.stop_line
        ahead, left = to_local(truth.ego.pose, ((x0 + x1) / 2, (y0 + y1) / 2)).tolist()  # type: ignore[arg-type]
        faces = abs(wrap_angle(light.pose.heading - truth.ego.pose.heading)) < FACING
        if light.state is not LightState.GREEN and faces and ahead > 0 and abs(left) < CORRIDOR:
            aheads.append(ahead)
    return min(aheads)


PRESETS: Mapping[str, Preset] = {
    "carla2017": Preset(
        carla2017_terms, {"distance": 1000.0, "speed": 0.05, "damage": 0.002, "sidewalk": 2.0, "opposite_lane": 2.0}
    ),
    "roach": Preset(roach_terms, {"speed": 1.0, "position": 1.0, "angle": 1.0, "steering": 0.1, "end": 1.0}),
}
