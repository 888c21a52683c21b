"""The agent of reinforcement learning: a policy turns what it sees into control, without a controller of laws."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import torch

from caldrive.agents.reinforcement.checkpoint import load_policy
from caldrive.agents.reinforcement.config import FRAME, PolicyConfig
from caldrive.agents.reinforcement.encoder import Encoder, encode_function
from caldrive.agents.reinforcement.inputs import AffordanceEye, Eye, FeatureEye, FrameEye, PolicyInputs, control_of
from caldrive.agents.reinforcement.policy import Policy
from caldrive.datatypes import KMH, CameraConfig, Control, Decision, Observation
from caldrive.interfaces import BadImage, Perception

MakePerception = Callable[[], Perception]


class ReinforcementAgent:
    """A policy at the wheel (`interfaces.Agent`). It is given image, speed and command, as in its training, and takes
    the best action of its distribution, never one by chance. Where an image is no use it brakes.

    decision: the last control, with the affordances where it sees any, and the reason in the note where it brakes
    blindly; None before the first. cap: km/h, above which there is no throttle.
    """

    def __init__(self, policy: Policy, eye: Eye, cap: float | None = None) -> None:
        self.policy, self.inputs = policy.eval(), PolicyInputs(eye, policy.config.memory)
        self.decision: Decision | None = None
        self._held, self._control = 0, Control()
        self._fastest = math.inf if cap is None else cap * KMH

    @property
    def perception(self) -> Perception:
        """What finds the affordances; a policy that sees none has no such attribute."""
        return self._affordance_eye().perception

    @perception.setter
    def perception(self, perception: Perception) -> None:
        self._affordance_eye().perception = perception

    def reset(self) -> None:
        """Start an episode."""
        self.inputs.reset()
        self.decision, self._held = None, 0

    def act(self, observation: Observation) -> Control:
        """The control for this observation; a decision holds for as many steps as in training."""
        try:
            self.inputs.watch(observation)
        except BadImage as error:
            self._held = 0
            self.decision = Decision(Control(brake=1.0), note=str(error))
            return self.decision.control
        if self._held == 0:
            self._control = self._decide(observation)
        if observation.speed > self._fastest:
            self._control = replace(self._control, throttle=0.0)
        self._held = (self._held + 1) % self.policy.config.repeat
        eye = self.inputs.eye
        seen = eye.affordances if isinstance(eye, AffordanceEye) else None
        self.decision = Decision(self._control, affordances=seen, note=f"policy on {self.policy.config.sees}")
        return self._control

    def _affordance_eye(self) -> AffordanceEye:
        if not isinstance(self.inputs.eye, AffordanceEye):
            raise AttributeError("found a policy that sees no affordances, wanted one that does: train it on them")
        return self.inputs.eye

    @torch.inference_mode()
    def _decide(self, observation: Observation) -> Control:
        inputs = {name: torch.from_numpy(value)[None] for name, value in self.inputs.see(observation).items()}
        best = self.policy(inputs).best()[0].numpy()
        control = control_of(self.policy.config.action, best, observation.speed)
        self.inputs.acted(control)
        return control


def make_eye(config: PolicyConfig, encoder: Encoder | None, perception: MakePerception) -> Eye:
    """What a policy sees with. perception: makes what finds the affordances, for a policy that sees them."""
    if config.sees == "affordances":
        return AffordanceEye(perception())
    if config.sees == "frames":
        return FrameEye()
    assert encoder is not None
    return FeatureEye(encode_function(encoder), encoder.image_size)


def policy_camera(image_size: tuple[int, int] | None) -> CameraConfig:
    """The camera of a policy that sees images itself. image_size: (H, W) of its encoder's, if it has one."""
    height, width = (FRAME, FRAME) if image_size is None else image_size
    return CameraConfig(width=width, height=height)


def load_agent(path: Path, perception: MakePerception, cap: float | None = None) -> ReinforcementAgent:
    """The agent of a file. perception: as in `make_eye`; cap: km/h. Raises CheckpointError where the file is no
    policy."""
    policy, info, encoder = load_policy(path)
    torch.set_num_threads(1)  # a policy is small, and others drive beside it
    return ReinforcementAgent(policy, make_eye(info.policy, encoder, perception), cap)
