"""What many tests share: the two towns, read once."""

from __future__ import annotations

import pytest

from caldrive.world.roads import RoadNetwork
from caldrive.world.towns import TOWNS, load_town


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
