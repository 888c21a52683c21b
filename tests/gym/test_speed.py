"""Steps a second of the environment are counted over all environments, with the resets that its episodes need."""

from __future__ import annotations

import pytest

from caldrive.driving.settings import EnvSpeedSettings
from caldrive.gym import DrivingEnv
from caldrive.gym.speed import GENTLE, WARM_UP, measure_env
from tests.fakes import StraightRoad


def test_an_environment_alone_begins_anew_where_an_episode_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    resets, steps = [], []
    reset, step = DrivingEnv.reset, DrivingEnv.step

    def noted_reset(env: DrivingEnv, **options: object) -> object:
        resets.append(options)
        return reset(env, **options)  # type: ignore[arg-type]

    def noted_step(env: DrivingEnv, action: object) -> object:
        steps.append(action)
        observation, reward, terminated, _, info = step(env, action)
        return observation, reward, terminated, len(steps) % 10 == 0, info

    monkeypatch.setattr("caldrive.gym.env.make_world", lambda camera: StraightRoad())
    monkeypatch.setattr(DrivingEnv, "reset", noted_reset)
    monkeypatch.setattr(DrivingEnv, "step", noted_step)
    found = measure_env(EnvSpeedSettings(observation="affordances", task="straight", steps=30, seed=4))
    assert (found.environments, len(steps)) == (1, WARM_UP + 30)
    assert found.steps_per_second > 0
    assert (steps[0] == GENTLE).all()
    assert resets[0] == {"seed": 4}
    assert len(resets) == 1 + (WARM_UP + 30) // 10


def test_what_cannot_be_measured_is_said() -> None:
    with pytest.raises(ValueError, match="found --environments 0, wanted 1 to"):
        measure_env(EnvSpeedSettings(environments=0))
    with pytest.raises(ValueError, match=r"found task 'swim', wanted one of straight"):
        measure_env(EnvSpeedSettings(task="swim"))
