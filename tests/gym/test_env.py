"""The environment keeps gymnasium's contract, gives the same bytes for a seed, and ends as the field means it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import caldrive.gym
from caldrive.agents.reinforcement.config import CARLA2017, N_COMMANDS
from caldrive.agents.reinforcement.inputs import control_of
from caldrive.datatypes import CameraConfig, Command, Control, Pose
from caldrive.driving.referee import Referee
from caldrive.gym import DrivingEnv, EnvConfig
from caldrive.gym.env import _broken
from caldrive.results import Infraction, InfractionKind
from caldrive.scenarios import Scenario
from tests.fakes import StraightRoad

SMALL = CameraConfig(width=40, height=18)
FULL_GAS = np.array([1.0, 0.0], np.float32)
ROAD = Scenario(town="road", weather=1, start=Pose(0, 0, 0), goal=Pose(60, 0, 0), time_limit=20.0)


@pytest.fixture
def road(monkeypatch: pytest.MonkeyPatch) -> Iterator[DrivingEnv]:
    """An environment on a straight road."""
    monkeypatch.setattr("caldrive.gym.env.make_world", lambda camera: StraightRoad())
    env = DrivingEnv(observation="affordances")
    yield env
    env.close()


def drive(env: DrivingEnv, action: Any, options: dict[str, Any]) -> tuple[bool, bool, dict[str, Any]]:
    """How an episode ends."""
    env.reset(seed=0, options=options)
    for _ in range(400):
        _, _, terminated, truncated, info = env.step(action)
        if terminated or truncated:
            return terminated, truncated, info
    raise AssertionError("it has no end")


@pytest.mark.filterwarnings("ignore:.*render.*")
@pytest.mark.parametrize("settings", [{"observation": "affordances"}, {"camera": SMALL}, {"action": "carla2017"}])
def test_it_keeps_gymnasiums_contract(settings: dict[str, Any]) -> None:
    env = DrivingEnv(EnvConfig(camera=SMALL), **settings)
    check_env(env, skip_render_check=True)


def test_a_seed_gives_the_same_bytes_and_another_seed_another_episode() -> None:
    def episode(seed: int) -> list[bytes]:
        env = DrivingEnv(camera=SMALL, tasks=("navigation-dynamic",), cars=3, people=5)
        observation, _ = env.reset(seed=seed)
        seen = [observation["image"].tobytes()]
        for k in range(15):
            observation, reward, *_ = env.step(np.array([0.7, 0.05 * (k % 3)], np.float32))
            seen += [observation["image"].tobytes(), np.float64(reward).tobytes(), observation["speed"].tobytes()]
        env.close()
        return seen

    first = episode(5)
    assert episode(5) == first
    assert episode(6) != first


def test_the_goal_terminates_with_success(road: DrivingEnv) -> None:
    terminated, truncated, info = drive(road, FULL_GAS, {"scenario": ROAD})
    assert (terminated, truncated) == (True, False)
    assert info["is_success"]
    assert info["arrive_dest"]
    assert info["route_completion"] > 0.9


def test_the_time_limit_truncates(road: DrivingEnv) -> None:
    terminated, truncated, info = drive(road, np.zeros(2, np.float32), {"scenario": ROAD})
    assert (terminated, truncated) == (False, True)
    assert info["max_step"]
    assert not info["is_success"]
    assert info["episode_length"] == pytest.approx(200, abs=2)


def test_only_what_the_settings_name_terminates() -> None:
    def ends(**settings: Any) -> tuple[bool, bool, dict[str, Any]]:
        env = DrivingEnv(observation="affordances", tasks=("straight",), **settings)
        end = drive(env, np.array([0.6, 0.4], np.float32), {})
        env.close()
        return end

    terminated, _, info = ends()
    assert terminated
    assert info["crash"] or info["crash_sidewalk"]
    assert info["rewards"]["end"] < 0
    assert info["cost"] >= 1
    _, truncated, info = ends(ends=(InfractionKind.RED_LIGHT,), frame_skip=5)
    assert truncated
    assert info["infractions"]
    assert info["cost"] == 0  # nothing more in the last action


def test_the_info_says_which_episode_it_is_and_what_was_broken(road: DrivingEnv) -> None:
    _, info = road.reset(options={"scenario": replace(ROAD, seed=5)})
    assert (info["env_seed"], info["red_light"], info["infractions"]) == (5, False, [])
    referee = SimpleNamespace(infractions=[Infraction(InfractionKind.RED_LIGHT, time=1.0, x=0.0, y=0.0)])
    found = _broken(cast(Referee, referee))
    assert found["red_light"]
    assert not found["crash"]


def test_an_action_holds_for_some_steps_and_their_rewards_add_up(road: DrivingEnv) -> None:
    long = DrivingEnv(observation="affordances", frame_skip=4)
    for env in (road, long):
        env.reset(seed=0, options={"scenario": ROAD})
    short = [road.step(FULL_GAS) for _ in range(4)]
    observation, reward, *_ = long.step(FULL_GAS)
    assert reward == pytest.approx(sum(step[1] for step in short))
    assert observation["speed"] == pytest.approx(short[-1][0]["speed"])


def test_settings_may_change_at_reset_but_the_spaces_may_not(road: DrivingEnv) -> None:
    road.reset(seed=0, options={"scenario": ROAD, "config": {"reward": "carla2017"}})
    assert set(road.step(FULL_GAS)[4]["rewards"]) >= {"distance", "damage"}
    with pytest.raises(ValueError, match="other spaces"):
        road.reset(options={"config": {"action": "carla2017"}})


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"weather": (1,)}, "did you mean weathers"),
        ({"reward": "roch"}, "did you mean roach"),
        ({"rules": "stricter"}, "did you mean strict"),
        ({"weights": {"speeed": 1.0}}, "did you mean speed"),
        ({"tasks": ("swim",)}, "wanted one of straight"),
        ({"towns": ()}, "give some"),
        ({"render_mode": "human"}, "wanted rgb_array"),
        ({"towns": ("town02",)}, "found town02 to learn from, wanted another"),
    ],
)
def test_a_setting_that_cannot_be_is_said_in_one_sentence(settings: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        DrivingEnv(**settings)


def test_a_step_before_the_first_reset_is_refused() -> None:
    with pytest.raises(RuntimeError, match="call reset"):
        DrivingEnv().step(FULL_GAS)


def test_the_papers_nine_actions_never_steer_and_drive_at_once() -> None:
    controls = [control_of("carla2017", k) for k in range(len(CARLA2017))]
    assert all(control.steer == 0 or control.throttle == control.brake == 0 for control in controls)
    assert controls[1] == Control(brake=1.0)
    assert controls[5].steer == 1.0  # -1 is to the left


def test_an_action_beyond_its_bounds_is_cut() -> None:
    assert control_of("continuous", [-3.0, 2.0]) == Control(brake=1.0, steer=1.0)


def test_the_command_is_seen(monkeypatch: pytest.MonkeyPatch, road: DrivingEnv) -> None:
    monkeypatch.setattr("caldrive.gym.env.make_world", lambda camera: StraightRoad(command=Command.LEFT))
    observation, _ = road.reset(options={"scenario": ROAD})
    assert tuple(Command)[int(np.argmax(observation["command"]))] is Command.LEFT
    assert len(observation["command"]) == N_COMMANDS == len(Command)


def test_registered_environments_are_made_by_their_ids_and_draw_what_they_see() -> None:
    caldrive.gym.register()
    caldrive.gym.register()
    env = gymnasium.make("caldrive/Town01-v0", render_mode="rgb_array", camera=SMALL)
    observation, _ = env.reset(seed=1)
    picture = env.render()
    assert isinstance(picture, np.ndarray)
    assert (picture == observation["image"]).all()
    env.close()
