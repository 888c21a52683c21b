"""Settings of a training by reinforcement, its presets, and its curriculum: easy tasks first, the next one when most of
the last episodes reached their goal."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from caldrive.agents.reinforcement.config import Action, Sees
from caldrive.checks import MOST_SEED, MOST_WORKERS, Limits, require_limits

# What each number may be, from and to; a setting that is not here may be any number.
LIMITS: Limits = {
    "steps": (1, 1_000_000_000),
    "environments": (1, MOST_WORKERS),
    "rollout": (2, 1_000_000),
    "batch": (2, 1_000_000),
    "epochs": (1, 1000),
    "learning_rate": (1e-9, 1.0),
    "final_rate": (0.0, 1.0),
    "discount": (0.0, 1.0),
    "gae": (0.0, 1.0),
    "clip": (1e-9, 10.0),
    "entropy": (0.0, 10.0),
    "repeat": (1, 100),
    "hidden": (1, 10_000),
    "advance_at": (0.0, 1.0),
    "window": (1, 1_000_000),
    "save_every": (1, 1_000_000),
    "checkpoints": (1, 10_000),
    "seed": (0, MOST_SEED),
}


@dataclass(frozen=True)
class ReinforcementConfig:
    """How a policy learns: PPO (Schulman et al. 2017) in environments that run side by side."""

    steps: int = 1_000_000
    """Decisions to learn from, in all environments together."""
    sees: Sees = "affordances"
    """What the policy is given of the image: frames, two grey ones of 84 x 84 pixels; features of a frozen encoder; or
    affordances."""
    affordances: Literal["true", "predicted"] = "true"
    """Where it sees affordances, whether it learns from the true ones, without a camera, or from those of a network.
    At the wheel they are always a network's."""
    perception: Path | None = None
    """The network whose affordances it sees, a .safetensors file; without it the one in the package."""
    encoder: Path | None = None
    """The modular pipeline's network whose backbone is the frozen encoder, a .safetensors file; without it the one in
    the package."""
    action: Action = "continuous"
    """Throttle or brake, and steering, by Beta distributions; or the nine actions of the paper's RL."""
    repeat: int = 2
    """Steps of 0.1 s for which a decision holds."""
    memory: bool = True
    """Whether the policy is given its last decision."""
    hidden: int = 256
    """Nodes of a hidden layer."""
    reward: Literal["roach", "carla2017"] = "roach"
    """roach or carla2017."""
    towns: tuple[str, ...] = ("town01",)
    """An episode's town is one of them; town02 and generated towns that are there to judge are refused."""
    weathers: tuple[int, ...] = (1, 3, 6, 8)
    """Its weather is one of them."""
    tasks: tuple[str, ...] = ("straight", "one-turn", "navigation", "navigation-dynamic")
    """The curriculum: it begins with the first task and moves on to the next."""
    advance_at: float = 0.8
    """Share of goals reached in the present task's last episodes at which it moves on; 0 has all tasks from the first
    episode on. When its even share of all decisions is over it moves on in any case."""
    early_ends: bool = True
    """Whether an episode ends not only at a collision, but also at a red light, on the sidewalk and 2 m beside its
    route."""
    window: int = 50
    """Episodes that this share is taken over."""
    environments: int = 4
    """Environments that run side by side."""
    processes: bool = True
    """Whether each environment has a process of its own, which it needs where there is traffic."""
    rollout: int = 512
    """Decisions in each environment from one update of the policy to the next."""
    batch: int = 256
    """Decisions in a step of the gradient."""
    epochs: int = 5
    """Times that an update goes through its decisions."""
    learning_rate: float = 3e-4
    """Adam's."""
    final_rate: float = 0.1
    """Share of it that is left at the end of a straight line."""
    discount: float = 0.99
    """What a reward counts one decision later."""
    gae: float = 0.95
    """Lambda of the generalised advantage estimate."""
    clip: float = 0.2
    """By how much the ratio of an action's probabilities may change in an update."""
    entropy: float = 0.01
    """What the policy's entropy counts in the loss."""
    save_every: int = 10
    """Updates after which the state is saved, and all environments begin new episodes."""
    checkpoints: int = 10
    """Policies that are kept on the way, evenly spread."""
    device: str = "auto"
    """cpu, cuda, or auto for a GPU where there is one."""
    seed: int = 0
    """Decides everything random."""

    def __post_init__(self) -> None:
        require_limits(vars(self), LIMITS, vars(ReinforcementConfig))
        if self.towns != ReinforcementConfig.towns:
            from caldrive.scenarios import require_to_learn_from  # loads numpy, for which --help does not wait

            for town in self.towns:
                require_to_learn_from(town)
        if self.rollout * self.environments % self.batch:
            raise ValueError(
                f"found updates of {self.rollout * self.environments} decisions, wanted a multiple of the batch of "
                f"{self.batch}: type --rollout {self.batch}"
            )
        for name, sees in (("encoder", "features"), ("perception", "affordances")):
            if getattr(self, name) is not None and self.sees != sees:
                raise ValueError(
                    f"found --{name} {getattr(self, name)}, but a policy that sees {self.sees} has none: leave it out"
                )

    @property
    def update_steps(self) -> int:
        """Decisions from one update to the next."""
        return self.rollout * self.environments

    @property
    def updates(self) -> int:
        """Updates in all."""
        return -(-self.steps // self.update_steps)


REINFORCEMENTS = {
    # The CARLA paper's RL (supplement S.2.3) with PPO in place of A3C: its frames, network, actions, reward, ends,
    # weathers and entropy. It does not say which tasks it learnt from.
    "paper": ReinforcementConfig(
        steps=2_000_000,
        sees="frames",
        action="carla2017",
        repeat=1,
        memory=False,
        hidden=512,
        reward="carla2017",
        advance_at=0.0,
        early_ends=False,
        save_every=40,  # 1,024 s: town01's longest time limit is 315 s, and what is broken off counts nowhere
        rollout=256,
        epochs=4,
        learning_rate=2.5e-4,
        final_rate=0.0,
    ),
    # As one would today: a frozen encoder, throttle and steering at once, Roach's reward, a curriculum.
    "modern": ReinforcementConfig(steps=3_000_000, sees="features"),
    # The modern one on CAL's six numbers in place of an image: the true ones, or its network's.
    "affordances": ReinforcementConfig(),
    "predicted": ReinforcementConfig(affordances="predicted"),
}


@dataclass
class Curriculum:
    """Which tasks are driven now. Half of the episodes are of the newest task, the others of those before it.

    advance_at: share of goals at which the next task comes, 0 for all tasks at once; window: episodes that it is taken
    over. level: number of the newest task; recent: whether its last episodes reached their goal.
    """

    tasks: tuple[str, ...]
    advance_at: float
    window: int
    level: int = 0
    recent: list[bool] = field(default_factory=list)

    def __post_init__(self) -> None:
        if self.advance_at == 0:
            self.level = len(self.tasks) - 1

    def note(self, task: str, success: bool) -> bool:
        """Notes how an episode of a task ended; returns whether the next task comes now."""
        if task != self.tasks[self.level]:
            return False
        self.recent = [*self.recent, success][-self.window :]
        is_last = self.level == len(self.tasks) - 1
        if is_last or len(self.recent) < self.window or sum(self.recent) < self.advance_at * self.window:
            return False
        self.level, self.recent = self.level + 1, []
        return True

    def keep_up(self, share: float) -> bool:
        """Moves on where a share of all decisions is over and the newest task is not as new; returns whether it was
        so."""
        least = min(int(share * len(self.tasks)), len(self.tasks) - 1)
        if self.level >= least:
            return False
        self.level, self.recent = least, []
        return True

    def drawn(self) -> tuple[str, ...]:
        """The tasks from which an episode's is drawn evenly."""
        if self.advance_at == 0:
            return self.tasks
        return self.tasks[: self.level] + self.tasks[self.level : self.level + 1] * max(1, self.level)
