"""The picture of a drive: what the camera sees, and below it why the car does what it does.

An agent may give no decision, or only parts of one; what it does not give is left out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from PIL import Image as Picture
from PIL import ImageDraw

from caldrive.control.longitudinal import DriveState
from caldrive.datatypes import KMH, CameraConfig, Command, Control, Decision, Image, Step
from caldrive.results import EpisodeResult, Infraction, Outcome
from caldrive.visualization.gauges import (
    BACKGROUND,
    BLUE,
    DARK_TEXT,
    GREEN,
    MUTED,
    RED,
    TEXT,
    Box,
    Color,
    Draw,
    draw_frame,
    draw_gauges,
    fill,
    font,
    tick,
    track,
    write,
)
from caldrive.visualization.minimap import MiniMap

CAMERA = CameraConfig(width=960, height=432)
PANEL = 224  # pixels of height below the camera's picture
SIZE = (CAMERA.width, CAMERA.height + PANEL)
HEADER = 34  # pixels of height of the line above the picture
BANNER_TIME = 2.0  # s that an infraction stays on the screen
TILE = (16, 16, 112, 112)  # where the sign of the command is
SPEED, SIGN = (226, 56), (276, 56)
PEDALS = ("throttle", "brake", "steer")

OTHER_STATE: Color = (80, 90, 105)  # of an agent with states of its own
STATES: dict[str, Color] = {
    DriveState.CRUISING: (34, 140, 80),
    DriveState.FOLLOWING: (40, 105, 190),
    DriveState.OVER_LIMIT: (180, 115, 10),
    DriveState.RED_LIGHT: (200, 50, 40),
    DriveState.HAZARD_STOP: (185, 35, 105),
    DriveState.CREEPING: (120, 110, 20),
    DriveState.BLIND: (105, 105, 105),
}
# The outlines of arrows in a square from (-1, -1) to (1, 1), y down, for going straight and to the right.
STRAIGHT_ARROW = ((0, -0.78), (0.5, -0.2), (0.18, -0.2), (0.18, 0.78), (-0.18, 0.78), (-0.18, -0.2), (-0.5, -0.2))
RIGHT_ARROW = ((0.8, -0.2), (0.25, 0.3), (0.25, -0.02), (-0.12, -0.02), (-0.12, 0.75), (-0.48, 0.75), (-0.48, -0.38),
               (0.25, -0.38), (0.25, -0.7))  # fmt: skip


@lru_cache(maxsize=3)
def command_sign(command: Command) -> Picture.Image:
    """A blue sign with a white arrow."""
    side, scale = int(TILE[2] - TILE[0]), 4
    picture = Picture.new("RGB", (side * scale, side * scale), BACKGROUND)
    draw, half = ImageDraw.Draw(picture), side * scale / 2
    draw.rounded_rectangle((0, 0, 2 * half - 1, 2 * half - 1), half / 5, fill=(28, 88, 176))
    outline = STRAIGHT_ARROW if command is Command.STRAIGHT else RIGHT_ARROW
    mirror = -1 if command is Command.LEFT else 1
    draw.polygon([(half * (1 + 0.85 * mirror * x), half * (1 + 0.85 * y)) for x, y in outline], fill=TEXT)
    return picture.reduce(scale)


def draw_command(panel: Picture.Image, draw: Draw, command: Command) -> None:
    """The sign of the command in the panel's corner, and its name below."""
    panel.paste(command_sign(command), (TILE[0], TILE[1]))
    write(draw, (64, 128), command.value, 16, TEXT, "mm")


@lru_cache(maxsize=2)
def _frame(truth: bool) -> Picture.Image:
    """What never changes of the panel."""
    panel = Picture.new("RGB", (CAMERA.width, PANEL), BACKGROUND)
    draw = ImageDraw.Draw(panel)
    draw_frame(draw, truth)
    write(draw, (SPEED[0] - 36, SPEED[1] + 44), "km/h", 14, MUTED, "mm")
    for row, name in enumerate(PEDALS):
        write(draw, (16, _bar(row)[1] + 5), name, 14, MUTED)
        track(draw, _bar(row))
    return panel


def _bar(row: int) -> Box:
    """The bar of a pedal or of the steering wheel."""
    top = 151 + 24 * row
    return 84, top, 296, top + 10


@lru_cache(maxsize=8)
def _sign(limit: str) -> Picture.Image:
    """A round speed sign."""
    side, scale = 46, 4
    picture = Picture.new("RGB", (side * scale, side * scale), BACKGROUND)
    draw, edge = ImageDraw.Draw(picture), side * scale - 1
    draw.ellipse((0, 0, edge, edge), fill=(245, 245, 245), outline=(215, 40, 40), width=6 * scale)
    write(draw, (edge / 2, edge / 2), limit, 19 * scale, DARK_TEXT, "mm")
    return picture.reduce(scale)


