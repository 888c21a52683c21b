"""What the imitation network learns from a recording: what the driver wanted, as from each camera's place.

A camera beside the car's middle, or turned, sees what the car would see if it stood there. Its label is the steering
that brings the car back: the clean control of the driver, never the disturbed one, with what his own law (`Stanley`,
section 3.2, eq. 2) adds for the camera's offset and turn. The published correction is one for CARLA's wheels of 70
degrees and cameras turned by 30 (coiltraine: 6 / pi * arctan(0.52 * 6 / v), at most 0.3).
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from caldrive.control.lateral import LateralConfig
from caldrive.perception.dataset.frames import Frames, Ids
from caldrive.perception.dataset.sampler import weighted
from caldrive.perception.network.network import COMMANDS
from caldrive.recordings.corl2017 import DrivenFrames

Numbers = NDArray[np.float64]
Bytes = NDArray[np.uint8]
LAW = LateralConfig()
GAINS = np.array([getattr(LAW, command.value)[0] for command in COMMANDS])  # 1/s


@dataclass(frozen=True)
class Demonstrations:
    """N frames of somebody's driving: what an imitation learns from, wherever it was recorded."""

    speed: Numbers
    """(N,), m/s."""
    command: Ids
    """(N,), numbers of the network's commands."""
    controls: Numbers
    """(N, 3): steer, + to the left, throttle and brake, as from each camera's place."""
    images: Callable[[Ids], Bytes]
    """Images (n, H, W, 3) of frames by number."""
    semantics: Callable[[Ids], Bytes | None]
    """Their semantic images (n, H, W), where there are any."""
    digest: str
    """Tells these frames from others."""

    def __len__(self) -> int:
        return len(self.speed)


@dataclass(frozen=True)
class Camera:
    """Where the cameras of N frames are: m to the left of the car's middle, and rad to the left."""

    left: Numbers
    yaw: Numbers


def corrected_steer(steer: Numbers, camera: Camera, speed: Numbers, gain: Numbers, wheel: float) -> Numbers:
    """The steering (N,), in [-1, 1] and + to the left, for a car that stands at the camera's place.

    steer: for the car where it is; speed: m/s; gain: of the driver's law, 1/s; wheel: angle of the front wheels at full
    steering, rad.
    """
    angle = -camera.yaw - np.arctan(gain * camera.left / np.maximum(speed, LAW.speed_floor))
    return np.clip(steer + angle / wheel, -1.0, 1.0)


def recorded_demonstrations(frames: Frames, wheel: float) -> Demonstrations:
    """What an imitation learns from a recording's frames. wheel: as in `corrected_steer`."""
    speed, command = frames.column("speed"), frames.command
    clean = [frames.column(f"clean_{name}") for name in ("steer", "throttle", "brake")]
    camera = Camera(frames.column("camera_left"), frames.column("camera_yaw"))
    steer = corrected_steer(clean[0], camera, speed, GAINS[command], wheel)
    controls = np.stack([steer, *clean[1:]], axis=1)
    return Demonstrations(speed, command, controls, frames.images, frames.semantics, frames.digest)


def corl2017_demonstrations(frames: DrivenFrames, wheel: float) -> Demonstrations:
    """What an imitation learns from HDF5 files. wheel: as in `corrected_steer`, of CARLA's car 70 degrees."""
    throttle, brake, steer = frames.control.T
    camera = Camera(frames.camera_left, frames.camera_yaw)
    corrected = corrected_steer(steer, camera, frames.speed, GAINS[frames.command], wheel)
    controls = np.stack([corrected, throttle, brake], axis=1)
    digest = hashlib.sha256(repr([(path.name, path.stat().st_size) for path in frames.files]).encode())
    for values in (frames.speed, frames.command, controls):
        digest.update(values.tobytes())
    return Demonstrations(
        frames.speed, frames.command, controls, frames.images, lambda ids: None, digest.hexdigest()[:16]
    )


# Edges of the classes in which the size of the steering is balanced, where it is.
STEER_EDGES = (0.05, 0.15, 0.4)


class CommandSampler:
    """Draws frames: of each batch every command has the same share (CARLA paper, S.2.2). What step k draws depends on
    (seed, k) only.

    balance: 0 draws a command's frames evenly, 1 in inverse proportion to the frequency of their steering. Raises
    ValueError where a command never occurs.
    """

    def __init__(self, frames: Demonstrations, balance: float, seed: int) -> None:
        self.seed, self._ids, self._cumulative = seed, list[Ids](), list[Numbers]()
        steer = np.digitize(np.abs(frames.controls[:, 0]), STEER_EDGES)
        for number, command in enumerate(COMMANDS):
            ids = np.flatnonzero(frames.command == number)
            if not len(ids):
                raise ValueError(
                    f"found no frame with the command {command.value}, wanted some of each: record more episodes"
                )
            weight = (1 / np.bincount(steer[ids])[steer[ids]]) ** balance
            self._ids.append(ids)
            self._cumulative.append(np.cumsum(weight))

    def draw(self, step: int, n: int) -> Ids:
        """n frames, the commands among each other; where n is no multiple of them, the first ones have one more."""
        rng = np.random.default_rng((self.seed, step))
        chances = rng.random(n)
        drawn = np.empty(n, np.int64)
        for number, (ids, cumulative) in enumerate(zip(self._ids, self._cumulative, strict=True)):
            mine = slice(number, None, len(COMMANDS))
            drawn[mine] = weighted(ids, cumulative, chances[mine])
        return rng.permutation(drawn)  # several processes that share a batch out in turn have all commands each
