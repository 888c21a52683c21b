"""The format of the CARLA paper's imitation data (CORL-2017), and its frames as an imitation learns from them.

A folder SeqTrain and a folder SeqVal hold HDF5 files of 200 frames: `rgb` (200, 88, 200, 3), bytes, and `targets`
(200, 28), the floats that COLUMNS names. Further datasets, such as the published files' `depth`, are not read. What the
columns mean, by the README and the issues of carla-simulator/imitation-learning and by what public readers do:

* Steer is + to the right, as in CARLA; ours is + to the left.
* Steer, gas and brake are what the driver wanted. Every public reader learns from these three.
* The columns called noise are the same three after the perturbation: what moved the car. The README leaves open whether
  they are that or the difference. A public viewer of these files calls the first one the noisy steer, and the row that
  issue 13 prints has the same 0.6457 for gas and gas noise.
* Speed is in km/h (issue 40), and negative here and there, which nobody explains (issue 44).
* Commands: 2 follow the lane, 3 left, 4 right, 5 straight. A few frames have 0, which nobody explains, either.
* The camera's yaw is in degrees, + to the right: the author's later recordings have +30 for the right camera, and his
  correction for turned cameras takes steer away there. Camera 0 looks straight ahead.
* No column says how far a camera is beside the car's middle. A dataset `camera_left` (200,), m, which others pass over,
  says it in files of ours; elsewhere cameras count as in the middle.
* Positions are cm on CARLA's left-handed axes, game time is ms.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import KMH, Command
from caldrive.progress import Progress, silent
from caldrive.recordings.writer import EpisodeError

FRAMES, HEIGHT, WIDTH = 200, 88, 200  # of a file, and pixels of an image
FOLDERS = ("SeqTrain", "SeqVal")
IMAGES, TARGETS, CAMERA_LEFT = "rgb", "targets", "camera_left"  # datasets of a file; the last one is our own
COLUMNS = (
    "steer", "gas", "brake", "hand_brake", "reverse", "steer_noise", "gas_noise", "brake_noise", "x", "y", "speed",
    "collision_other", "collision_person", "collision_car", "opposite_lane", "sidewalk", "acceleration_x",
    "acceleration_y", "acceleration_z", "platform_time", "game_time", "orientation_x", "orientation_y", "orientation_z",
    "command", "noise", "camera", "camera_yaw",
)  # fmt: skip
OURS = "ours"  # a column that no file has: whether it says how far to the left a camera is
FOLLOW = 2
COMMAND_NUMBERS = {Command.LEFT: 3, Command.RIGHT: 4, Command.STRAIGHT: 5}
COMMANDS = {number: command for command, number in COMMAND_NUMBERS.items()} | dict.fromkeys(
    (0, FOLLOW), Command.STRAIGHT
)
LARGEST = {  # of what is read, either way: further than any drive goes
    "steer": 10.0, "gas": 10.0, "brake": 10.0, "speed": 360.0, "camera_yaw": 180.0, CAMERA_LEFT: 10.0,
}  # fmt: skip


@dataclass(frozen=True)
class DrivenFrames:
    """N frames for an imitation: what a camera saw, and what the driver wanted then. Nothing says what the affordances
    were, so nothing that learns those can learn from them. The images stay in their files until they are asked for."""

    files: tuple[Path, ...]
    """The files; frame i is row i % 200 of file i // 200."""
    speed: NDArray[np.float64]
    """(N,), m/s, negative backwards."""
    command: NDArray[np.int64]
    """(N,), places in tuple(Command). Follow the lane is straight, as is no command at all."""
    control: NDArray[np.float64]
    """(N, 3): throttle, brake and steer (+ left) as the driver wanted them, before any perturbation."""
    camera_left: NDArray[np.float64]
    """(N,), m to the left of the car's middle."""
    camera_yaw: NDArray[np.float64]
    """(N,), rad to the left."""
    is_ours: bool = False
    """Whether caldrive recorded them: its files say how far to the left a camera is."""

    def __len__(self) -> int:
        return len(self.speed)

    def images(self, ids: NDArray[np.int64]) -> NDArray[np.uint8]:
        """Images (len(ids), 88, 200, 3), RGB, of frames by number, which may come in any order and more than once.

        Raises EpisodeError where a file is not what it was any more.
        """
        images = np.empty((len(ids), HEIGHT, WIDTH, 3), np.uint8)
        numbers, rows = np.divmod(ids, FRAMES)
        order = np.argsort(numbers, kind="stable")
        for slots in np.split(order, np.flatnonzero(np.diff(numbers[order])) + 1) if len(ids) else ():
            images[slots] = _read_images(self.files[numbers[slots[0]]], rows[slots])
        return images


