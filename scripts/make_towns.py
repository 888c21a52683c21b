"""Draws docs/towns.jpg: generated towns from above, each beside what a camera sees there.

python -m scripts.make_towns [--kind random-wide] [--out docs/towns.jpg] [--first 1000] [--towns 24]
"""

from __future__ import annotations

import argparse
import io
from pathlib import Path

import numpy as np
from PIL import Image as Picture
from PIL import ImageDraw, ImageFont

from caldrive.datatypes import CameraConfig, Image, LightState, Points, VehicleState
from caldrive.files import write_whole
from caldrive.scenarios import GeneratedTown
from caldrive.visualization.contact_sheet import (
    BACKGROUND,
    CAPTION,
    MARGIN,
    TEXT,
    cars_and_people,
    viewpoints,
)
from caldrive.world.rendering.camera import CameraRig, SceneState
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.towns import load_roads
from caldrive.world.town import load_town

PLAN, COLUMNS, QUALITY = 210, 4, 60  # pixels of a plan's width; towns in a row; of the JPEG
WEATHERS = (1, 3, 6, 8)
VIEW = (290, 210)  # pixels of a camera's image
FINE, ROOM = 4, 5.0  # a plan is drawn so many times as large, then made small; m around the town
LANE, SIGN, LIGHT = (120, 140, 165), (240, 240, 240), (235, 80, 70)


def town_picture(town: str, number: int) -> Image:
    """A town from above (H, W, 3), and to its right what a camera sees there."""
    roads = load_roads(town)
    places = viewpoints(roads)
    _, pose = places[number % len(places)]
    camera = CameraRig(load_town(town))
    lights = {post.id: list(LightState)[number % 3] for post in roads.posts}
    state = SceneState(WEATHERS[number % 4], VehicleState(pose), *cars_and_people(pose), lights, time=1.0)
    picture = Picture.new("RGB", (PLAN + VIEW[0] + 2 * MARGIN, VIEW[1] + CAPTION + MARGIN), BACKGROUND)
    picture.paste(plan(roads), (0, CAPTION))
    picture.paste(Picture.fromarray(camera.render(state, [CameraConfig(*VIEW)])[0]), (PLAN + MARGIN, CAPTION))
    camera.close()
    kilometres = sum(lane.line.length for lane in roads.driveable) / 1000
    text = f"{town}: {kilometres:.1f} km of lanes that are {roads.driveable[0].width:.1f} m wide"
    ImageDraw.Draw(picture).text((0, 0), text, TEXT, ImageFont.load_default(13))
    return np.asarray(picture)


def plan(roads: RoadNetwork) -> Picture.Image:
    """The lanes from above in PLAN x VIEW[1] pixels, with junctions, lights (red) and speed signs (white)."""
    middle = np.array([roads.bounds[:2], roads.bounds[2:]]).mean(axis=0)
    reach = np.array(roads.bounds[2:]) - roads.bounds[:2] + 4 * ROOM
    scale = FINE * min(PLAN / reach[0], VIEW[1] / reach[1])
    size = (FINE * PLAN, FINE * VIEW[1])
    picture = Picture.new("RGB", size, BACKGROUND)
    draw = ImageDraw.Draw(picture)

    def places(points: Points) -> list[tuple[float, float]]:
        x, y = ((points - middle) * scale).T
        return [(size[0] / 2 + a, size[1] / 2 - b) for a, b in zip(x.tolist(), y.tolist(), strict=True)]

    for lane in roads.driveable:
        draw.line(places(lane.line.points), LANE, round(max(FINE, lane.width * scale)), joint="curve")
    for things, colour in ((roads.signs, SIGN), (roads.posts, LIGHT)):
        for x, y in places(np.array([(thing.pose.x, thing.pose.y) for thing in things]).reshape(-1, 2)):
            draw.circle((x, y), 1.6 * FINE, colour)
    return picture.resize((PLAN, VIEW[1]), Picture.Resampling.LANCZOS)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kind", default="random")
    parser.add_argument("--out", type=Path, default=Path("docs/towns.jpg"))
    parser.add_argument("--first", type=int, default=1000)
    parser.add_argument("--towns", type=int, default=24)
    options = parser.parse_args()
    towns = [GeneratedTown(options.kind, options.first + k).name for k in range(options.towns)]
    pictures = [town_picture(town, k) for k, town in enumerate(towns)]
    rows = [np.concatenate(pictures[k : k + COLUMNS], axis=1) for k in range(0, len(pictures), COLUMNS)]
    content = io.BytesIO()
    Picture.fromarray(np.concatenate(rows)).save(content, "JPEG", quality=QUALITY)
    write_whole(options.out, content.getvalue())


if __name__ == "__main__":
    main()
