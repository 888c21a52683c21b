"""How a policy is built: what it sees, and what it does. Apart from its network, so that --help is quick."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Sees = Literal["frames", "features", "affordances"]
Action = Literal["continuous", "carla2017"]

N_COMMANDS = 3
SIGNS = (None, 30, 60, 90)  # km/h
N_AFFORDANCES = 5 + len(SIGNS)  # numbers that say them
FRAME, N_FRAMES = 84, 2  # pixels a side of the paper's grey frames, and how many there are
# The paper's RL, (throttle, steering to the right): never both; below 0 the throttle brakes.
CARLA2017 = ((0, 0), (-1, 0), (-0.5, 0), (0.5, 0), (1, 0), (0, -1), (0, -0.5), (0, 0.5), (0, 1))
N_CONTINUOUS = 2  # throttle (below 0 the brake), and steering (+ to the left)


@dataclass(frozen=True)
class PolicyConfig:
    """A policy. The header of its file keeps it."""

    sees: Sees = "affordances"
    """Two grey frames of 84 x 84 pixels through convolutions of its own, the features of a frozen encoder, or
    affordances."""
    action: Action = "continuous"
    """Throttle or brake, and steering; or the nine actions of the paper's RL."""
    repeat: int = 2
    """Steps of 0.1 s for which a decision holds."""
    memory: bool = True
    """Whether it is given its last decision."""
    hidden: int = 256
    """Nodes of a hidden layer."""
    n_features: int = 0
    """Of the encoder."""

    @property
    def n_own(self) -> int:
        """How many numbers are its speed, its last decision and the command."""
        return 1 + N_CONTINUOUS * self.memory + N_COMMANDS

    @property
    def n_numbers(self) -> int:
        """How many numbers it is given: what it sees, and its own behind them."""
        seen = {"frames": 0, "features": self.n_features, "affordances": N_AFFORDANCES}
        return seen[self.sees] + self.n_own

    @property
    def n_outputs(self) -> int:
        """Parameters of its distribution."""
        return len(CARLA2017) if self.action == "carla2017" else 2 * N_CONTINUOUS
