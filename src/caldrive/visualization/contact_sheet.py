"""A contact sheet of a town: all weathers or several randomised from a few places, with captions."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path

import numpy as np
from PIL import Image as Picture
from PIL import ImageDraw, ImageFont

from caldrive.checks import MOST_PIXELS, require_within, require_writable_file
from caldrive.datatypes import CameraConfig, Image, LightState, PedestrianState, Pose, VehicleState
from caldrive.files import write_whole
from caldrive.geometry import moved
from caldrive.world.rendering.camera import CameraRig, Shot
from caldrive.world.roads.network import Lane, RoadNetwork
from caldrive.world.roads.towns import load_roads
from caldrive.world.scene.weather import WEATHERS
from caldrive.world.town import load_town

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
    town: str, size: tuple[int, int] = (320, 144), weathers: Sequence[int] = tuple(WEATHERS), randomised: int = 0
) -> Image:
    """A picture (H, W, 3): one column for each view, one row for each weather. Raises as `load_roads` does.

    randomised: if not 0, rows for so many made-up randomised of the town instead, in the weathers in turn.
    """
    roads = load_roads(town)
    rows = [(weathers[k % len(weathers)], k + 1) for k in range(randomised)] or [(id, 0) for id in weathers]
    n_places, cell = len(viewpoints(roads)), (size[0] + MARGIN, size[1] + CAPTION + MARGIN)
    sheet = Picture.new("RGB", (n_places * cell[0] + MARGIN, len(rows) * cell[1] + MARGIN), (24, 25, 27))
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(13)
    for appearance, members in groupby(enumerate(rows), lambda row: row[1][1]):
        camera = CameraRig(load_town(town, appearance))
        for row, (id, _) in members:
            for column, (name, picture) in enumerate(_views(camera, roads, id, size)):
                x, y = MARGIN + column * cell[0], MARGIN + row * cell[1]
                sheet.paste(Picture.fromarray(picture), (x, y + CAPTION))
                look = f", look {appearance}" if appearance else ""
                draw.text((x, y), f"{roads.name}{look}, {id} {WEATHERS[id].name}, {name}", (226, 226, 222), font)
        camera.close()
    return np.asarray(sheet)


def _views(camera: CameraRig, roads: RoadNetwork, weather: int, size: tuple[int, int]) -> Iterator[tuple[str, Image]]:
    """What is to be seen from the viewpoints, with the name of each."""
    states = list(LightState)
    lights = {post.id: states[(k + 2) % 3] for k, post in enumerate(roads.posts)}
    for name, pose in viewpoints(roads):
        cars, people = company(pose)
        shot = Shot(weather, VehicleState(pose), cars, people, lights, time=1.0)
        yield name, camera.render(shot, [CameraConfig(*size)])[0]


def write_sheet(town: str, path: Path, width: int | None = None, randomised: int = 0) -> tuple[int, int]:
    """Writes a town's contact sheet, shrunk or enlarged to a width in pixels if one is given; returns (width, height).
    randomised: see `contact_sheet`.

    Raises ValueError, FileNotFoundError or OSError for an unknown town, a name that is no .png, a locked door.
    """
    require_writable_file(path, "--sheet", ".png")
    if width is not None:
        require_within("--width", width, 16, 4 * MOST_PIXELS, 1920)
    require_within("--randomised", randomised, 0, 100, 8)
    picture = Picture.fromarray(contact_sheet(town, randomised=randomised))
    if width is not None:
        picture = picture.resize((width, round(picture.height * width / picture.width)), Picture.Resampling.LANCZOS)
    content = io.BytesIO()
    picture.save(content, "PNG")
    write_whole(path, content.getvalue())
    return picture.size
