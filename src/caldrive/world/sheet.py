"""A contact sheet of a town: all weathers or several looks from a few places, with captions."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import groupby

import numpy as np
from PIL import Image as Picture
from PIL import ImageDraw, ImageFont

from caldrive.config import CameraConfig
from caldrive.datatypes import Image, LightState, PedestrianState, Pose, VehicleState
from caldrive.geometry import moved
from caldrive.world.camera import Camera
from caldrive.world.redecoration import redecorated
from caldrive.world.roads import Lane, RoadNetwork
from caldrive.world.scenery import build_scenery
from caldrive.world.towns import load_town
from caldrive.world.weather import WEATHERS

MARGIN, CAPTION = 6, 18  # px


def viewpoints(roads: RoadNetwork) -> list[tuple[str, Pose]]:
    """Places that show what matters: a light, a speed sign, a bend."""
    found = []
    if roads.posts:
        lane = roads.lanes[roads.posts[len(roads.posts) // 3].lane]
        found.append(("light", lane.line.pose_at(max(0.0, lane.line.length - 13))))
    if roads.signs:
        sign = max(roads.signs, key=lambda s: s.limit)
        found.append(("sign", moved(sign.pose, forward=-12, left=3.1)))
    lane = max(roads.driveable, key=_bend)
    found.append(("bend", lane.line.pose_at(0.0)))
    return found


def _bend(lane: Lane) -> float:
    return abs(float(lane.line.headings[-1] - lane.line.headings[0])) if lane.line.length > 15 else 0.0


def company(pose: Pose) -> tuple[list[VehicleState], list[PedestrianState]]:
    """A few cars and people around a place."""
    cars = [(15.0, 0.0, 0.0), (24.0, 3.9, math.pi), (36.0, 0.0, 0.0), (9.0, 3.9, math.pi)]
    people = [(9.0, 1.6, -math.pi / 2), (8.0, -3.6, 0.0), (12.0, -4.2, math.pi), (17.0, 7.5, math.pi)]
    return (
        [VehicleState(moved(pose, *at), 0.0 if at[0] == 15.0 else 5.0, id=f"car {k}") for k, at in enumerate(cars)],
        [PedestrianState(moved(pose, *at), 1.3, on_road=k == 0, id=f"person {k}") for k, at in enumerate(people)],
    )


def contact_sheet(
    town: str, size: tuple[int, int] = (320, 144), weathers: Sequence[int] = tuple(WEATHERS), looks: int = 0
) -> Image:
    """A picture (H, W, 3): one column for each view, one row for each weather. Raises as `load_town` does.

    looks: if not 0, rows for so many made-up looks of the town instead, in the weathers in turn.
    """
    roads = load_town(town)
    rows = [(weathers[k % len(weathers)], k + 1) for k in range(looks)] or [(id, 0) for id in weathers]
    n_places, cell = len(viewpoints(roads)), (size[0] + MARGIN, size[1] + CAPTION + MARGIN)
    sheet = Picture.new("RGB", (n_places * cell[0] + MARGIN, len(rows) * cell[1] + MARGIN), (24, 25, 27))
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(13)
    for arrangement, members in groupby(enumerate(rows), lambda row: row[1][1]):
        camera = Camera(roads, build_scenery(roads, arrangement), redecorated(roads.style, arrangement))
        for row, (id, _) in members:
            for column, (name, picture) in enumerate(_views(camera, roads, id, size)):
                x, y = MARGIN + column * cell[0], MARGIN + row * cell[1]
                sheet.paste(Picture.fromarray(picture), (x, y + CAPTION))
                look = f", look {arrangement}" if arrangement else ""
                draw.text((x, y), f"{roads.name}{look}, {id} {WEATHERS[id].name}, {name}", (226, 226, 222), font)
        camera.close()
    return np.asarray(sheet)


def _views(camera: Camera, roads: RoadNetwork, weather: int, size: tuple[int, int]) -> Iterator[tuple[str, Image]]:
    """What is to be seen from the viewpoints, with the name of each."""
    states = list(LightState)
    lights = {post.id: states[(k + 2) % 3] for k, post in enumerate(roads.posts)}
    for name, pose in viewpoints(roads):
        cars, people = company(pose)
        yield name, camera.render(weather, VehicleState(pose), cars, people, lights, [CameraConfig(*size)], 1.0)[0]
