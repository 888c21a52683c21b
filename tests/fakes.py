"""The world of one road as tests know it: somebody's own world, from outside of the package."""

from __future__ import annotations

from caldrive.tune.road import CAR, IMAGE, SingleRoad, turn_route

__all__ = ["CAR", "IMAGE", "StraightRoad", "turn_route"]


class StraightRoad(SingleRoad):
    """A `SingleRoad`, straight on where no route is given."""
