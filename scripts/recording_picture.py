"""Draws a moment of a recorded drive from nothing but its MCAP file: the picture of docs/own/viewers.md.

python -m scripts.recording_picture out/drive.mcap 12.5 docs/recording.png
"""

from __future__ import annotations

import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import simplejpeg
from matplotlib.figure import Figure
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from caldrive.files import write_figure

AROUND = 45.0  # m of the map to each side of the car
SHOWN = 12.0  # s of the plots before the moment, and half as many after it
NEAREST, FARTHEST = 1.0, 60.0  # m before the camera between which a box is drawn
EDGES = [(a, b) for a in range(8) for b in range(a) if (a ^ b).bit_count() == 1]  # of a box, by its corners' numbers
CORNERS = np.array([[(k >> axis & 1) - 0.5 for axis in range(3)] for k in range(8)])

Messages = dict[str, list[tuple[float, Any]]]  # times (s) and messages by topic


def read(path: Path) -> Messages:
    """All messages of a file."""
    messages: Messages = defaultdict(list)
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, content in reader.iter_decoded_messages():
            messages[channel.topic].append((message.log_time / 1e9, content))
    return messages


def at(messages: Messages, topic: str, time: float) -> Any:
    """The last message of a topic up to a time."""
    return [content for when, content in messages[topic] if when <= time + 1e-6][-1]


def turn(quaternion: Any) -> Rotation:
    return Rotation.from_quat((quaternion.x, quaternion.y, quaternion.z, quaternion.w))


def vector(v: Any) -> NDArray[np.float64]:
    return np.array((v.x, v.y, v.z))


def boxes(scene: Any) -> list[tuple[NDArray[np.float64], Any]]:
    """The corners (8, 3) and the colour of each box of a scene, in its frame."""
    cubes = [cube for entity in scene.entities for cube in entity.cubes]
    return [
        (turn(c.pose.orientation).apply(CORNERS * vector(c.size)) + vector(c.pose.position), rgba(c.color))
        for c in cubes
    ]


def rgba(color: Any) -> tuple[float, float, float, float]:
    return color.r, color.g, color.b, color.a


def draw_camera(ax: Any, messages: Messages, time: float) -> None:
    """The image, with the others' boxes where the calibration puts them."""
    lens, ego, place = (at(messages, name, time) for name in ("/camera/calibration", "/ego", "/camera/place"))
    ax.imshow(simplejpeg.decode_jpeg(at(messages, "/camera", time).data, colorspace="RGB"), interpolation="bicubic")
    for corners, color in boxes(at(messages, "/others", time)):
        on_ego = turn(ego.rotation).inv().apply(corners - vector(ego.translation))
        seen = turn(place.rotation).inv().apply(on_ego - vector(place.translation))
        if NEAREST < seen[:, 2].min() < FARTHEST:
            u, v, w = np.reshape(lens.K, (3, 3)) @ seen.T
            for a, b in EDGES:
                ax.plot(u[[a, b]] / w[[a, b]], v[[a, b]] / w[[a, b]], color=color, lw=0.8)
    ax.set(xlim=(0, lens.width), ylim=(lens.height, 0), xticks=[], yticks=[], title="/camera, /others through the lens")


def draw_map(ax: Any, messages: Messages, time: float) -> None:
    """The town around the car, from above."""
    ego = at(messages, "/ego", time)
    place, heading = vector(ego.translation), turn(ego.rotation)
    for topic in ("/map", "/route", "/lights"):
        for entity in at(messages, topic, time).entities:
            for line in entity.lines:
                ax.plot([p.x for p in line.points], [p.y for p in line.points], color=rgba(line.color), lw=1.2)
    drawn = [*boxes(at(messages, "/others", time)), *boxes(at(messages, "/lights", time))]
    body = [(heading.apply(corners) + place, color) for corners, color in boxes(at(messages, "/ego/body", time))]
    for corners, color in [*drawn, *body]:
        ax.fill(*corners[[0, 1, 3, 2], :2].T, color=color)
    window = np.array((-AROUND, AROUND))
    ax.set(xlim=place[0] + window, ylim=place[1] + window, xticks=[], yticks=[], aspect="equal")
    ax.set(facecolor="#1a1d22", title="/map, /route, /others, /lights")


def draw_plot(ax: Any, messages: Messages, time: float, fields: dict[str, tuple[str, str]], unit: str) -> None:
    """Fields over time. fields: topic and field by label."""
    for label, (topic, field) in fields.items():
        ax.plot(
            [when for when, _ in messages[topic]], [getattr(content, field) for _, content in messages[topic]],
            label=label, lw=1.5,
        )  # fmt: skip
    ax.axvline(time, color="black", lw=1, ls=":")
    ax.set(xlim=(time - SHOWN, time + SHOWN / 2), ylabel=unit)
    ax.legend(fontsize=8, loc="best")


def picture(messages: Messages, time: float) -> Figure:
    figure = Figure(figsize=(11, 6.4), layout="constrained")
    axes = figure.subplot_mosaic([["camera", "map"], ["distance", "map"], ["speed", "map"]],
                                 width_ratios=(1.25, 1), height_ratios=(1.7, 1, 1))  # fmt: skip
    draw_camera(axes["camera"], messages, time)
    draw_map(axes["map"], messages, time)
    distance = {f"/affordances/{kind}.vehicle_distance": (f"/affordances/{kind}", "vehicle_distance")
                for kind in ("true", "predicted")}  # fmt: skip
    draw_plot(axes["distance"], messages, time, distance, "m")
    speed = {f"/signals.{field}": ("/signals", field) for field in ("speed", "target")}
    draw_plot(axes["speed"], messages, time, speed, "m/s")
    axes["speed"].set_xlabel(
        f'time in s; /controller.state at the dotted line: "{at(messages, "/controller", time).state}"'
    )
    return figure


if __name__ == "__main__":
    write_figure(Path(sys.argv[3]), picture(read(Path(sys.argv[1])), float(sys.argv[2])), dpi=110)