def read_corl2017(folder: Path | str, progress: Progress = silent) -> DrivenFrames:
    """The frames of a folder of such files, SeqTrain or SeqVal, in the order of their names.

    Raises EpisodeError where there are none or a file cannot be right, RuntimeError where h5py is missing.
    """
    folder, columns = Path(folder), []
    paths = sorted(folder.glob("*.h5"))
    if not paths:
        inside = f", type {folder / FOLDERS[0]}" if (folder / FOLDERS[0]).is_dir() else ""
        raise EpisodeError(f"found no file *.h5 in {folder}, wanted {FOLDERS[0]} or {FOLDERS[1]}{inside}")
    for k, path in enumerate(paths):
        progress(f"reading {folder}", k / len(paths))
        columns.append(read_columns(path))
    values = {name: np.concatenate([one[name] for one in columns]) for name in columns[0]}
    places = {command: place for place, command in enumerate(Command)}
    return DrivenFrames(
        files=tuple(paths),
        speed=values["speed"] * KMH,
        command=np.array([places[COMMANDS[number]] for number in values["command"].tolist()], np.int64),
        control=np.stack(
            [values["gas"].clip(0, 1), values["brake"].clip(0, 1), -values["steer"].clip(-1, 1)], axis=1
        ),
        camera_left=values[CAMERA_LEFT],
        camera_yaw=-np.radians(values["camera_yaw"]),
        is_ours=bool(values[OURS].all()),
    )  # fmt: skip


def read_columns(path: Path) -> dict[str, NDArray[np.float64]]:
    """What COLUMNS names (200,), in the file's own units, with `camera_left` in m, and OURS. Raises EpisodeError where
    the file cannot be right."""
    h5py = require_h5py()
    try:
        with h5py.File(path, "r") as file:
            has_left = CAMERA_LEFT in file
            _require(path, file, IMAGES, (FRAMES, HEIGHT, WIDTH, 3), "u1")
            _require(path, file, TARGETS, (FRAMES, len(COLUMNS)), "f4")
            if has_left:
                _require(path, file, CAMERA_LEFT, (FRAMES,), "f4")
            targets = np.asarray(file[TARGETS], np.float64)
            left = np.asarray(file[CAMERA_LEFT], np.float64) if has_left else np.zeros(FRAMES)
    except EpisodeError:
        raise
    except (OSError, KeyError, RuntimeError, TypeError, ValueError) as error:
        raise _damaged(path) from error
    columns = dict(zip(COLUMNS, targets.T, strict=True)) | {CAMERA_LEFT: left, OURS: np.full(FRAMES, float(has_left))}
    for name, largest in LARGEST.items():
        if not (np.abs(columns[name]) <= largest).all():  # NaN is not, either
            raise EpisodeError(f"found values of {name} in {path} that cannot be, wanted a drive's: remove the file")
    if unknown := set(columns["command"].tolist()) - set(COMMANDS):
        raise EpisodeError(f"found the command {min(unknown):g} in {path}, wanted 0 or 2 to 5: remove the file")
    return columns


def require_h5py() -> Any:
    """h5py itself. Raises RuntimeError where it is not installed."""
    try:
        import h5py
    except ImportError as error:
        raise RuntimeError("found no h5py, wanted it for HDF5 files: type pip install 'caldrive[hdf5]'") from error
    return h5py


def _require(path: Path, file: Any, name: str, shape: tuple[int, ...], kind: str) -> None:
    """Raises EpisodeError where a file lacks a dataset, or has it in another shape or type."""
    dataset = file.get(name)
    found = (getattr(dataset, "shape", None), getattr(dataset, "dtype", None))
    if found != (shape, np.dtype(kind)):
        said = f"{name} {found[0]} of {found[1]}" if found[0] else f"no {name}"
        raise EpisodeError(
            f"found {said} in {path}, wanted {shape} of {np.dtype(kind)} as in CORL-2017: remove the file"
        )


def _read_images(path: Path, rows: NDArray[np.int64]) -> NDArray[np.uint8]:
    """Images (N, H, W, 3) of rows of a file."""
    try:
        with require_h5py().File(path, "r") as file:
            dataset = file[IMAGES]
            images = np.stack([dataset[row] for row in rows])  # one by one: a list of rows takes HDF5 ten times as long
    except (OSError, KeyError, RuntimeError, TypeError, ValueError) as error:
        raise _damaged(path) from error
    return images


def _damaged(path: Path) -> EpisodeError:
    return EpisodeError(f"found that {path} is damaged or no HDF5 file, wanted frames: remove it, or fetch it again")
