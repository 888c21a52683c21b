"""The imitation agent at the wheel: the network's outputs are the control, but for a few rules of its authors'."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch

from caldrive.agents.conditional_imitation.checkpoint import ImitationInfo, load_imitation
from caldrive.agents.conditional_imitation.engine import image_engine
from caldrive.agents.conditional_imitation.network import ImitationNetwork
from caldrive.datatypes import KMH, Control, Decision, Observation
from caldrive.interfaces import BadImage
from caldrive.perception.images import check_image
from caldrive.perception.inference.precision import driving_precision
from caldrive.perception.network.network import COMMANDS

STOP = Control(brake=1.0)


@dataclass(frozen=True)
class WheelRules:
    """The rules of the released agent (its `imitation_learning.py`)."""

    least_brake: float = 0.1
    """Of the brake, below which there is none."""
    top_speed: float = 10.0
    """m/s, above which there is no throttle."""
    standing: float = 2.0
    """m/s, slower than which the car may be stuck (forced-stop fix)."""
    driving: float = 3.0
    """m/s that the image must suggest for that."""
    target: float = 5.6
    """m/s towards which the throttle then grows, in 25 m/s: 20 km/h."""
    scale: float = 25.0
    """m/s."""


def rules_for(cap: float | None) -> WheelRules:
    """The rules where no speed may exceed a cap in km/h: above it there is no throttle."""
    rules = WheelRules()
    return rules if cap is None else replace(rules, top_speed=min(rules.top_speed, cap * KMH))


def wheel_control(
    steer: float, throttle: float, brake: float, speed: float, rules: WheelRules, seen_speed: float | None = None
) -> Control:
    """A network's outputs as a control. speed: m/s; seen_speed: what the image suggests, m/s, where a car that stands
    without a reason is to move on (the forced-stop fix).

    1. A slight brake is none, and none brakes who wants to go faster more than slower.
    2. Nobody speeds up above 10 m/s.
    3. A car that stands where the image shows a moving one lets go of the brake and speeds up.
    """
    steer, throttle, brake = np.clip((steer, throttle, brake), (-1, 0, 0), 1).tolist()
    if brake < rules.least_brake or throttle > brake:
        brake = 0.0
    if speed > rules.top_speed and brake == 0:
        throttle = 0.0
    if seen_speed is not None and speed < rules.standing and seen_speed > rules.driving:
        throttle, brake = min(1.0, throttle + (rules.target - speed) / rules.scale), 0.0
    return Control(throttle=throttle, brake=brake, steer=steer)


class ImitationAgent:
    """Drives by an imitation network (`interfaces.Agent`). avoid_stopping: with the forced-stop fix.

    decision: the last control, with a note where the image was no use.
    """

    def __init__(
        self, network: ImitationNetwork | Path, rules: WheelRules | None = None, *, avoid_stopping: bool = False,
        threads: int = 1,
    ) -> None:  # fmt: skip
        info = ImitationInfo(network.config) if isinstance(network, ImitationNetwork) else None
        if not isinstance(network, ImitationNetwork):
            network, info = load_imitation(network)
        assert info is not None
        self.network = network.eval()
        self._look = image_engine(network, driving_precision("auto", info.ranges), info.ranges, threads)
        self.rules, self.avoid_stopping = rules or WheelRules(), avoid_stopping
        self.decision: Decision | None = None
        torch.set_num_threads(threads)

    def reset(self) -> None:
        """Start an episode; nothing of the last one is remembered."""
        self.decision = None

    def act(self, observation: Observation) -> Control:
        """The control for this observation; where its image is no use, the brake, and the reason in the note."""
        try:
            check_image(observation.image, self.network.config.image_size)
            self.decision = Decision(self._control(observation))
        except BadImage as error:
            self.decision = Decision(STOP, note=str(error))
        return self.decision.control

    @torch.inference_mode()
    def _control(self, observation: Observation) -> Control:
        command = torch.tensor([COMMANDS.index(observation.command)])
        speed = torch.tensor([observation.speed], dtype=torch.float32)
        controls, seen = self.network.act(self._look(observation.image), speed, command)
        if not (controls.isfinite().all() and seen.isfinite().all()):
            raise BadImage("the network's outputs are not numbers: brake, and look at the weights")
        steer, throttle, brake = controls[0].tolist()
        seen_speed = float(seen[0]) if self.avoid_stopping else None
        return wheel_control(steer, throttle, brake, observation.speed, self.rules, seen_speed)
