"""A recording in the format of the CARLA paper's imitation data, for others' code to learn from.

Episodes train or validate as a whole. Of each part, all frames lie one after the other, camera by camera, in files of
200: public readers count on that number. The frames behind the last whole file are left out. A file may hold the end of
one camera's drive and the beginning of another's; public readers draw single frames.
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from caldrive.checks import MOST_SEED, require_within
from caldrive.datatypes import KMH, Command
from caldrive.files import locked_folder, write_whole
from caldrive.progress import Progress, silent
from caldrive.provenance import file_digest
from caldrive.recordings.corl2017 import (
    CAMERA_LEFT,
    COLUMNS,
    COMMAND_NUMBERS,
    FOLDERS,
    FOLLOW,
    FRAMES,
    HEIGHT,
    IMAGES,
    TARGETS,
    WIDTH,
    read_columns,
    require_h5py,
)
from caldrive.recordings.folder import duplicates, episode_paths, joined, split
from caldrive.recordings.reader import Episode, read_episode
from caldrive.recordings.writer import EpisodeError
from caldrive.scenarios import require_to_learn_from

FOLLOW_DISTANCE = 20.0  # m before a junction at which the command to follow the lane ends: our choice
GAP = 5.0  # m from frame to frame: a junction may lie between them
CENTER, LEFT, RIGHT = 0, 1, 2  # cameras' numbers
DESCRIPTION = "corl2017.json"  # of a folder of files: what they were made of


@dataclass(frozen=True)
class Written:
    """What a folder holds in the end."""

    files: int
    """Of 200 frames each."""
    frames: int
    """In these files."""
    left_out: int
    """Frames that would not fill another file."""


def write_corl2017(
    recording: Path, out: Path, validation_share: float = 0.2, seed: int = 0, progress: Progress = silent
) -> Written:
    """Writes a folder of recorded episodes as files of `out`/SeqTrain and `out`/SeqVal; those that are there are kept.

    validation_share: of the episodes, for SeqVal. Raises EpisodeError for a recording that cannot be written so (too
    few frames, images of another size), ValueError for a town that may only judge, and where `out` holds files of
    something else or another process writes in it, RuntimeError where h5py is missing.
    """
    require_h5py()
    require_within("--validation-share", validation_share, 0.0, 1.0, 0.2)
    require_within("--seed", seed, 0, MOST_SEED, 0)
    parts = _parts(recording, validation_share, seed, progress)
    files = [
        (out / name / f"data_{number:05d}.h5", part, number)
        for name, part in parts.items()
        for number in range(_frames(part) // FRAMES)
    ]
    with locked_folder(out):
        _claim(out, {name: [file_digest(episode.path) for episode in part] for name, part in parts.items()})
        for k, (path, part, number) in enumerate(files):
            progress(f"writing, {k} of {len(files)} files", k / len(files))
            if not _is_whole(path):
                write_whole(path, _file(part, number))
    written = len(files) * FRAMES
    return Written(len(files), written, sum(map(_frames, parts.values())) - written)


def targets(episode: Episode) -> NDArray[np.float32]:
    """What the format says of each frame (N, 28), in its own units and signs.

    What no recording of ours knows is 0: positions, orientation, accelerations, the lanes left, and the time of the
    machine. So are collisions, because an episode ends with the first one. The noise flag is 1 where what moved the car
    was not what the driver wanted. Cameras are numbered by their side: 0 in the middle, 1 left, 2 right.
    """
    columns = episode.columns
    kinds = {"": "clean", "_noise": "driven"}
    values = {f"gas{end}": columns[f"{kind}_throttle"] for end, kind in kinds.items()}
    values |= {f"brake{end}": columns[f"{kind}_brake"] for end, kind in kinds.items()}
    values |= {f"steer{end}": -columns[f"{kind}_steer"] for end, kind in kinds.items()}
    left = columns["camera_left"]
    values |= {
        "speed": columns["speed"] / KMH,
        "game_time": 1000 * columns["time"],
        "command": _commands(episode),
        "noise": np.any([values[name] != values[f"{name}_noise"] for name in ("steer", "gas", "brake")], axis=0),
        "camera": np.select([left > 0, left < 0], [LEFT, RIGHT], CENTER),
        "camera_yaw": -np.degrees(columns["camera_yaw"]),
    }
    none = np.zeros(len(episode))
    return np.stack([values.get(name, none) for name in COLUMNS], axis=1).astype(np.float32)


def _commands(episode: Episode) -> NDArray[np.int64]:
    """The format's command of each frame (N,): to follow the lane where ours is straight and the next junction more
    than FOLLOW_DISTANCE away. Where a recording ends before that is known, the command stays."""
    columns = episode.columns
    numbers = np.array([COMMAND_NUMBERS[Command(command)] for command in columns["command"]])
    for camera in np.unique(columns["camera"]):
        rows = columns["camera"] == camera
        ahead = distance_to_junction(*(columns[name][rows] for name in ("time", "speed", "junction")))
        is_straight = numbers[rows] == COMMAND_NUMBERS[Command.STRAIGHT]
        numbers[rows] = np.where(is_straight & (ahead > FOLLOW_DISTANCE), FOLLOW, numbers[rows])
    return numbers


def distance_to_junction(
    time: NDArray[np.float64], speed: NDArray[np.float64], junction: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """How far (N,), m, the car goes on from each frame until it is inside a junction, or the recording ends or has a
    gap.

    time (N,) s; speed (N,) m/s; junction (N,): whether it is inside one.
    """
    steps = np.diff(time) * (speed[1:] + speed[:-1]) / 2
    travelled = np.concatenate(([0.0], np.cumsum(steps)))
    gaps = np.flatnonzero(np.diff(time) * np.maximum(speed[1:], speed[:-1]) > GAP)
    ends = np.unique(np.concatenate((np.flatnonzero(junction), gaps, [len(time) - 1])))
    distance: NDArray[np.float64] = travelled[ends[np.searchsorted(ends, np.arange(len(time)))]] - travelled
    return distance


def _parts(recording: Path, validation_share: float, seed: int, progress: Progress) -> dict[str, list[Episode]]:
    """The episodes of SeqTrain and of SeqVal, without their images. Raises ValueError for those that cannot be."""
    episodes = list(_read(episode_paths(recording), progress))
    if sentences := duplicates(episodes):
        raise EpisodeError(sentences[0])
    for town in {episode.scenario.town for episode in episodes}:
        require_to_learn_from(town)
    parts = dict(zip(FOLDERS, split(episodes, validation_share, seed), strict=True))
    for name, part in parts.items():
        _require_frames(recording, name, part)
    return parts


def _read(paths: list[Path], progress: Progress) -> Iterator[Episode]:
    """The episodes without their images. Raises EpisodeError where those have another size."""
    for k, path in enumerate(paths):
        progress("reading", k / len(paths))
        episode = read_episode(path)
        height, width = episode.image(0).shape[:2]
        if (height, width) != (HEIGHT, WIDTH):
            raise EpisodeError(
                f"found images of {width} x {height} in {path}, wanted {WIDTH} x {HEIGHT}: record with --width {WIDTH} "
                f"--height {HEIGHT}"
            )
        yield replace(episode, jpegs=[])


def _frames(episodes: list[Episode]) -> int:
    return sum(map(len, episodes))


def _require_frames(recording: Path, name: str, episodes: list[Episode]) -> None:
    """Raises EpisodeError where not a single file can be filled."""
    if _frames(episodes) < FRAMES:
        raise EpisodeError(
            f"found {_frames(episodes)} frames for {name} in {recording}, wanted {FRAMES} or more, as a file has: "
            "record more episodes, or give another --validation-share"
        )


def _claim(out: Path, made_of: dict[str, list[str]]) -> None:
    """Writes down what a folder's files are made of. Raises ValueError where files of something else are there."""
    path, wanted = out / DESCRIPTION, (json.dumps({"episodes": made_of}, indent=2) + "\n").encode()
    found = path.read_bytes() if path.is_file() else b""
    if found != wanted and any(out.glob("Seq*/*.h5")):
        raise ValueError(
            f"found files of another recording, share or seed in {out}, wanted a folder for these: give another --out"
        )
    write_whole(path, wanted)


