"""What many tests share: the two towns, read once, a camera, and a tiny recording.

Every run of pytest reads this file first, so what takes seconds to import is imported by the fixtures that need it.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, settings

from caldrive.scenarios import TOWNS

if TYPE_CHECKING:
    from caldrive.perception.dataset.frames import Frames
    from caldrive.world.rendering.camera import CameraRig
    from caldrive.world.roads.network import RoadNetwork

# How fast drawn examples come tells how busy the machine is.
settings.register_profile("busy", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("busy")


def _roads(town: str) -> RoadNetwork:
    from caldrive.world.roads.towns import load_roads

    return load_roads(town)


@pytest.fixture(scope="session")
def town01() -> RoadNetwork:
    return _roads("town01")


@pytest.fixture(scope="session")
def town02() -> RoadNetwork:
    return _roads("town02")


@pytest.fixture(scope="session", params=TOWNS)
def town(request: pytest.FixtureRequest) -> RoadNetwork:
    """Each of the package's towns."""
    return _roads(request.param)


@pytest.fixture
def no_sumo_left() -> Iterator[None]:
    """The test leaves no SUMO running."""
    from caldrive.world.traffic.sumo_process import stop_sumo

    yield
    stop_sumo()


@pytest.fixture
def fresh_worker(no_sumo_left: None) -> Iterator[None]:
    """The test begins like a benchmark's new worker and leaves nothing running."""
    from caldrive.benchmark import runner

    runner._worker.cache_clear()
    yield
    runner._worker.cache_clear()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four tiny episodes of a bright column."""
    from tests.perception.data import record

    return record(tmp_path_factory.mktemp("episodes"), n_episodes=4, n_frames=20)


@pytest.fixture(scope="module")
def frames(folder: Path) -> Frames:
    from caldrive.perception.dataset.frames import Frames
    from caldrive.recordings.folder import find_episodes
    from tests.perception.data import HEIGHT, WIDTH

    return Frames(find_episodes(folder), (HEIGHT, WIDTH))


@pytest.fixture(scope="module")
def camera(roads: RoadNetwork) -> Iterator[CameraRig]:
    """The camera rig of the town that a test file calls `roads`."""
    from caldrive.world.rendering.camera import CameraRig
    from caldrive.world.town import load_town

    rig = CameraRig(load_town(roads.name))
    yield rig
    rig.close()
