"""Where a picture's time goes: `python -m scripts.camera_parts [weather]` prints milliseconds for each step of it.

The steps are parts of one compiled function; here they are called one by one, on the states of a drive through town01.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from contextlib import closing
from statistics import median
from time import perf_counter

import numpy as np

from caldrive.agents.cal import CALAgent, OraclePerception
from caldrive.control.controller import CALController, ControlConfig
from caldrive.datatypes import CameraConfig
from caldrive.driving.settings import WorldSpeedSettings
from caldrive.driving.speed import start_drive
from caldrive.world.embedded import EmbeddedWorld
from caldrive.world.rendering import overlays, picture
from caldrive.world.rendering.camera import CameraRig, SceneState
from caldrive.world.rendering.fragments import SAMPLES, seen
from caldrive.world.rendering.pinhole import camera_on
from caldrive.world.rendering.rasteriser import rasterise
from caldrive.world.rendering.spots import Scene
from caldrive.world.rendering.surfaces import shade

STEPS = 200


class Laps:
    """Milliseconds of each step."""

    def __init__(self) -> None:
        self.steps: dict[str, list[float]] = defaultdict(list)
        self._last = perf_counter()

    def note(self, step: str) -> None:
        """A step that began when the last one ended ends now."""
        now = perf_counter()
        self.steps[step].append(1000 * (now - self._last))
        self._last = perf_counter()


def draw_in_steps(rig: CameraRig, state: SceneState, laps: Laps) -> None:
    """One picture of 200 x 88 pixels."""
    camera = camera_on(state.ego, CameraConfig())
    drawn = rig._drawn(camera, state)
    laps.note("what may be in view (Python)")
    light, materials = rig._atmosphere.in_weather(state.weather, state.ego.pose.x, state.ego.pose.y)
    scene, canvas = Scene(materials, light, camera.view()), rig._canvas(camera.size, SAMPLES)
    lamps, room, sheet = rig._lamps.lit(state.lights, float(light.wetness)), canvas._room_of(drawn), canvas.sheet
    laps.note("camera, light, room (Python)")
    n = picture._project(room.corners, room.sources, drawn, scene.camera)
    laps.note("project")
    rasterise(room.corners, n, sheet.depths, sheet.shown, sheet.scratch.polygon)
    laps.note("rasterise")
    many = seen(sheet.shown, n, room.order, room.seen)
    laps.note("number what is seen")
    picture._surfaces(many, room, drawn, scene, sheet)
    laps.note("light the triangles seen")
    shade(sheet.shown, room.surfaces, scene, sheet.fragments, sheet.pixels)
    laps.note("shade pixels")
    overlays.draw_shadows(sheet.colors, sheet.depths, drawn.actors.shadows, scene.camera.matrix, light, sheet.scratch)
    overlays.draw_lamps(sheet.colors, sheet.depths, lamps, scene.camera, sheet.scratch)
    if light.rain > 0:
        overlays.draw_rain(sheet.colors, rig._drops, scene.camera.focal, np.float32(state.time), light)
    laps.note("shadows, lamps, rain")


def main(weather: int = 1) -> None:
    """Prints the median of each step."""
    world, laps = EmbeddedWorld(), Laps()
    agent = CALAgent(OraclePerception(world.truth), CALController(ControlConfig(cap=30.0), world.dt))
    with closing(world):
        observation = start_drive(world, WorldSpeedSettings(weather=weather, steps=STEPS))
        rig = CameraRig(world.town)
        for _ in range(STEPS):
            observation = world.step(agent.act(observation))
            laps.note("(the world)")
            draw_in_steps(rig, world.scene(), laps)
    for step, milliseconds in laps.steps.items():
        if not step.startswith("("):
            print(f"{step:30s} {median(milliseconds):.3f} ms")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
