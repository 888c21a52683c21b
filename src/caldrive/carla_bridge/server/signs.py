"""The speed signs of a town as CARLA's actors."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence

from caldrive.carla_bridge.axes import standing
from caldrive.carla_bridge.server.actors import Actor, description
from caldrive.carla_bridge.server.layouts import BoundingBox, Vector
from caldrive.datatypes import Pose, Sign
from caldrive.geometry import moved, to_local
from caldrive.world.roads.network import POST_BESIDE_LANE, RoadNetwork
from caldrive.world.town import Town

TRIGGER = 2.0  # m: half the length of a trigger volume
USUAL_WIDTH = 4.0  # m of a lane that is not found
INTO_LANE = 1.0  # m from the edge of a lane, where it is looked up


def sign_actors(town: Town, numbers: Iterator[int], ids: dict[tuple[Pose, int], str]) -> list[Actor]:
    """One for each post. numbers: for actors; ids: on the map, by where signs stand and their limits."""
    posts: defaultdict[tuple[Pose, int], list[Sign]] = defaultdict(list)
    for sign in town.signs:
        posts[sign.stands_at, sign.limit].append(sign)
    return [
        Actor(
            next(numbers), description(f"traffic.speed_limit.{limit}"), standing(foot),
            box=trigger_volume(foot, signs, town.roads), sign=ids.get((foot, limit), ""),
        )
        for (foot, limit), signs in posts.items()
    ]  # fmt: skip


def trigger_volume(foot: Pose, signs: Sequence[Sign], roads: RoadNetwork) -> BoundingBox:
    """The lanes that the signs on a post are for, as a box relative to it; what is to its left within a junction."""
    ends = []
    for sign in signs:
        try:
            lane, s = roads.lane_at(moved(sign.pose, left=POST_BESIDE_LANE + INTO_LANE))
        except ValueError:
            continue
        middle = lane.line.pose_at(s)
        ahead, left = to_local(foot, (middle.x, middle.y)).tolist()  # type: ignore[arg-type]
        ends += [(ahead, left - lane.width / 2), (ahead, left + lane.width / 2)]
    ends = ends or [(0.0, 0.0), (0.0, USUAL_WIDTH)]
    lefts = [left for _, left in ends]
    middle_left, half = (max(lefts) + min(lefts)) / 2, (max(lefts) - min(lefts)) / 2
    return BoundingBox(Vector(ends[0][0], -middle_left, 1.0), Vector(TRIGGER, half, 1.0))