def _is_whole(path: Path) -> bool:
    try:
        return path.is_file() and bool(read_columns(path))
    except EpisodeError:
        return False


@lru_cache(maxsize=2)
def _with_images(path: Path) -> Episode:
    """An episode as it is needed by neighbouring files."""
    return read_episode(path)


def _file(episodes: list[Episode], number: int) -> bytes:
    """A file of 200 frames, as bytes: those from 200 * number on of all that these episodes have."""
    begins = np.cumsum([0, *map(len, episodes)])
    frames = np.arange(FRAMES * number, FRAMES * (number + 1))
    which = np.searchsorted(begins, frames, side="right") - 1
    images = np.stack(
        [_image(episodes[i].path, int(frame - begins[i])) for i, frame in zip(which, frames, strict=True)]
    )
    rows = slice(frames[0] - begins[which[0]], frames[0] - begins[which[0]] + FRAMES)
    used = episodes[which[0] : which[-1] + 1]
    content = io.BytesIO()
    with require_h5py().File(content, "w") as file:
        # Public readers take frame by frame: each is a chunk of its own. gzip is in every build of HDF5.
        file.create_dataset(IMAGES, data=images, chunks=(1, *images.shape[1:]), compression="gzip", compression_opts=1)
        file.create_dataset(TARGETS, data=np.concatenate([targets(episode) for episode in used])[rows])
        file.create_dataset(CAMERA_LEFT, data=joined(used, CAMERA_LEFT)[rows].astype(np.float32))
    return content.getvalue()


def _image(path: Path, row: int) -> NDArray[np.uint8]:
    """An image of an episode. Raises EpisodeError where it has another size than the first one."""
    image = _with_images(path).image(row)
    if image.shape != (HEIGHT, WIDTH, 3):
        raise EpisodeError(f"found an image of another size in row {row} of {path}: remove the file and record again")
    return image
