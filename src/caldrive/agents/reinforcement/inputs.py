"""What a policy is given of what an agent may see (image, speed and command), and its actions as the car takes them.
The same code in training and at the wheel."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from caldrive.agents.reinforcement.config import CARLA2017, FRAME, SIGNS, Action
from caldrive.compiled import Floats
from caldrive.datatypes import (
    KMH,
    MAX_CENTER_DISTANCE,
    MAX_VEHICLE_DISTANCE,
    Affordances,
    Command,
    Control,
    Image,
    Observation,
)
from caldrive.interfaces import Perception
from caldrive.perception.images import check_image

Inputs = dict[str, NDArray[Any]]  # numbers (F,), and for a policy with convolutions frames (2, H, W)
Encode = Callable[[Image], Floats]  # an image (H, W, 3) to features (F,)

USUAL_SPEED = 10.0  # m/s, a speed of 1 for the policy
CARLA2017_FASTEST = 30.0 * KMH  # m/s


class Eye(Protocol):
    """What a policy has of the image. remembers: whether it has to look at each step, also without a decision."""

    remembers: bool

    def reset(self) -> None:
        """Start an episode."""
        ...

    def watch(self, observation: Observation) -> None:
        """Look at the image of a step. Raises BadImage where it is no use."""
        ...

    def see(self, observation: Observation) -> Inputs:
        """The inputs for a decision, in a step that was watched."""
        ...


class AffordanceEye:
    """Sees the affordances that a perception finds: a network's, or in training the true ones."""

    remembers = True

    def __init__(self, perception: Perception) -> None:
        self.perception = perception
        self.affordances = Affordances()

    def reset(self) -> None:
        """Start an episode."""
        self.perception.reset()
        self.affordances = Affordances()

    def watch(self, observation: Observation) -> None:
        """The perception looks at each image, as it may have a memory. Raises BadImage."""
        self.affordances = self.perception.predict(observation)

    def see(self, observation: Observation) -> Inputs:
        """numbers (9,)."""
        return {"numbers": affordance_vector(self.affordances)}


class FrameEye:
    """Sees the last two frames, grey (the CARLA paper's supplement, S.2.3); at the start the first one twice."""

    remembers = False

    def __init__(self) -> None:
        self._frames: NDArray[np.uint8] | None = None

    def reset(self) -> None:
        """Start an episode."""
        self._frames = None

    def watch(self, observation: Observation) -> None:
        """Raises BadImage where the image is no square of 84 pixels, or black."""
        check_image(observation.image, (FRAME, FRAME))

    def see(self, observation: Observation) -> Inputs:
        """frames (2, 84, 84) in bytes, the newest last; no numbers (0,)."""
        grey = observation.image.mean(axis=2).astype(np.uint8)
        before = grey if self._frames is None else self._frames[-1]
        self._frames = np.stack((before, grey))
        return {"frames": self._frames, "numbers": np.empty(0, np.float32)}


class FeatureEye:
    """Sees the features of a frozen encoder."""

    remembers = False

    def __init__(self, encode: Encode, image_size: tuple[int, int]) -> None:
        self._encode, self._image_size = encode, image_size

    def reset(self) -> None:
        """Nothing to forget."""

    def watch(self, observation: Observation) -> None:
        """Raises BadImage where the image is of another size (H, W) than the encoder's, or black."""
        check_image(observation.image, self._image_size)

    def see(self, observation: Observation) -> Inputs:
        """numbers (F,)."""
        return {"numbers": self._encode(observation.image)}


class PolicyInputs:
    """The inputs of a policy through an episode. What it did last is seen only with `memory`, as the numbers of a car
    whose throttle and steering lag do not say it."""

    def __init__(self, eye: Eye, memory: bool) -> None:
        self.eye, self._memory = eye, memory
        self._last = Control()

    def reset(self) -> None:
        """Start an episode."""
        self.eye.reset()
        self._last = Control()

    def watch(self, observation: Observation) -> None:
        """Look at a step, whether or not it needs a decision. Raises BadImage where the image is no use."""
        self.eye.watch(observation)

    def see(self, observation: Observation) -> Inputs:
        """The inputs for a decision: what the eye sees, then speed, the last control and the command."""
        seen = self.eye.see(observation)
        last = (self._last.throttle - self._last.brake, self._last.steer) if self._memory else ()
        command = (float(observation.command is command) for command in Command)
        own = np.array((observation.speed / USUAL_SPEED, *last, *command), np.float32)
        return seen | {"numbers": np.concatenate((seen["numbers"], own))}

    def acted(self, control: Control) -> None:
        """Note what was decided."""
        self._last = control


def affordance_vector(affordances: Affordances) -> NDArray[np.float32]:
    """Hazard stop, red light, distance as a share of 50 m, angle in rad, centre distance as a share of 2 m, and the
    sign as ones and zeros: none, 30, 60, 90 (9,)."""
    numbers = (
        affordances.hazard_stop, affordances.red_light, affordances.vehicle_distance / MAX_VEHICLE_DISTANCE,
        affordances.relative_angle, affordances.center_distance / MAX_CENTER_DISTANCE,
        *(float(affordances.speed_sign == sign) for sign in SIGNS),
    )  # fmt: skip
    return np.clip(np.array(numbers, np.float32), -1.0, 1.0)


def control_of(kind: Action, action: Any, speed: float = 0.0) -> Control:
    """An action as a control: the number of one of CARLA2017, or throttle and steering, of which what lies outside
    [-1, 1] is cut. speed: the car's, m/s; the paper's RL has no throttle from 30 km/h on."""
    if kind == "carla2017":
        throttle, right = CARLA2017[int(action)]
        return _control(min(throttle, 0.0) if speed >= CARLA2017_FASTEST else throttle, -right)
    throttle, steer = np.clip(np.asarray(action, dtype=float), -1.0, 1.0).tolist()
    return _control(throttle, steer)


def _control(throttle: float, steer: float) -> Control:
    return Control(throttle=max(throttle, 0.0), brake=max(-throttle, 0.0), steer=steer)
