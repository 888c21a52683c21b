"""What a recording says of a drive: channels of messages, as plain data that any writer can write.

`mcap_file` writes them into a file, `rerun_view` shows them live. A new affordance needs nothing here: the channels'
fields follow from the table `affordances.SPECS`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import simplejpeg
from PIL import Image as PillowImage

from caldrive.affordances import SPECS
from caldrive.datatypes import KMH, Affordances, CameraConfig, Decision, Image, LightState, Observation, Step
from caldrive.interfaces import World, is_mapped
from caldrive.results import EpisodeResult, Infraction
from caldrive.scenarios import Scenario
from caldrive.visualization.scenes import (
    Place,
    Scene,
    camera_place,
    ego_place,
    ego_scene,
    lights_scene,
    others_scene,
    route_scene,
    town_scene,
)

JPEG_QUALITY = 90
TEXT = "text"  # in place of the unit of a field that holds words
FIELDS: Mapping[str, Mapping[str, str]] = {  # the unit of each field, by the kind of values
    "Affordances": {spec.name: spec.unit for spec in SPECS},
    "Controller": {"state": TEXT, "speed_limit": "km/h", "target_speed": "km/h", "note": TEXT},
    "Signals": {
        "command": TEXT, "speed": "m/s", "target": "m/s", "throttle": "", "brake": "", "steer": "",
        "acceleration": "m/s²", "jerk": "m/s³", "center_distance": "m",
    },
}  # fmt: skip

Attention = Callable[[Observation], Image | None]


@dataclass(frozen=True)
class Picture:
    """A picture as JPEG."""

    jpeg: bytes


@dataclass(frozen=True)
class Lens:
    """How a camera sees."""

    camera: CameraConfig


@dataclass(frozen=True)
class Values:
    """Numbers and words by the names in FIELDS[kind]; NaN stands for a number that there is not."""

    kind: str
    fields: Mapping[str, float | str]


@dataclass(frozen=True)
class Remark:
    """A line in a log. level: info, warning or error."""

    level: str
    text: str


Content = Picture | Lens | Values | Remark | Place | Scene


class Writer(Protocol):
    """What takes the messages."""

    def write(self, topic: str, time: float, content: Content) -> None:
        """A message of a channel at a time (s) of the recording, which never goes back."""
        ...


class DriveRecording:
    """Tells writers of a drive's episodes, which follow one another in the recording's time, from 0 s on.

    camera: the one that the images come from. attention: makes a picture of where the agent looked in an observation,
    or None; without it there is no such channel. What an agent or a world does not give has no messages.
    """

    def __init__(
        self, writers: Sequence[Writer], world: World, camera: CameraConfig, attention: Attention | None = None
    ) -> None:
        self.writers, self.world, self.camera, self.attention = writers, world, camera, attention
        self._now = -world.dt
        self._roads: Any = None
        self._lights: list[tuple[str, LightState]] = []

    def begin(self, scenario: Scenario, caption: str, infractions: Sequence[Infraction]) -> None:
        """The next episode. caption: what the log says of it; infractions: the referee's list, which grows."""
        self._scenario, self._caption, self._infractions = scenario, caption, infractions
        self._told = 0  # of the infractions
        self._motion: list[tuple[float, float]] = []  # the last times and speeds
        self._offset: float | None = None

    def add(self, step: Step) -> None:
        """One more step."""
        first = self._offset is None
        if self._offset is None:
            self._offset = self._now + self.world.dt - step.truth.time
        self._now = self._offset + step.truth.time
        if first:
            self._write(self._beginning(step))
        self._write(self._messages(step))

    def end(self, result: EpisodeResult) -> None:
        """The episode is over."""
        self._write([("/episode", Remark("info", result.outcome.value))])

    def _write(self, messages: Iterable[tuple[str, Content]]) -> None:
        for topic, content in messages:
            for writer in self.writers:
                writer.write(topic, self._now, content)

    def _beginning(self, step: Step) -> Iterator[tuple[str, Content]]:
        """What holds for the whole episode."""
        yield "/episode", Remark("info", self._caption)
        yield "/ego/body", ego_scene(step.truth.ego)
        if step.observation.image.shape[:2] == (self.camera.height, self.camera.width):  # else it is another camera's
            yield "/camera/place", camera_place(self.camera)
            yield "/camera/calibration", Lens(self.camera)
        if is_mapped(self.world):
            if self.world.roads is not self._roads:
                self._roads = self.world.roads
                yield "/map", town_scene(self._roads)
            yield "/route", route_scene(self.world.route, self._scenario.goal)

    def _messages(self, step: Step) -> Iterator[tuple[str, Content]]:
        """What a step says."""
        truth, decision = step.truth, step.decision
        yield "/ego", ego_place(truth.ego)
        yield from self._pictures(step.observation)
        yield "/affordances/true", _affordances(truth.affordances)
        if decision is not None and decision.affordances is not None:
            yield "/affordances/predicted", _affordances(decision.affordances)
        if decision is not None:
            yield "/controller", _controller(decision)
        yield "/signals", self._signals(step)
        yield "/others", others_scene(truth.vehicles, truth.pedestrians)
        states = [(light.id, light.state) for light in truth.lights]
        if states != self._lights:  # they rarely change
            self._lights = states
            yield "/lights", lights_scene(truth.lights)
        for infraction in self._infractions[self._told :]:
            yield "/infractions", _remark(infraction)
        self._told = len(self._infractions)

    def _pictures(self, observation: Observation) -> Iterator[tuple[str, Content]]:
        image = observation.image
        if image.size > image.shape[-1]:  # a world without a camera gives a single pixel
            yield "/camera", Picture(as_jpeg(image))
            seen = self.attention(observation) if self.attention is not None else None
            if seen is not None:
                yield "/attention", Picture(as_jpeg(seen))

    def _signals(self, step: Step) -> Values:
        """What an engineer plots. Acceleration and jerk are raw differences; the figures of comfort are smoothed."""
        self._motion = [*self._motion[-2:], (step.truth.time, step.observation.speed)]
        acceleration, jerk = differences(self._motion)
        control, decision = step.control, step.decision
        target = _number(None if decision is None else decision.target_speed)
        return Values("Signals", {
            "command": step.observation.command.value, "speed": _number(step.observation.speed), "target": target * KMH,
            "throttle": control.throttle, "brake": control.brake, "steer": control.steer,
            "acceleration": acceleration, "jerk": jerk,
            "center_distance": _number(step.truth.affordances.center_distance),
        })  # fmt: skip


