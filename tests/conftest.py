"""What many tests share: the two towns, read once, a camera, and a tiny recording."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from caldrive.benchmark import runner
from caldrive.perception.dataset.frames import Frames
from caldrive.recordings.folder import find_episodes
from caldrive.scenarios import TOWNS
from caldrive.world.rendering.camera import CameraRig
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.towns import load_roads
from caldrive.world.town import load_town
from caldrive.world.traffic.sumo_process import stop_sumo
from tests.perception.data import HEIGHT, WIDTH, record


@pytest.fixture(scope="session")
def town01() -> RoadNetwork:
    return load_roads("town01")


@pytest.fixture(scope="session")
def town02() -> RoadNetwork:
    return load_roads("town02")


@pytest.fixture(scope="session", params=TOWNS)
def town(request: pytest.FixtureRequest) -> RoadNetwork:
    """Each of the package's towns."""
    return load_roads(request.param)


@pytest.fixture
def no_sumo_left() -> Iterator[None]:
    """The test leaves no SUMO running."""
    yield
    stop_sumo()


@pytest.fixture
def fresh_worker(no_sumo_left: None) -> Iterator[None]:
    """The test begins like a benchmark's new worker and leaves nothing running."""
    runner._worker.cache_clear()
    yield
    runner._worker.cache_clear()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four tiny episodes of a bright column."""
    return record(tmp_path_factory.mktemp("episodes"), n_episodes=4, n_frames=20)


@pytest.fixture(scope="module")
def frames(folder: Path) -> Frames:
    return Frames(find_episodes(folder), (HEIGHT, WIDTH))


@pytest.fixture(scope="module")
def camera(roads: RoadNetwork) -> Iterator[CameraRig]:
    """The camera rig of the town that a test file calls `roads`."""
    rig = CameraRig(load_town(roads.name))
    yield rig
    rig.close()
