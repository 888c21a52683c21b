"""caldrive as a gymnasium environment."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import gymnasium

from caldrive.agents.reinforcement.inputs import control_of
from caldrive.datatypes import MAX_CENTER_DISTANCE, CameraConfig, Control, Observation, Truth
from caldrive.driving.referee import Referee
from caldrive.driving.rules import RULES
from caldrive.driving.setup import make_world
from caldrive.driving.tasks import task_scenarios
from caldrive.geometry import added_up
from caldrive.gym.config import EnvConfig, configured
from caldrive.gym.rewards import PRESETS, Transition
from caldrive.gym.spaces import action_space, observation_space, observed
from caldrive.interfaces import World
from caldrive.results import InfractionKind, Outcome
from caldrive.scenarios import Scenario

MOST_EPISODES = 2**31  # seeds
COLLISION_KEYS = {  # MetaDrive's names
    InfractionKind.COLLISION_CAR: "crash_vehicle",
    InfractionKind.COLLISION_PERSON: "crash_human",
    InfractionKind.COLLISION_OBJECT: "crash_object",
}


@dataclass
class _Drive:
    """An episode so far."""

    referee: Referee
    truth: Truth
    observation: Observation
    last: Control = field(default_factory=Control)
    """What was done before."""
    reward: float = 0.0
    """The sum."""
    length: int = 0
    """Actions."""
    left_route: bool = False
    """Whether this has ended it."""

    @property
    def has_ended(self) -> bool:
        """Whether there is nothing more to do."""
        return self.left_route or self.referee.outcome is not None


class DrivingEnv(gymnasium.Env[dict[str, Any], Any]):
    """An episode of a task in a town, from a seed: the same seed gives the same bytes.

    config: the settings; others by name change some of them, such as `weathers=(1,)`, and so does `reset`'s
    options={"config": {...}}. An episode is terminated at its goal or by an infraction of `EnvConfig.ends`, truncated
    by its time limit. Raises ValueError for settings that cannot be.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012 (gymnasium's own)

    def __init__(self, config: EnvConfig | None = None, render_mode: str | None = None, **changes: Any) -> None:
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"found render mode {render_mode!r}, wanted rgb_array: leave it out to draw nothing")
        self.config = configured(config or EnvConfig(), changes)
        self.render_mode = render_mode
        self.action_space = action_space(self.config)
        self.observation_space = observation_space(self.config)
        self._world: World | None = None
        self._drive: _Drive | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Starts an episode that follows from the seed, or from the last one's. options: {"config": {name: value}}
        changes settings from now on, {"scenario": Scenario} drives that one."""
        super().reset(seed=seed)
        options = options or {}
        if changes := options.get("config"):
            self._change(changes)
        scenario = options.get("scenario") or self._draw_scenario()
        world = self._open_world()
        observation = world.reset(scenario)
        referee = Referee(scenario, self.config.ends, RULES[self.config.rules])
        self._drive = _Drive(referee, world.truth(), observation)
        referee.watch(self._drive.truth)
        return observed(self.config, observation, self._drive.truth), self._info(self._drive)

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Drives on for `frame_skip` steps of 0.1 s, or until the episode ends."""
        drive, total = self._current, dict[str, float]()
        known = len(drive.referee.infractions)
        control = control_of(self.config.action, action, drive.observation.speed)
        for _ in range(self.config.frame_skip):
            observation = self._move(drive, control, total)
            if drive.has_ended:
                break
        reward, outcome = added_up(total.values()), drive.referee.outcome
        drive.reward += reward
        drive.length += 1
        cost = float(len(drive.referee.infractions) - known)
        info = self._info(drive) | {"rewards": total, "step_reward": reward, "cost": cost}
        terminated = outcome in (Outcome.SUCCESS, Outcome.FAILED) or drive.left_route
        truncated = outcome is Outcome.TIMEOUT and not terminated
        return observed(self.config, observation, drive.truth), reward, terminated, truncated, info

    def draw(self, draws: bool) -> None:
        """Whether the next steps have an image, a black pixel else: for a learner that does not look at each."""
        world: Any = self._open_world()
        world.mount = self._camera if draws else None

    def look(self) -> None:
        """Draws the image of the last step, which had none."""
        if self._camera is not None:
            self.draw(True)
            world: Any = self._open_world()
            drive = self._current
            drive.observation = replace(drive.observation, image=world.images([self._camera])[0])

    def drive_on(self, control: Control) -> bool:
        """A step with a control of somebody else's, without a reward; returns whether the episode has ended."""
        self._move(self._current, control, {})
        return self._current.has_ended

    def render(self) -> Any:
        """The image of the last step (H, W, 3), None without a render mode."""
        return self._current.observation.image.copy() if self.render_mode is not None else None

    @property
    def observation(self) -> Observation:
        """What an agent may see now, as outside of gymnasium. Raises RuntimeError before the first episode."""
        return self._current.observation

    def truth(self) -> Truth:
        """What really is, now: no agent under test may know it. Raises RuntimeError before the first episode."""
        return self._current.truth

    def close(self) -> None:
        """Ends the world."""
        if self._world is not None:
            self._world.close()
        self._world = self._drive = None

    def _move(self, drive: _Drive, control: Control, total: dict[str, float]) -> Observation:
        """One step of the world; adds its reward's terms to the total."""
        before = drive.truth
        observation = self._open_world().step(control)
        drive.truth, drive.observation = self._open_world().truth(), observation
        broke = drive.referee.watch(drive.truth) is Outcome.FAILED
        aside = abs(drive.truth.affordances.center_distance)
        drive.left_route = self.config.leaves_route and aside >= MAX_CENTER_DISTANCE
        transition = Transition(before, drive.truth, drive.last, control, broke or drive.left_route)
        for name, value in PRESETS[self.config.reward].rewards(transition, self.config.weights).items():
            total[name] = total.get(name, 0.0) + value
        drive.last = control
        return observation

    def _change(self, changes: dict[str, Any]) -> None:
        """Other settings from now on; the spaces stay. Raises ValueError where they would not."""
        config = configured(self.config, changes)
        if observation_space(config) != self.observation_space or action_space(config) != self.action_space:
            raise ValueError("found settings of other spaces at reset, wanted the same: make another environment")
        self.config = config

    def _draw_scenario(self) -> Scenario:
        """One of those that the settings allow."""
        config, rng = self.config, self.np_random
        town, weather, task = (
            choices[int(rng.integers(len(choices)))] for choices in (config.towns, config.weathers, config.tasks)
        )
        scenarios = task_scenarios(
            str(town), str(task), int(weather), cars=config.cars, people=config.people,
            seed=int(rng.integers(MOST_EPISODES)), time_limit=config.time_limit,
        )  # fmt: skip
        return scenarios[int(rng.integers(len(scenarios)))]

    @property
    def _current(self) -> _Drive:
        if self._drive is None:
            raise RuntimeError("found an environment before its first episode, wanted one: call reset()")
        return self._drive

    def _open_world(self) -> World:
        if self._world is None:
            self._world = make_world(camera=self._camera)
        return self._world

    @property
    def _camera(self) -> CameraConfig | None:
        """The one that is looked through, if anybody does."""
        draws = self.config.observation == "image" or self.render_mode is not None
        return self.config.camera if draws else None

    @staticmethod
    def _info(drive: _Drive) -> dict[str, Any]:
        """MetaDrive's keys where they apply, and our own."""
        truth, outcome, scenario = drive.truth, drive.referee.outcome, drive.referee.scenario
        return _broken(drive.referee) | {
            "is_success": outcome is Outcome.SUCCESS,
            "arrive_dest": outcome is Outcome.SUCCESS,
            "max_step": outcome is Outcome.TIMEOUT,
            "left_route": drive.left_route,
            "out_of_road": truth.sidewalk_share > 0,
            "route_completion": min(1.0, max(0.0, truth.route_done / truth.route_length)),
            "speed": truth.ego.speed,
            "episode_reward": drive.reward,
            "episode_length": drive.length,
            "env_seed": scenario.seed,
            "town": scenario.town,
            "weather": scenario.weather,
            "task": scenario.task,
        }


def _broken(referee: Referee) -> dict[str, Any]:
    """What has been broken in an episode so far."""
    kinds = [infraction.kind for infraction in referee.infractions]
    return {
        **{key: kind in kinds for kind, key in COLLISION_KEYS.items()},
        "crash": any(kind in COLLISION_KEYS for kind in kinds),
        "crash_sidewalk": InfractionKind.SIDEWALK in kinds,
        "red_light": InfractionKind.RED_LIGHT in kinds,
        "infractions": [kind.value for kind in kinds],
    }
