"""The modular pipeline as an agent: it sees, plans, and follows its waypoints (S.2.1 of the CARLA paper).

It is told its speed and the command, and nothing of the world, the map or the route. The paper's drives at 20 km/h and
heeds neither lights nor signs; so does this one. It stops where the summed probability of what moves, in the corridor
that the car is about to drive through, is too much.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from caldrive.agents.modular_pipeline.ground import GroundGrid, GroundView
from caldrive.agents.modular_pipeline.planner import Memory, Plan, State, plan, seen_from
from caldrive.agents.modular_pipeline.pursuit import PursuitState, motion, pursue, wheel_angle
from caldrive.agents.modular_pipeline.scene import SceneClass, Segmenter
from caldrive.datatypes import CameraConfig, Control, Decision, Observation, Points
from caldrive.interfaces import BadImage

CRUISE = 20.0  # km/h
TURN_SPEED = {State.LEFT_TURN: 14.0, State.RIGHT_TURN: 12.0}  # km/h
STOP = Control(brake=1.0)
HALF_WIDTH = 1.1  # m, of the corridor in which somebody is in the way; the car is 1.8 m wide
BUMPER = 2.1  # m ahead of the car's centre
DECELERATION, REACTION, MARGIN = 4.0, 0.5, 6.5  # m/s², s, and m that are left in front of the bumper
STEP = 0.25  # m between two places of the corridor
ACROSS = np.arange(-HALF_WIDTH + STEP / 2, HALF_WIDTH, STEP)
UNSURE = 0.3  # probability below which a place does not count: little by little a whole street would add up
THRESHOLD = 0.4  # m² of things that move
AUXILIARY_YAW = math.radians(50)  # to the left: what the front camera does not see, and a little of what it does


def auxiliary_camera(front: CameraConfig) -> CameraConfig:
    """The second camera, which looks to the left for the lane that a left turn leads into."""
    return replace(front, yaw=AUXILIARY_YAW)


@dataclass(frozen=True)
class Sensed:
    """What one step went by, for those who look on."""

    grid: GroundGrid
    plan: Plan


class ModularPipelineAgent:
    """Perception, planner and PID (`interfaces.Agent`). camera: of the observations; size: (H, W) of the segmenter's
    classes; dt: s of a step; cap: km/h that are not exceeded; auxiliary: whether there is a second camera.

    decision: the reasons for the last control, None before the first. sensed: what it went by.
    """

    def __init__(
        self, segmenter: Segmenter, camera: CameraConfig, size: tuple[int, int], dt: float, cap: float | None = None,
        *, auxiliary: bool = False,
    ) -> None:  # fmt: skip
        self.segmenter, self.dt = segmenter, dt
        self.cruise = CRUISE if cap is None else min(CRUISE, cap)
        self._view = GroundView([camera], size)
        self._wide_view = GroundView([camera, auxiliary_camera(camera)], size) if auxiliary else None
        self.reset()

    def reset(self) -> None:
        """Start an episode."""
        self.decision: Decision | None = None
        self.sensed: Sensed | None = None
        self._memory, self._pursuit, self._angle, self._steer = Memory(), PursuitState(), 0.0, 0.0

    def act(self, observation: Observation) -> Control:
        """The control for this observation; where an image is no use, the brake, and the reason in the note."""
        self._angle = wheel_angle(self._angle, self._steer, self.dt)
        moved = motion(observation.speed, self._angle, self.dt)
        try:
            grid, junction = self._see(observation)
        except BadImage as error:
            self._memory = seen_from(self._memory, moved)
            self.decision = Decision(replace(STOP, steer=self._steer), note=str(error))
            return self.decision.control
        found = plan(grid, junction, observation.command, moved, self._memory)
        self._memory, self.sensed = found.memory, Sensed(grid, found)
        self.decision = self._decide(self.sensed, observation.speed)
        self._steer = self.decision.control.steer
        return self.decision.control

    def _see(self, observation: Observation) -> tuple[GroundGrid, float]:
        """The ground, and the probability of a junction. The second camera is looked at in left turns only."""
        front = self.segmenter.segment(observation.image)
        if self._wide_view is None or self._memory.state is not State.LEFT_TURN:
            return self._view.grid([front.classes]), front.junction
        if observation.auxiliary is None:
            raise BadImage("there is no image of the second camera: brake, and look at the camera")
        aside = self.segmenter.segment(observation.auxiliary)
        return self._wide_view.grid([front.classes, aside.classes]), front.junction

    def _decide(self, sensed: Sensed, speed: float) -> Decision:
        """The control along the waypoints, or the brake where somebody is in the way."""
        state, waypoints = sensed.plan.state, sensed.plan.waypoints
        area = moving_area(sensed.grid, waypoints, speed)
        target = min(self.cruise, TURN_SPEED.get(state, CRUISE))
        self._pursuit, control = pursue(waypoints, speed, target, self._pursuit, self.dt)
        if area > THRESHOLD:
            state, target, control = State.HAZARD_STOP, 0.0, replace(STOP, steer=control.steer)
            self._pursuit = PursuitState(self._pursuit.steering)
        note = f"{area:.1f} m² in the way" if area > THRESHOLD else ""
        return Decision(control, state=state.value, target_speed=target, note=note)


def stopping_distance(speed: float) -> float:
    """m from the bumper to where a car comes to stand, v² / 2a + v t, and a margin; speed in m/s."""
    return speed * speed / (2 * DECELERATION) + speed * REACTION + MARGIN


def corridor(waypoints: Points, length: float) -> Points:
    """Places (N, M, 2) across the way along waypoints (K, 2), from the car's centre on up to so many m along it."""
    line = np.concatenate(([(0.0, 0.0)], waypoints[waypoints[:, 0] > 0.0]))
    s = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))))
    at = np.arange(0.0, min(length, s[-1]), STEP)
    x, y = (np.interp(at, s, line[:, k]) for k in (0, 1))
    if len(at) < 2:
        return np.zeros((0, len(ACROSS), 2))
    heading = np.arctan2(np.gradient(y), np.gradient(x))
    return np.stack(
        (x[:, None] - ACROSS * np.sin(heading)[:, None], y[:, None] + ACROSS * np.cos(heading)[:, None]), axis=-1
    )


def moving_area(grid: GroundGrid, waypoints: Points, speed: float) -> float:
    """m² of the corridor up to the stopping distance that cars and people take up, each place by its probability."""
    classes, _ = grid.at(corridor(waypoints, BUMPER + stopping_distance(speed)))
    moving = classes[..., SceneClass.DYNAMIC]
    return float(moving[moving > UNSURE].sum()) * STEP * STEP
