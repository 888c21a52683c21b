"""What many tests share: the two towns, read once, a camera, and a tiny recording."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from caldrive.driving import worker
from caldrive.perception.dataset import Frames
from caldrive.perception.folders import find_episodes
from caldrive.world.camera import Camera
from caldrive.world.roads import RoadNetwork
from caldrive.world.scenery import build_scenery
from caldrive.world.towns import TOWNS, load_town
from caldrive.world.traffic import stop_sumo
from tests.perception_data import HEIGHT, WIDTH, record


@pytest.fixture(scope="session")
def town01() -> RoadNetwork:
    return load_town("town01")


@pytest.fixture(scope="session")
def town02() -> RoadNetwork:
    return load_town("town02")


@pytest.fixture(scope="session", params=TOWNS)
def town(request: pytest.FixtureRequest) -> RoadNetwork:
    """Each of the package's towns."""
    return load_town(request.param)


@pytest.fixture
def fresh_worker() -> Iterator[None]:
    """The test begins like a benchmark's new worker and leaves nothing running."""
    worker._set_up.cache_clear()
    yield
    worker._set_up.cache_clear()
    stop_sumo()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four tiny episodes of a bright column."""
    return record(tmp_path_factory.mktemp("episodes"), n_episodes=4, n_frames=20)


@pytest.fixture(scope="module")
def frames(folder: Path) -> Frames:
    return Frames(find_episodes(folder), (HEIGHT, WIDTH))


@pytest.fixture(scope="module")
def camera(roads: RoadNetwork) -> Iterator[Camera]:
    """The camera of the town that a test file calls `roads`."""
    made = Camera(roads, build_scenery(roads))
    yield made
    made.close()
