"""Settings of the network and of its training, and their presets."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TrainingConfig:
    """How the network learns: Adam with a warm-up and a cosine down to final_rate times the base rate.

    batch: windows a step; window: consecutive frames of each that give a loss; clip: largest norm of the gradient.
    augment: colours, light, blur and noise; repaint: where the recording has semantic images, also the colours of what
    stands there. others: share of the windows that are seen under another command, where one could be given.
    angle_weight, segmentation: what the relative angle's loss and the second lesson's (where the recording has semantic
    images; 0 leaves it out) count while the backbone learns; the other affordances' count 1.
    block_steps: after the others, steps in which the task blocks that look back learn alone, from block_batch windows
    with their history, whose frames the finished backbone saw once; until then a window is seen as if its stream began
    there. 0: the blocks see their history from the first step on.
    balance: 0 draws windows evenly, 1 in inverse proportion to the frequency of the rarest label in them.
    at_once: frames that pass the backbone together, where a batch would find no room in memory, None for all; without
    batch norm only, which looks at a whole batch. cache_gb: decoded images are kept in memory up to this size.
    precision: auto, fp32 or bf16. device: cpu, cuda, or auto for a GPU where there is one. initial: file of the network
    to begin with, None for a new one.
    """

    steps: int = 11_000
    batch: int = 64
    window: int = 1
    learning_rate: float = 1e-3
    warm_up: int = 100
    final_rate: float = 0.02
    clip: float = 5.0
    balance: float = 0.5
    augment: bool = True
    repaint: bool = True
    others: float = 0.5
    angle_weight: float = 1.0
    segmentation: float = 0.5
    block_steps: int = 3_000
    block_batch: int = 256
    at_once: int | None = None
    validation_share: float = 0.05
    evaluate_every: int = 2000
    save_every: int = 100
    cache_gb: float = 4.0
    precision: str = "auto"
    device: str = "auto"
    initial: str | None = None
    seed: int = 0


TRAININGS = {
    "small": TrainingConfig(angle_weight=5.0),
    # Section 3.1: Adam, mini-batches of 32 sequences, base rate 5e-5.
    "paper": TrainingConfig(
        steps=75_000,
        batch=32,
        learning_rate=5e-5,
        warm_up=0,
        final_rate=1.0,
        balance=0.0,
        block_steps=0,
        repaint=False,
        others=0.0,
        segmentation=0.0,
        at_once=64,
    ),
}
