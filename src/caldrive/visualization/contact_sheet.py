"""A contact sheet of a town: camera images from a few places, in all weathers or in random looks, with captions, and
below them the whole town from above."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path

import numpy as np
from PIL import Image as Picture
from PIL import ImageDraw, ImageFont

from caldrive.checks import MOST_LOOKS, MOST_PIXELS, require_within, require_writable_file
from caldrive.datatypes import CameraConfig, Image, LightState, PedestrianState, Pose, VehicleState
from caldrive.files import write_whole
from caldrive.geometry import moved
from caldrive.visualization.town_plan import LEAST_WIDTH, TownPlan
from caldrive.world.rendering.camera import CameraRig, SceneState
from caldrive.world.roads.network import Lane, RoadNetwork
from caldrive.world.roads.towns import load_roads
from caldrive.world.scene.weather import WEATHERS
from caldrive.world.town import load_town

FEWEST_COLUMNS = 3  # wide enough for the town below
RECORDED = (1, 3, 6, 8)  # weathers in which random looks are recorded
MARGIN, CAPTION = 6, 18  # pixels between images, and of height of the line above each
BACKGROUND, TEXT = (24, 25, 27), (226, 226, 222)
BEFORE_LIGHT = 13.0  # m from the viewpoint to the stop line
BEFORE_SIGN, LEFT_OF_SIGN = 12.0, 3.1  # m from the viewpoint to the sign
SHORTEST_BEND = 15.0  # m; on shorter lanes there is little to see

# Cars and people around a viewpoint: m ahead, m to the left, rad turned to the left.
CARS = ((15.0, 0.0, 0.0), (24.0, 3.9, math.pi), (36.0, 0.0, 0.0), (9.0, 3.9, math.pi))
PEOPLE = ((9.0, 1.6, -math.pi / 2), (8.0, -3.6, 0.0), (12.0, -4.2, math.pi), (17.0, 7.5, math.pi))


def viewpoints(roads: RoadNetwork) -> list[tuple[str, Pose]]:
    """Places that show what matters, each with its name: a light, a speed sign, a bend."""
    places = []
    if roads.posts:
        lane = roads.lanes[roads.posts[len(roads.posts) // 3].lane]
        places.append(("light", lane.line.pose_at(max(0.0, lane.line.length - BEFORE_LIGHT))))
    if roads.signs:
        sign = max(roads.signs, key=lambda sign: sign.limit)
        places.append(("sign", moved(sign.pose, forward=-BEFORE_SIGN, left=LEFT_OF_SIGN)))
    lane = max(roads.driveable, key=_bend)
    places.append(("bend", lane.line.pose_at(0.0)))
    return places


def _bend(lane: Lane) -> float:
    """How far a lane turns, rad."""
    if lane.line.length <= SHORTEST_BEND:
        return 0.0
    return abs(float(lane.line.headings[-1] - lane.line.headings[0]))


def cars_and_people(pose: Pose) -> tuple[list[VehicleState], list[PedestrianState]]:
    """A few cars and people around a place; the first car stands, the first person is on the road."""
    cars = [VehicleState(moved(pose, *place), 0.0 if k == 0 else 5.0, id=f"car {k}") for k, place in enumerate(CARS)]
    people = [
        PedestrianState(moved(pose, *place), 1.3, on_road=k == 0, id=f"person {k}") for k, place in enumerate(PEOPLE)
    ]
    return cars, people


def contact_sheet(
    town: str, size: tuple[int, int] = (320, 144), weathers: Sequence[int] = tuple(WEATHERS), randomised: int = 0
) -> Image:
    """A picture (H, W, 3): a column for each viewpoint, a row for each weather, and the town's plan below; size of each
    image: (width, height).

    randomised: where it is not 0, the number of random looks of the town to show instead, one in each row, in the
    weathers of a recording in turn. Raises ValueError or FileNotFoundError as `load_roads` does.
    """
    roads = load_roads(town)
    rows = [(look, RECORDED[(look - 1) % len(RECORDED)]) for look in range(1, randomised + 1)]
    rows = rows or [(0, weather) for weather in weathers]
    cell = (size[0] + MARGIN, size[1] + CAPTION + MARGIN)
    columns = max(len(viewpoints(roads)), FEWEST_COLUMNS)
    sheet = Picture.new("RGB", (columns * cell[0] + MARGIN, len(rows) * cell[1] + MARGIN), BACKGROUND)
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(13)
    for look, group in groupby(enumerate(rows), lambda row: row[1][0]):
        camera = CameraRig(load_town(town, look))
        for row, (_, weather) in group:
            for column, (name, image) in enumerate(_views(camera, roads, weather, size)):
                x, y = MARGIN + column * cell[0], MARGIN + row * cell[1]
                sheet.paste(Picture.fromarray(image), (x, y + CAPTION))
                draw.text((x, y), _caption(roads.name, look, weather, name), TEXT, font)
        camera.close()
    return np.concatenate((np.asarray(sheet), whole_town(roads, sheet.width)))


def whole_town(roads: RoadNetwork, width: int) -> Image:
    """A town from above (H, W, 3), so many pixels wide."""
    picture = Picture.fromarray(TownPlan(roads, LEAST_WIDTH).picture(""))
    height = max(1, round(picture.height * width / picture.width))
    return np.asarray(picture.resize((width, height), Picture.Resampling.LANCZOS))


def _caption(town: str, look: int, weather: int, place: str) -> str:
    random_look = f", look {look}" if look else ""
    return f"{town}{random_look}, {weather} {WEATHERS[weather].name}, {place}"


def _views(camera: CameraRig, roads: RoadNetwork, weather: int, size: tuple[int, int]) -> Iterator[tuple[str, Image]]:
    """The images from the viewpoints, each with the name of its place."""
    states = list(LightState)
    lights = {post.id: states[(k + 2) % 3] for k, post in enumerate(roads.posts)}
    for name, pose in viewpoints(roads):
        cars, people = cars_and_people(pose)
        state = SceneState(weather, VehicleState(pose), cars, people, lights, time=1.0)
        yield name, camera.render(state, [CameraConfig(*size)])[0]


def write_sheet(town: str, path: Path, width: int | None = None, randomised: int = 0) -> tuple[int, int]:
    """Writes a town's contact sheet as a PNG; returns (width, height) in pixels.

    width: shrinks or enlarges the sheet to so many pixels; randomised: see `contact_sheet`. Raises ValueError,
    FileNotFoundError or OSError for an unknown town, a name that is no .png, a place that cannot be written to.
    """
    require_writable_file(path, "--sheet", ".png")
    if width is not None:
        require_within("--width", width, 16, 4 * MOST_PIXELS, 1920)
    require_within("--randomised", randomised, 0, MOST_LOOKS, 8)
    picture = Picture.fromarray(contact_sheet(town, randomised=randomised))
    if width is not None:
        picture = picture.resize((width, round(picture.height * width / picture.width)), Picture.Resampling.LANCZOS)
    content = io.BytesIO()
    picture.save(content, "PNG")
    write_whole(path, content.getvalue())
    return picture.size
