"""A folder of recorded episodes, and who fills it.

Every episode depends on (seed, its number) only, so that a recording that was interrupted goes on and ends with the
same files as an unbroken one, on however many machines. Those of a Ray cluster may share no disk: they send an
episode's file as bytes, about 3 MB for 12 s, and this machine writes it.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from functools import lru_cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from caldrive.checks import MOST_PIXELS, MOST_SEED, MOST_WORKERS, Limits, require_limits
from caldrive.collection.config import CollectConfig
from caldrive.collection.recorder import record_episode
from caldrive.driving.settings import WorldSettings
from caldrive.driving.setup import make_world, planned_town, require_embedded
from caldrive.files import locked_folder, write_whole
from caldrive.interfaces import RecordableWorld, is_recordable
from caldrive.parallel.processes import parallel_map
from caldrive.parallel.ray_cluster import cluster_map, require_ray
from caldrive.progress import Progress, silent
from caldrive.provenance import code_version
from caldrive.recordings.folder import Manifest, read_manifest
from caldrive.recordings.reader import read_episode
from caldrive.recordings.writer import FORMAT_VERSION, MANIFEST, EpisodeError, episode_path
from caldrive.scenarios import require_not_held_out
from caldrive.world.roads.towns import load_roads
from caldrive.world.scene.weather import weather
from caldrive.world.traffic import sidewalks, start_places

LIMITS: Limits = {  # of the options that are numbers
    "episodes": (1, 100_000), "duration": (0.1, 3600.0), "width": (16, MOST_PIXELS), "height": (16, MOST_PIXELS),
    "seed": (0, MOST_SEED), "workers": (1, MOST_WORKERS), "crossing": (0.0, 1000.0), "before_signs": (0.0, 1.0),
    "before_turns": (0.0, 1.0), "displaced": (0.0, 1.0), "randomised": (0.0, 1.0), "hidden_cars": (0.0, 1.0),
    "tailgating": (0.0, 1.0),
}  # fmt: skip
EMBEDDED = WorldSettings()


def collect(
    config: CollectConfig, folder: Path, workers: int = 1, progress: Progress = silent, ray: str | None = None,
    world: WorldSettings = EMBEDDED,
) -> Iterator[tuple[int, int]]:  # fmt: skip
    """Records what is missing or damaged in a folder; yields (episode, frames) as they are done.

    ray: address of a cluster that records, as in `cluster_map`; None for processes of this machine. world: where it
    drives; CARLA, which has one world, takes one worker, and its towns have one look. Where a worker dies, new ones go
    on. Raises ValueError where the folder holds a recording with other settings, another process records in it or a
    machine of the cluster has another caldrive, RuntimeError where workers die again and again or Ray is missing.
    """
    if world.world == "carla":
        config, workers = replace(config, town=planned_town(world, config.town), randomised=0.0), 1
    _check(config, workers)
    if ray is not None:
        require_embedded(world)
        require_ray()
    with locked_folder(folder):
        _claim(folder, config)
        missing = list(_missing(config.episodes, folder, progress))
        if ray is None:
            recorded = parallel_map(partial(_record, config, folder, world=world), missing, workers)
        else:
            recorded = _record_elsewhere(config, folder, missing, workers, ray)
        try:
            for done, episode in enumerate(recorded, start=config.episodes - len(missing) + 1):
                progress(f"recording, {done} of {config.episodes} episodes", done / config.episodes)
                yield episode
        finally:
            _close_world(world)


def _missing(episodes: int, folder: Path, progress: Progress) -> Iterator[int]:
    """The episodes that are not there, or damaged."""
    for k in range(episodes):
        progress(f"looking at {folder}", k / episodes)
        path = episode_path(folder, k)
        try:
            if not path.exists() or not len(read_episode(path, semantic=True)):
                yield k
        except EpisodeError:
            yield k


@lru_cache(maxsize=1)
def _world(settings: WorldSettings = EMBEDDED) -> RecordableWorld:
    """The world of this process. Raises ValueError where nothing can be recorded in it."""
    world = make_world(settings.world, **settings.address)
    if not is_recordable(world):
        world.close()
        raise ValueError(
            f"found that {settings.world} shows no images from places on the car, wanted a world that does: type "
            "--world embedded or --world carla"
        )
    return world


def _close_world(settings: WorldSettings = EMBEDDED) -> None:
    """Closes the world of this process, if an episode was recorded in it."""
    if _world.cache_info().currsize:
        _world(settings).close()
        _world.cache_clear()


def _record(config: CollectConfig, folder: Path, number: int, world: WorldSettings = EMBEDDED) -> int:
    """What a worker does: records an episode, and returns its number of frames."""
    return record_episode(_world(world), config, number, folder)


def _record_elsewhere(
    config: CollectConfig, folder: Path, numbers: Sequence[int], workers: int, ray: str
) -> Iterator[tuple[int, int]]:
    """What `parallel_map` does with `_record`, by Ray's workers."""
    for number, (frames, content) in cluster_map(partial(_record_bytes, config, code_version()), numbers, workers, ray):
        write_whole(episode_path(folder, number), content)
        yield number, frames


def _record_bytes(config: CollectConfig, code: str, number: int) -> tuple[int, bytes]:
    """What one of Ray's workers does: records an episode, and returns its number of frames and its file. Raises
    ValueError where this machine's code is another than `code`."""
    if code_version() != code:
        raise ValueError(
            f"found {code_version()} on a machine of the cluster, wanted {code}: install the same caldrive there"
        )
    with TemporaryDirectory() as folder:
        frames = _record(config, Path(folder), number)
        return frames, episode_path(Path(folder), number).read_bytes()


def _check(config: CollectConfig, workers: int) -> None:
    """Raises ValueError or FileNotFoundError for what cannot be recorded, before anything is written."""
    values, usual = asdict(config) | {"workers": workers}, asdict(CollectConfig()) | {"workers": 2}
    require_limits(values, LIMITS, usual)
    if not config.weathers:
        raise ValueError("found no weather in --weathers, wanted one or more: type --weathers 1 8 3 1 8 6")
    for number in config.weathers:
        weather(number)
    require_not_held_out(config.town)
    roads = load_roads(config.town)
    room = {"cars": (0, start_places.room(roads)), "people": (0, sidewalks.room(roads))}
    require_limits(values, room, {name: min(most, usual[name]) for name, (_, most) in room.items()})


def _claim(folder: Path, config: CollectConfig) -> None:
    """Writes down what is recorded in a folder. Raises ValueError where there are episodes of something else."""
    manifest = folder / MANIFEST
    wanted: dict[str, Any] = asdict(config) | {"weathers": list(config.weathers)}
    wanted |= {"format": FORMAT_VERSION, "code": code_version()}
    if any(folder.glob("*.parquet")):
        recorded = _read_manifest(manifest)
        _require_same(folder, recorded, wanted)
        wanted["episodes"] = max(config.episodes, recorded["episodes"])
    write_whole(manifest, (json.dumps(wanted, indent=2) + "\n").encode())


def _read_manifest(path: Path) -> Manifest:
    if not path.is_file():
        raise ValueError(
            f"found episodes in {path.parent}, but no {path.name} that says how they came: give another --out"
        )
    return read_manifest(path)


def _require_same(folder: Path, recorded: Mapping[str, object], wanted: dict[str, Any]) -> None:
    for name, value in wanted.items():
        if name != "episodes" and recorded.get(name) != value:  # a recording may grow
            raise ValueError(
                f"found in {folder} a recording with {name} {recorded.get(name)}, wanted {value}: give another --out"
            )
