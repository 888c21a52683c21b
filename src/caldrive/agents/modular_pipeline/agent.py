"""The modular pipeline as an agent: it sees, plans, and follows its waypoints (S.2.1 of the CARLA paper).

It is told its speed and the command, and nothing of the world, the map or the route. The paper's drives at 20 km/h and
heeds neither lights nor signs; so does this one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from caldrive.agents.modular_pipeline.ground import GroundGrid, GroundView
from caldrive.agents.modular_pipeline.hazard import THRESHOLD, moving_area
from caldrive.agents.modular_pipeline.odometry import motion, wheel_angle
from caldrive.agents.modular_pipeline.planner import Memory, Plan, State, plan
from caldrive.agents.modular_pipeline.pursuit import PursuitState, pursue
from caldrive.agents.modular_pipeline.scene import Segmenter
from caldrive.datatypes import CameraConfig, Control, Decision, Observation
from caldrive.interfaces import BadImage

CRUISE = 20.0  # km/h
TURN_SPEED = {State.LEFT_TURN: 14.0, State.RIGHT_TURN: 12.0}  # km/h
STOP = Control(brake=1.0)
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
