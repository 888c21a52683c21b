"""Settings of a training, with their limits and presets. No import here waits for torch."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Annotated, Any, Literal

from tyro.conf import arg

from caldrive.checks import MOST_SEED, Limits, require_limits, require_within
from caldrive.perception.dataset.config import AugmentationConfig, RecolourConfig


@dataclass(frozen=True)
class LossWeights:
    """What each part counts in the sum that is the multi-task loss."""

    hazard_stop: float = 1.0
    """Weight of the hazard stop's loss."""
    red_light: float = 1.0
    """Weight of the red light's loss."""
    speed_sign: float = 1.0
    """Weight of the speed sign's loss."""
    vehicle_distance: float = 1.0
    """Weight of the loss of the distance to the vehicle ahead."""
    relative_angle: float = 1.0
    """Weight of the relative angle's loss."""
    center_distance: float = 1.0
    """Weight of the loss of the distance to the centre line."""
    segmentation: float = 0.5
    """Weight of the auxiliary segmentation's loss, where the recording has semantic images; 0 leaves it out."""

    def __post_init__(self) -> None:
        """Raises ValueError where a weight would reward mistakes."""
        require_limits(vars(self), dict.fromkeys(vars(self), (0.0, math.inf)), vars(type(self)), "loss-weights")


# What each number may be, from and to; a setting that is not here may be any number.
LOOP_LIMITS: Limits = {
    "steps": (1, 10_000_000),
    "batch": (1, 100_000),
    "learning_rate": (1e-9, 1.0),
    "warm_up": (0, 10_000_000),
    "final_rate": (0.0, 1.0),
    "clip": (1e-9, 1e9),
    "balance": (0.0, 1.0),
    "cache_gb": (0.0, math.inf),
    "validation_share": (0.0, 1.0),
    "evaluate_every": (1, 10_000_000),
    "save_every": (1, 10_000_000),
    "seed": (0, MOST_SEED),
}


@dataclass(frozen=True)
class LoopConfig:
    """What every training has: Adam with a warm-up and a cosine, on the images of a recording."""

    steps: int = 14_000
    """Steps in all."""
    batch: int = 64
    """Windows a step."""
    learning_rate: Annotated[float, arg(aliases=("--rate",))] = 1e-3
    """Base learning rate."""
    betas: tuple[float, float] = (0.9, 0.999)
    """Adam's: how much of the old mean gradient, and of its square, stays in each step."""
    warm_up: int = 100
    """Steps in which the rate rises to the base rate."""
    final_rate: float = 0.02
    """Share of the base rate that is left at the end of the cosine."""
    clip: float = 5.0
    """Largest norm of the gradient."""
    balance: float = 0.5
    """0 draws windows evenly, 1 in inverse proportion to the frequency of what is rarest in them."""
    augmentation: AugmentationConfig = AugmentationConfig()
    """Other colours, light, blur and noise for whole images."""
    recolour: RecolourConfig = RecolourConfig()
    """Other colours for each class of things, where the recording has semantic images."""
    validation_share: float = 0.05
    """Share of the episodes that is kept for validation."""
    evaluate_every: int = 2000
    """Steps from one validation to the next."""
    save_every: int = 100
    """Steps after which the state is saved, from which a stopped training goes on."""
    cache_gb: float = 4.0
    """Decoded images are kept in memory where they take at most so many GB."""
    precision: Literal["auto", "fp32", "bf16"] = "auto"
    """Precision of the arithmetic; auto takes bf16 where that is faster."""
    device: str = "auto"
    """cpu, cuda, or auto for a GPU where there is one; torchrun trains on several."""
    seed: int = 0
    """Decides everything random."""

    def __post_init__(self) -> None:
        require_limits(vars(self), LOOP_LIMITS, usual(self))
        for beta in self.betas:
            require_within("--betas", beta, 0.0, 1 - 1e-9, 0.9)

    @property
    def wants_semantics(self) -> bool:
        """Whether it looks at semantic images, where the recording has them."""
        return self.recolour.enabled


def usual(config: LoopConfig) -> dict[str, Any]:
    """The defaults of settings by their names."""
    return {field.name: field.default for field in fields(config)}


HISTORY_SHARE = 3 / 14  # of the steps, in which the temporal blocks learn alone

LIMITS: Limits = {
    "window": (1, 1000),
    "alternative_share": (0.0, 1.0),
    "history_batch": (1, 100_000),
    "camera_check_steps": (0, 10_000_000),
    "backbone_chunk": (0, 1_000_000),
}


@dataclass(frozen=True)
class TrainingConfig(LoopConfig):
    """How CAL's network learns: as a whole, then its temporal blocks alone, then its camera check."""

    window: int = 1
    """Consecutive frames of a window that give a loss."""
    loss_weights: LossWeights = LossWeights(relative_angle=5.0)
    """What the parts of the loss count while the backbone learns."""
    alternative_share: float = 0.5
    """Share of the windows that are seen under another command, with its labels, where one could be given."""
    history_steps: int | None = None
    """Of all steps the last ones, in which the temporal blocks learn alone from what the finished backbone makes of the
    frames; without it three of fourteen. Until then a window is seen as if its stream began there. 0: they see their
    history from the first step."""
    history_batch: int = 256
    """Windows with their history in a step of the second stage."""
    camera_check_steps: int = 5_000
    """Steps of the third stage, in which the camera check learns what a working camera's images look like; no more than
    --steps. 0 leaves it out."""
    backbone_chunk: int = 0
    """Images that pass the backbone together, with gradient checkpointing, where a batch finds no room in memory; 0 for
    all of them. Only without batch norm, which looks at a whole batch."""
    initial: str | None = None
    """A trained network (.safetensors) to begin with, instead of a new one; its blocks where they are built alike."""
    imagenet: str = "none"
    """VGG16's ImageNet weights for a backbone of full width to begin with: a file (.safetensors or .pth), cache for
    those in torch.hub's cache, or none."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_limits(vars(self), LIMITS, usual(self))
        require_within("--history-steps", self.second_stage, 0, self.steps - 1, 0)
        if self.initial and self.imagenet not in ("none", "cache"):
            raise ValueError("found --initial and --imagenet, wanted one network to begin with: type one of them")

    @property
    def wants_semantics(self) -> bool:
        """Whether it looks at semantic images, where the recording has them."""
        return super().wants_semantics or self.loss_weights.segmentation > 0

    @property
    def second_stage(self) -> int:
        """Steps of the temporal blocks alone, where there are such blocks."""
        return round(HISTORY_SHARE * self.steps) if self.history_steps is None else self.history_steps


TRAININGS = {
    "small": TrainingConfig(),
    # Section 3.1: Adam, mini-batches of 32 sequences, base rate 5e-5.
    "paper": TrainingConfig(
        steps=75_000,
        batch=32,
        learning_rate=5e-5,
        warm_up=0,
        final_rate=1.0,
        loss_weights=LossWeights(segmentation=0.0),
        balance=0.0,
        alternative_share=0.0,
        recolour=RecolourConfig(enabled=False),
        history_steps=0,
        backbone_chunk=64,
        imagenet="cache",
    ),
}