def _draw_speed(panel: Picture.Image, draw: Draw, speed: float, decision: Decision) -> None:
    """The speed (m/s) in km/h, and the limit and the target where the agent gives them."""
    write(draw, SPEED, f"{speed / KMH:.0f}", 60, TEXT, "rm")
    if decision.speed_limit is not None and math.isfinite(decision.speed_limit):
        panel.paste(_sign(f"{decision.speed_limit:.0f}"), (SIGN[0] - 23, SIGN[1] - 40))
    if decision.target_speed is not None and math.isfinite(decision.target_speed):
        write(draw, (SIGN[0], SIGN[1] + 24), "target", 13, MUTED, "mm")
        write(draw, (SIGN[0], SIGN[1] + 41), f"{decision.target_speed:.0f}", 16, TEXT, "mm")


def _draw_controls(draw: Draw, control: Control) -> None:
    """How far the pedals and the wheel are turned; the wheel's bar grows to the side that it is turned to."""
    fill(draw, _bar(0), 0.0, control.throttle, GREEN)
    fill(draw, _bar(1), 0.0, control.brake, RED)
    fill(draw, _bar(2), 0.5, 0.5 - control.steer / 2, BLUE)
    tick(draw, _bar(2), 0.5, MUTED)


class Hud:
    """Draws one episode's frames. caption: what stands above the picture; time_limit in s.

    truth: whether the true affordances stand beside those that the agent goes by.
    """

    def __init__(self, caption: str, time_limit: float, minimap: MiniMap | None, truth: bool) -> None:
        self.caption, self.time_limit, self.minimap, self.truth = caption, time_limit, minimap, truth

    def draw(self, view: Image, step: Step, infractions: Sequence[Infraction]) -> Image:
        """A frame (656, 960, 3) from the camera's picture (432, 960, 3)."""
        return np.concatenate((self._view(view, step, infractions), self._panel(step)))

    def _panel(self, step: Step) -> Image:
        panel = _frame(self.truth).copy()
        draw = ImageDraw.Draw(panel)
        decision = step.decision or Decision(step.control)
        draw_command(panel, draw, step.observation.command)
        _draw_speed(panel, draw, step.observation.speed, decision)
        _draw_controls(draw, step.control)
        draw_gauges(draw, decision.affordances, step.truth.affordances if self.truth else None)
        if self.minimap is not None:
            panel.paste(self.minimap.draw(step.truth), (CAMERA.width - PANEL, 0))
        return np.asarray(panel)

    def _view(self, view: Image, step: Step, infractions: Sequence[Infraction]) -> Image:
        """The camera's picture under a line with the time, the state and what just went wrong."""
        view = view.copy()
        view[:HEADER] = view[:HEADER] // 3
        picture = Picture.fromarray(view)
        draw = ImageDraw.Draw(picture)
        write(draw, (16, HEADER / 2), self.caption, 17)
        limit = f" / {self.time_limit:.0f}" if math.isfinite(self.time_limit) else ""
        write(draw, (CAMERA.width - 16, HEADER / 2), f"{step.truth.time:.1f}{limit} s", 17, TEXT, "rm")
        _draw_state(draw, step.decision)
        recent = [infraction for infraction in infractions if step.truth.time - infraction.time < BANNER_TIME]
        if recent:
            _banner(draw, CAMERA.height - 40, recent[-1].kind.value, RED)
        return np.asarray(picture)


def _draw_state(draw: Draw, decision: Decision | None) -> None:
    """The agent's state with its note, or the note alone, or nothing."""
    if decision is None:
        return
    if decision.state is not None:
        draw_badge(draw, (16, HEADER + 12), decision.state, STATES.get(decision.state, OTHER_STATE), decision.note)
    elif decision.note:
        write(draw, (16, HEADER + 28), decision.note, 16)


def draw_badge(draw: Draw, at: tuple[float, float], text: str, color: Color, note: str) -> None:
    """A coloured label with a word in capitals, and a note beside it if there is one."""
    width = draw.textlength(text.upper(), font(17)) + 28
    draw.rounded_rectangle((at[0], at[1], at[0] + width, at[1] + 32), 8, fill=color)
    write(draw, (at[0] + width / 2, at[1] + 16), text.upper(), 17, TEXT, "mm")
    if note:
        write(draw, (at[0] + width + 12, at[1] + 16), note, 16)


def _banner(draw: Draw, y: float, text: str, color: Color) -> None:
    """A message in the middle of the picture at height y."""
    half = draw.textlength(text, font(22)) / 2 + 24
    middle = CAMERA.width / 2
    draw.rounded_rectangle((middle - half, y - 22, middle + half, y + 22), 10, fill=color)
    write(draw, (middle, y), text, 22, TEXT, "mm")


def with_outcome(frame: Image, result: EpisodeResult) -> Image:
    """A frame with the episode's outcome across the picture."""
    picture = Picture.fromarray(frame)
    color = (34, 140, 80) if result.outcome is Outcome.SUCCESS else (180, 115, 10)
    _banner(ImageDraw.Draw(picture), CAMERA.height / 2, result.outcome.value, color)
    return np.asarray(picture)
