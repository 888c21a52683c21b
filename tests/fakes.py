"""Names under which tests know the world of one road."""

from __future__ import annotations

from caldrive.tune.road import CAR, IMAGE, turn_route
from caldrive.tune.road import SingleRoad as StraightRoad

__all__ = ["CAR", "IMAGE", "StraightRoad", "turn_route"]
