"""The camera check: a small network that tells a working camera's image from a faulty one's, and what is wrong with it.

How far the backbone's features lie from those of the recording does not tell it: they learnt to leave out what changes
with light and colour, and of a white image little is left. So the check looks at the image itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from caldrive.files import as_type
from caldrive.perception.network.checkpoint import CAMERA_CHECK, read_info, single_precision
from caldrive.perception.network.tensor_file import CheckpointError, is_weight, read_header, read_tensors, write_tensors

# What may be wrong with an image, in words, and the faults (`perception.camera_faults`) that teach it.
REASONS: dict[str, tuple[str, ...]] = {
    "full of noise": ("noise", "grain", "speckles", "growing grain"),
    "mirrored": ("mirrored",),
    "turned or moved": ("upside down", "turned", "moved"),
    "in wrong colours": ("green", "red and blue exchanged", "tinted"),
    "too bright, too dark or too pale": ("white", "grey", "overexposed", "dark", "dying", "fading"),
    "blurred": ("blurred",),
    "partly covered": ("half covered", "dirt on the lens"),
}
# Frames over which the evidence for each is averaged. On the opposite side of the road a car sees what mirrors show,
# and it needs some seconds to come back.
WINDOWS = tuple(60 if name == "mirrored" else 10 for name in REASONS)
COUNT = np.arange(max(WINDOWS), 0, -1)[:, None] <= WINDOWS  # which of the last frames do, by reason; the newest is last
KEY = "camera_check"  # of its thresholds in the header of a network's file
CHANNELS = (16, 24, 32, 48)
NODES, DROPOUT = 32, 0.3
MOST_EVIDENCE = 10.0  # that one image counts for or against a fault, as a logarithm of odds


class CameraCheck(nn.Module):
    """Normalised images (N, 3, H, W) of one size (height, width) to outputs (N, 1 + reasons): 0 is a working camera's.

    2.7 million multiplications for 200 x 88 pixels, where the small backbone needs 338 million.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        n_in = 3
        for k, n_out in enumerate(CHANNELS):
            # The first layer cuts the image into patches, each later one halves it.
            conv = nn.Conv2d(n_in, n_out, 3, 2, padding=1, bias=False) if k else nn.Conv2d(3, n_out, 4, 4, bias=False)
            layers += [conv, nn.BatchNorm2d(n_out), nn.ReLU()]
            n_in = n_out
        self.layers = nn.Sequential(*layers, nn.Flatten())
        self.eval()
        with torch.no_grad():
            n_features = self.layers(torch.zeros(1, 3, *size)).shape[1]
        self.head = nn.Sequential(
            nn.Linear(n_features, NODES), nn.ReLU(), nn.Dropout(DROPOUT), nn.Linear(NODES, 1 + len(REASONS))
        )

    def forward(self, images: Tensor) -> Tensor:
        """Normalised images (N, 3, H, W) to outputs (N, 1 + reasons)."""
        outputs: Tensor = self.head(self.layers(images))
        return outputs


def evidence(outputs: NDArray[np.float32]) -> NDArray[np.float32]:
    """For each reason the logarithm of the odds (N, reasons) that it is wrong with the image, and not nothing, from
    outputs (N, 1 + reasons)."""
    return (outputs[:, 1:] - outputs[:, :1]).clip(-MOST_EVIDENCE, MOST_EVIDENCE)


def averaged(odds: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
    """For each reason the mean (reasons,) of its evidence (T, reasons) over the last frames of its window; before the
    first frame there is no evidence."""
    recent = odds[-len(COUNT) :]
    sums: NDArray[np.float64] = (recent * COUNT[-len(recent) :]).sum(axis=0, dtype=np.float64)
    return sums / WINDOWS


def add_camera_check(path: Path, check: CameraCheck, thresholds: Sequence[float]) -> None:
    """Write a camera check into a network's file, in the place of one that is there. thresholds: of the mean evidence
    for each of its reasons, above which the camera has failed."""
    tensors, header = read_tensors(path)
    tensors = {name: value for name, value in tensors.items() if not name.startswith(CAMERA_CHECK)}
    for name, value in check.state_dict().items():
        tensors[CAMERA_CHECK + name] = value.half() if is_weight(value) else value
    write_tensors(path, tensors, header | {KEY: dict(zip(REASONS, thresholds, strict=True))})


def load_camera_check(path: Path | str) -> tuple[CameraCheck, tuple[float, ...]] | None:
    """A network's camera check with its thresholds, None where it has none. Raises CheckpointError where it does not
    fit this code."""
    if KEY not in read_header(Path(path)):
        return None
    info, (tensors, header) = read_info(path), read_tensors(Path(path))
    check = CameraCheck(info.config.image_size)
    try:
        known = as_type(header[KEY], dict[str, float])
        thresholds = tuple(known[name] for name in REASONS)
        check.load_state_dict(single_precision(tensors, camera_check=True))
        values = (torch.tensor(thresholds), *check.state_dict().values())
        if not all(bool(value.isfinite().all()) for value in values):
            raise ValueError("values that are not numbers")
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise CheckpointError(
            f"found in {path} a camera check that does not fit this caldrive, wanted its own: train the network again"
        ) from error
    return check.eval(), thresholds
