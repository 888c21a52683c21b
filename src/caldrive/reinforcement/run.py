"""A training under way: environments, the policy, and its updates.

What an update draws depends on (seed, update) only, and after every `save_every` updates all environments begin new
episodes: a run that is killed anywhere resumes to the same weights.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from statistics import fmean
from typing import Any

import gymnasium
import numpy as np

try:
    from stable_baselines3 import PPO
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.logger import Logger
    from stable_baselines3.common.utils import set_random_seed
    from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecNormalize
except ModuleNotFoundError as error:
    raise ModuleNotFoundError("found no stable-baselines3, wanted it: type pip install 'caldrive[rl]'") from error

from caldrive.agents.reinforcement.config import PolicyConfig
from caldrive.reinforcement.config import Curriculum, ReinforcementConfig
from caldrive.reinforcement.policy import LearningPolicy

Row = dict[str, int | float]  # an update's metrics
LATER = 10**9  # updates, after which stable-baselines3 would print its figures
MakeEnv = Callable[[], gymnasium.Env[Any, Any]]


@dataclass(frozen=True)
class Ended:
    """How an episode went: its task, whether it reached its goal, the sum of its rewards, its steps of 0.1 s, and the
    share of its route that it drove."""

    task: str
    success: bool
    reward: float
    length: int
    completion: float


class LearningRun:
    """PPO on the environments of a configuration.

    make_env: makes an environment, in its process, or here. update: how many were done. curriculum: what is driven now.
    Raises RuntimeError where an environment's process dies.
    """

    def __init__(self, config: ReinforcementConfig, policy: PolicyConfig, make_env: MakeEnv) -> None:
        self.config, self.policy, self.update = config, policy, 0
        self.curriculum = Curriculum(config.tasks, config.advance_at, config.window)
        makers = [make_env] * config.environments
        with _living_processes():
            several = SubprocVecEnv(makers, start_method="forkserver") if config.processes else DummyVecEnv(makers)
        self.env = VecNormalize(several, norm_obs=False, gamma=config.discount)
        kind: Any = LearningPolicy  # which has all that PPO asks of a policy
        self.model = PPO(
            kind, self.env, learning_rate=lambda _: self.rate, n_steps=config.rollout,
            batch_size=config.batch, n_epochs=config.epochs, gamma=config.discount, gae_lambda=config.gae,
            clip_range=config.clip, ent_coef=config.entropy, policy_kwargs={"config": policy}, device=config.device,
            seed=derived_seed(config.seed, 0, "weights"),
        )  # fmt: skip
        self.model.set_logger(Logger(None, []))

    @property
    def learning_policy(self) -> LearningPolicy:
        """The policy and its value, with their optimizer."""
        policy: Any = self.model.policy
        assert isinstance(policy, LearningPolicy)
        return policy

    @property
    def steps(self) -> int:
        """Decisions that it learnt from."""
        return self.update * self.config.update_steps

    @property
    def rate(self) -> float:
        """The learning rate of the update that is next."""
        share = 1 - (1 - self.config.final_rate) * self.update / self.config.updates
        return self.config.learning_rate * share

    @property
    def at_save_point(self) -> bool:
        """Whether the next update begins with new episodes, so that the run may be saved now."""
        return self.update % self.config.save_every == 0

    def advance(self) -> Row:
        """One update; returns its metrics."""
        notes = _Notes(self.env)
        with _living_processes():
            if self.at_save_point:
                self._begin_episodes()
            set_random_seed(derived_seed(self.config.seed, self.update, "actions"))
            self.model.learn(self.config.update_steps, notes, log_interval=LATER, reset_num_timesteps=False)
            self.update += 1
            self._follow_curriculum(notes.ended)
        logged = self.model.logger.name_to_value
        return {"step": self.steps, **self._figures(notes), **_losses(logged)}

    def close(self) -> None:
        """Ends the environments and their processes."""
        several: Any = self.env.venv
        processes = getattr(several, "processes", [])
        if not getattr(several, "waiting", False) and all(process.is_alive() for process in processes):
            self.env.close()
            return
        for process in processes:  # one has died, or was interrupted: to wait for its answer may take for ever
            process.terminate()
            process.join()

    def _follow_curriculum(self, ended: Sequence[Ended]) -> None:
        """The next task where it is time for it. ended: the episodes of an update."""
        moves_on = [self.curriculum.note(one.task, one.success) for one in ended]
        if any(moves_on) | self.curriculum.keep_up(self.update / self.config.updates):
            self._set_tasks()

    def _begin_episodes(self) -> None:
        """New episodes in all environments, from seeds that follow from the update."""
        self._set_tasks()
        self.env.seed(derived_seed(self.config.seed, self.update, "episodes"))
        self.model.set_env(self.env, force_reset=True)

    def _set_tasks(self) -> None:
        self.env.set_attr("tasks", self.curriculum.drawn())

    def _figures(self, notes: _Notes) -> Row:
        """Means over what ended in an update; nothing where nothing did."""
        figures: Row = {"reward_per_step": fmean(notes.rewards), "level": self.curriculum.level}
        figures["episodes"] = len(notes.ended)
        if notes.ended:
            for name in ("reward", "length", "completion"):
                figures[name] = fmean(getattr(ended, name) for ended in notes.ended)
        for task in dict.fromkeys(ended.task for ended in notes.ended):
            figures[f"success/{task}"] = fmean(ended.success for ended in notes.ended if ended.task == task)
        return figures


@contextmanager
def _living_processes() -> Iterator[None]:
    """Raises RuntimeError where an environment's process dies meanwhile."""
    try:
        yield
    except (EOFError, ConnectionError) as error:
        raise RuntimeError(
            "found that the process of an environment has died, wanted all of them: see above what it said, and type "
            "the same again to go on"
        ) from error


class _Notes(BaseCallback):
    """Notes rewards and ended episodes while decisions are collected."""

    def __init__(self, env: VecNormalize) -> None:
        super().__init__()
        self._env = env
        self.ended: list[Ended] = []
        self.rewards: list[float] = []

    def _on_step(self) -> bool:
        self.rewards.append(float(np.mean(self._env.get_original_reward())))
        each = zip(self.locals["dones"], self.locals["infos"], strict=True)
        self.ended += [_ended(info) for done, info in each if done]
        return True


def _ended(info: dict[str, Any]) -> Ended:
    """How an episode went, by what `DrivingEnv` says of its last step."""
    return Ended(
        info["task"], info["is_success"], info["episode_reward"], info["episode_length"], info["route_completion"]
    )


def _losses(logged: dict[str, Any]) -> Row:
    """What PPO logged of an update, by our names."""
    names = {
        "loss": "loss", "value_loss": "value_loss", "entropy": "entropy_loss", "kl": "approx_kl",
        "clipped": "clip_fraction", "explained_variance": "explained_variance",
    }  # fmt: skip
    losses = {name: float(logged[f"train/{theirs}"]) for name, theirs in names.items()}
    return losses | {"entropy": -losses["entropy"]}


def derived_seed(seed: int, update: int, purpose: str) -> int:
    """A seed for a purpose in an update, that follows from the run's."""
    purposes = ("weights", "actions", "episodes")
    state = np.random.SeedSequence((seed, update, purposes.index(purpose))).generate_state(1)
    return int(state[0]) % 2**31
