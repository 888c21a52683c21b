"""The third stage of a training: the camera check learns what a working camera's images look like, and what faults do.

Half of each batch are frames of the recording, many in another light; the other half are such frames with a fault. What
a step draws depends on (seed, step) only.
"""

from __future__ import annotations

import math

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Generator, Tensor
from torch.nn.functional import cross_entropy
from torch.optim import AdamW

from caldrive.perception.camera_faults import make_fault
from caldrive.perception.dataset.augmentation import augment
from caldrive.perception.dataset.config import AugmentationConfig
from caldrive.perception.dataset.frames import Frames
from caldrive.perception.images import normalise, to_float
from caldrive.perception.network.camera_check import REASONS, WINDOWS, CameraCheck, averaged, evidence
from caldrive.progress import Progress, silent

Images = NDArray[np.uint8]

BATCH, RATE, DECAY = 64, 2e-3, 1e-2
WARM_UP = 0.05  # share of the steps
# The colours and the light that the network learns to drive in are no fault; noise and blur are one.
LIGHT = AugmentationConfig(share=0.7, blur=0.6, noise=0.0)
SKY = 0.6  # largest change of a colour channel's factor in the sky
LOOKS = 4  # in which the threshold is found: as recorded, and in other light
SECONDS = {"growing grain": (5.0, 29.0)}  # how long a fault that grows has grown, from and to; the others:
USUAL_SECONDS = (14.0, 29.0)
MARGIN, LEAST = 2.0, 4.0  # of the threshold above what the validation shows, and at all
FRAMES_A_PASS = 64


def train_camera_check(frames: Frames, steps: int, seed: int, progress: Progress = silent) -> CameraCheck:
    """A camera check that has learnt for so many steps of `BATCH` frames."""
    torch.manual_seed(seed)
    check = CameraCheck(frames.size).train()
    optimizer = AdamW(check.parameters(), RATE, weight_decay=DECAY)
    for step in range(steps):
        images, number = faulty_batch(frames, step, seed)
        optimizer.param_groups[0]["lr"] = RATE * _share_of_rate((step + 1) / steps)
        loss = cross_entropy(check(normalise(to_float(images))), torch.from_numpy(number))
        optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        optimizer.step()
        progress(f"camera check, step {step + 1}, loss {float(loss.detach()):.3f}", (step + 1) / steps)
    return check.eval()


def _share_of_rate(done: float) -> float:
    """A straight warm-up, then a cosine down to nothing."""
    return min(1.0, done / WARM_UP) * (1 + math.cos(math.pi * done)) / 2


def faulty_batch(frames: Frames, step: int, seed: int) -> tuple[Images, NDArray[np.int64]]:
    """Images (BATCH, H, W, 3) of a step, and for each 0 where nothing is wrong, else the number of its reason."""
    rng = np.random.default_rng((seed, step))
    images = frames.images(rng.integers(len(frames), size=BATCH))
    images = _in_other_light(images, np.arange(BATCH), int(rng.integers(2**31)))
    number = np.zeros(BATCH, np.int64)
    for i in range(BATCH // 2):
        number[i] = rng.integers(1, 1 + len(REASONS))
        name = str(rng.choice(tuple(REASONS.values())[number[i] - 1]))
        seconds = rng.uniform(*SECONDS.get(name, USUAL_SECONDS))
        images[i] = make_fault(name, int(rng.integers(2**31)))(images[i], seconds)
    return images, number


def _in_other_light(images: Images, groups: NDArray[np.int64], seed: int) -> Images:
    """Images (N, H, W, 3) as in another weather, under another sky; those of one group (N,) alike."""
    generator = Generator().manual_seed(seed)
    under_sky = to_float(images) * _sky(int(groups.max()) + 1, images.shape[1], generator)[torch.from_numpy(groups)]
    lit = augment(under_sky.clamp(0, 1), generator, torch.from_numpy(groups), LIGHT)
    return np.ascontiguousarray(lit.permute(0, 2, 3, 1).mul(255).round().byte().numpy())


def _sky(n: int, height: int, generator: Generator) -> Tensor:
    """Factors (n, 3, height, 1) that give the sky another colour, the more the higher a row lies above the horizon; in
    half of the cases none. Without them every evening's orange sky would look like a blue one with red and blue
    exchanged."""
    color = 1 + SKY * (2 * torch.rand(n, 3, generator=generator) - 1) * (torch.rand(n, 1, generator=generator) < 0.5)
    above = (1 - torch.arange(height) / (height / 2)).clamp(min=0)
    above = (above * 4).clamp(max=1)  # from the horizon to the full colour within an eighth of the image
    return 1 + (color[:, :, None, None] - 1) * above[:, None]


@torch.inference_mode()
def evidence_thresholds(check: CameraCheck, frames: Frames) -> list[float]:
    """For each reason a threshold above what the check thinks of a working camera: MARGIN more than the largest mean
    over its window in the streams of these frames, which it has not learnt from, as recorded and in other light."""
    largest = np.zeros(len(REASONS))
    for first in np.unique(frames.stream_start[: len(frames)]):
        images = frames.images(np.flatnonzero(frames.stream_start == first))
        for look in range(LOOKS):
            group = np.zeros(len(images), np.int64)
            shown = _in_other_light(images, group, seed=int(first) * LOOKS + look) if look else images
            parts = torch.split(normalise(to_float(shown)), FRAMES_A_PASS)
            odds = np.concatenate([evidence(check(part).numpy()) for part in parts])
            means = [averaged(odds[max(0, k - max(WINDOWS)) : k]) for k in range(1, len(odds) + 1)]
            largest = np.maximum(largest, np.max(means, axis=0))
    return [max(LEAST, MARGIN + float(value)) for value in largest]