def differences(motion: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Acceleration (m/s²) and jerk (m/s³) by the last three times (s) and speeds (m/s), NaN where there are too few."""
    times, speeds = np.array(motion, dtype=float).T
    if len(times) < 2:
        return math.nan, math.nan
    accelerations = np.diff(speeds) / np.diff(times)
    jerk = (accelerations[1] - accelerations[0]) / ((times[2] - times[0]) / 2) if len(times) > 2 else math.nan
    return float(accelerations[-1]), float(jerk)


def as_jpeg(image: Image) -> bytes:
    """An image as JPEG; somebody's world may give a grey one."""
    pixels = np.asarray(PillowImage.fromarray(image).convert("RGB"))
    jpeg: bytes = simplejpeg.encode_jpeg(pixels, JPEG_QUALITY, colorspace="RGB", colorsubsampling="444")
    return jpeg


def _affordances(affordances: Affordances) -> Values:
    values = {spec.name: getattr(affordances, spec.name) for spec in SPECS}
    # None is the class 0: no sign.
    return Values("Affordances", {name: 0.0 if value is None else _number(value) for name, value in values.items()})


def _controller(decision: Decision) -> Values:
    return Values("Controller", {
        "state": "" if decision.state is None else str(decision.state), "note": decision.note,
        "speed_limit": _number(decision.speed_limit), "target_speed": _number(decision.target_speed),
    })  # fmt: skip


def _number(value: float | None) -> float:
    """A number as Python's; NaN for one that there is not, or that no plot can show."""
    return float(value) if value is not None and math.isfinite(value) else math.nan


def _remark(infraction: Infraction) -> Remark:
    whose = "the ego's fault" if infraction.at_fault else "not the ego's fault"
    text = f"{infraction.kind.value} at ({infraction.x:.1f}, {infraction.y:.1f}), {whose}"
    return Remark("error" if infraction.at_fault else "warning", text)
