"""A short training on the straight road of `tests.fakes`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

import caldrive.gym.env
from caldrive.agents.reinforcement.encoder import Encoder
from caldrive.datatypes import CameraConfig, Image, Observation, Pose
from caldrive.reinforcement.config import ReinforcementConfig
from caldrive.reinforcement.environment import LearningEnv, make_learning_env
from caldrive.scenarios import Scenario
from tests.fakes import StraightRoad

ROAD = Scenario(town="road", weather=1, start=Pose(0, 0, 0), goal=Pose(40, 0, 0), time_limit=20.0)
SHORT = ReinforcementConfig(
    steps=128, environments=2, processes=False, rollout=16, batch=16, epochs=2, hidden=16, save_every=2, window=3,
    checkpoints=2, device="cpu",
)  # fmt: skip


class SeenRoad(StraightRoad):
    """A straight road whose image says how fast it is driven, in the camera's size."""

    mount: CameraConfig | None = None
    drawn = 0

    def images(self, mounts: Sequence[CameraConfig]) -> list[Image]:
        self.drawn += len(mounts)
        return [self._picture(mount.height, mount.width) for mount in mounts]

    def _observation(self) -> Observation:
        image = self.images([self.mount])[0] if self.mount else np.zeros((1, 1, 3), np.uint8)
        return replace(super()._observation(), image=image)

    def _picture(self, height: int, width: int) -> Image:
        image = np.full((height, width, 3), min(255, 40 + int(20 * self.ego.speed)), np.uint8)
        image[::2] //= 2
        return image


@pytest.fixture
def straight_road(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every environment is this road, with a goal that is nearer than a training's routes."""

    def make_road(camera: CameraConfig | None) -> SeenRoad:
        road = SeenRoad(light=20.0)
        road.mount = camera
        return road

    monkeypatch.setattr(caldrive.gym.env, "make_world", make_road)
    monkeypatch.setattr(caldrive.gym.env.DrivingEnv, "_draw_scenario", _drawn)


def _drawn(env: caldrive.gym.env.DrivingEnv) -> Scenario:
    """A goal by chance, and the task's name."""
    task = env.config.tasks[int(env.np_random.integers(len(env.config.tasks)))]
    return replace(ROAD, goal=Pose(float(env.np_random.uniform(20, 60)), 0, 0), task=task)


def make_env(config: ReinforcementConfig, encoder: Encoder | None = None) -> LearningEnv:
    return make_learning_env(config, encoder)
