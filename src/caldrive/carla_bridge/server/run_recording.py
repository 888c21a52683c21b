"""What clients did, as channels that `visualization/mcap_file` writes into a file: where everybody was, the lights,
what RGB cameras saw, and a log of who came, went and was hit."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from caldrive.carla_bridge.server.actors import NOBODY, Actor
from caldrive.carla_bridge.server.episode import Episode
from caldrive.carla_bridge.server.log import Log
from caldrive.carla_bridge.server.sensor_actors import Message, SensorActor
from caldrive.datatypes import LightState
from caldrive.visualization.channels import Content, Picture, Remark, Writer, as_jpeg
from caldrive.visualization.scenes import lights_scene, others_scene, town_scene


class RunRecording:
    """Tells a writer of a server's episodes, which follow one another in the recording's time, from 0 s on."""

    def __init__(self, writer: Writer) -> None:
        self._writer, self._now, self._is_full = writer, 0.0, False
        self._episode: Episode | None = None
        self._begin = 0.0  # s of the recording at which the episode began
        self._clients: dict[int, str] = {}  # their actors, by number
        self._lights: list[tuple[str, LightState]] = []

    def step(self, episode: Episode, heard: Sequence[tuple[SensorActor, Message]], log: Log) -> None:
        """The world has moved. heard: what sensors said; pictures of RGB cameras are kept. A full disk ends the
        recording, and nothing else."""
        if self._is_full:
            return
        try:
            self._take_down(episode, heard)
        except OSError as error:
            log(
                f"found that {error.filename} cannot be written any more ({error.strerror}), wanted room: what was "
                "recorded until now is there, and all goes on without a recording"
            )
            self._is_full = True

    def _take_down(self, episode: Episode, heard: Sequence[tuple[SensorActor, Message]]) -> None:
        if episode is not self._episode:
            self._write(self._beginning(episode))
        self._now = self._begin + episode.time
        self._write(self._messages(episode))
        for sensor, (*_, image) in heard:
            if sensor.kind == "sensor.camera.rgb":  # blue, green, red, alpha
                self._write([(f"/camera/{sensor.id}", Picture(as_jpeg(image[..., 2::-1])))])

    def _write(self, messages: Iterable[tuple[str, Content]]) -> None:
        for topic, content in messages:
            self._writer.write(topic, self._now, content)

    def _beginning(self, episode: Episode) -> Iterator[tuple[str, Content]]:
        """What holds for a whole episode."""
        self._begin = self._now
        self._clients, self._lights = {}, []
        yield "/log", Remark("info", f"an episode begins in {episode.town.name}")
        if self._episode is None or episode.town is not self._episode.town:
            yield "/map", town_scene(episode.town.roads)
        self._episode = episode

    def _messages(self, episode: Episode) -> Iterator[tuple[str, Content]]:
        """What a step says."""
        yield "/inhabitants", others_scene(episode.cars, episode.people)
        yield "/clients", others_scene(episode.vehicle_states(), episode.walker_states())
        lights = episode.lights.shown()
        states = [(light.id, light.state) for light in lights]
        if states != self._lights:  # they rarely change
            self._lights = states
            yield "/lights", lights_scene(lights)
        for text in self._changes(episode):
            yield "/log", Remark("info", text)
        for vehicle, contact, _ in episode.hits:
            yield "/log", Remark("warning", f"{name(vehicle)} hits {contact.id} with {contact.impulse:.0f} kg m/s")

    def _changes(self, episode: Episode) -> Iterator[str]:
        """Whose actors came and went."""
        there = {one.id: name(one) for one in episode.all(Actor) if one.owner != NOBODY}
        yield from (f"{text} comes" for id, text in there.items() if id not in self._clients)
        yield from (f"{text} goes" for id, text in self._clients.items() if id not in there)
        self._clients = there


def name(actor: Actor) -> str:
    """An actor in a word for people."""
    return f"{actor.kind} {actor.id}"
