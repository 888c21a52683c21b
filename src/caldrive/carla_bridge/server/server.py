"""The server: one thread that owns the world, answers calls in their order, and ticks between them.

A step belongs to whoever calls `tick_cue` in synchronous mode, and to the clock otherwise. While no client is there the
world stands at its beginning, so that a program that comes alone finds the same world each time.
"""

from __future__ import annotations

import math
import selectors
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack, closing, suppress
from itertools import count
from typing import TYPE_CHECKING, Any

from caldrive.carla_bridge.server import snapshot
from caldrive.carla_bridge.server.actors import Actor
from caldrive.carla_bridge.server.calls import Call, serve
from caldrive.carla_bridge.server.clients import Clients
from caldrive.carla_bridge.server.episode import Episode
from caldrive.carla_bridge.server.layouts import Settings
from caldrive.carla_bridge.server.maps import Maps, signal_ids
from caldrive.carla_bridge.server.outbox import listening
from caldrive.carla_bridge.server.sensor_actors import Message, SensorActor
from caldrive.carla_bridge.server.sensors import Senses
from caldrive.carla_bridge.server.settings import ServerSettings
from caldrive.carla_bridge.server.streams import WORLD, Streams
from caldrive.carla_bridge.server.wire import Request, refused
from caldrive.world.town import load_town

if TYPE_CHECKING:  # it needs what draws
    from caldrive.carla_bridge.server.run_recording import RunRecording

FIRST_FRAME = 1  # a client that waits for its first snapshot passes over a frame 0
FREE_STEP = 0.05  # s of a step by the clock, as CARLA's at 20 frames a second
GRACE = 1.0  # s after a call until the clock begins to move the world: time to ask for synchronous mode
LONGEST_GRACE = 5.0  # s after the first call
LONGEST_STEP = 1.0  # s


class Server:
    """One world, and all clients of it. Raises OSError where a port is taken, ValueError for a town that cannot be."""

    def __init__(self, settings: ServerSettings, recording: RunRecording | None = None) -> None:
        self.settings, self.maps, self._recording = settings, Maps(settings.maps), recording
        self._rules: dict[int, Settings] = {}  # of the clients that set some, the latest last
        self.frame, self._episodes, self._numbers = FIRST_FRAME, 0, count(1)
        self.managers: dict[int, tuple[str, int]] = {}
        """Traffic managers that clients run: port to host and owner."""
        self.calls: dict[str, Call] = {}
        self._first_call, self._next_step = math.inf, math.inf  # s by the clock
        with ExitStack() as stack:
            host, port = settings.host, settings.port
            self.clients = Clients(listening(host, port), self.log, self._result, self._forget)
            stack.enter_context(closing(self.clients))
            self.streams = Streams(listening(host, port + 1), self.log, self._newcomer)
            stack.enter_context(closing(self.streams))
            self._selector = stack.enter_context(selectors.DefaultSelector())
            for one in (self.clients, self.streams):
                self._selector.register(one, selectors.EVENT_READ, one.poll)
            self._senses = Senses(load_town(settings.town))
            stack.callback(lambda: self._senses.close())
            self.episode = self._begin(settings.town)
            stack.callback(lambda: self.episode.close())
            self._latest = self._snapshot()
            self.close = stack.pop_all().close
            """Ends it all."""

    def log(self, sentence: str) -> None:
        """Says something on stderr, if anybody can hear it."""
        with suppress(OSError, ValueError):
            print(f"caldrive: {sentence}", file=sys.stderr, flush=True)

    def _begin(self, town_name: str) -> Episode:
        """A new episode in a town. Raises ValueError, OSError or RuntimeError where there cannot be one."""
        town = load_town(town_name)
        if town.roads.offset != (0.0, 0.0):
            raise ValueError(
                f"found that {town_name} lies far from the origin of its map, wanted one within 5 km: move the map"
            )
        self._episodes += 1
        episode = Episode(self._episodes, town, self.settings, signal_ids(town_name, town.roads), self._numbers)
        if self._senses.town is not town:
            self._senses.close()
            self._senses = Senses(town)
        return episode

    def begin(self, town: str | None = None) -> None:
        """Ends the episode and begins another, in the same town or another. Raises ValueError, OSError or RuntimeError
        where there cannot be one; then the old town begins again.

        Who subscribes already hears of it with the next step, which the clock makes after a while: a client that loads
        a world leaves its old subscription, and crashes where something comes in on it at that moment."""
        old = self.episode.town.name
        load_town(town or old)  # a map that cannot be read costs nothing
        for actor in self.sensors():
            self.streams.close_stream(actor.stream)
        self.episode.close()
        self._next_step = max(self._next_step, time.monotonic() + GRACE)
        try:
            self.episode = self._begin(town or old)
        except (ValueError, OSError, RuntimeError):
            self.episode = self._begin(old)
            raise
        finally:
            self._latest = self._snapshot()

    def warm_up(self) -> None:
        """Does once what clients would have to wait for the first time; then all is as it was."""
        self.episode.step(FREE_STEP)
        self._senses.warm_up(self.episode)
        self.begin()

    def run(self) -> None:
        """Serves until it is interrupted."""
        while True:
            self.turn()

    def turn(self, patience: float = 1.0) -> None:
        """Waits until something happens, at most some seconds, and does it."""
        for key, _ in self._selector.select(self._patience(patience)):
            key.data()
        now = time.monotonic()
        if self.clients and not self.rules.synchronous and now >= self._next_step:
            self._next_step = max(self._next_step + (self.rules.delta or FREE_STEP), now)
            self._tick_by_the_clock()

    def _tick_by_the_clock(self) -> None:
        """A step that no client asked for. A fault costs the episode, not the server."""
        try:
            self.tick()
        except Exception as error:  # nobody else could hear of it
            self.log(
                f"found a fault of the program ({type(error).__name__}: {error}), wanted none: the town begins again"
            )
            self.begin()

    def _patience(self, most: float) -> float:
        """s until the clock moves the world."""
        if not self.clients or self.rules.synchronous:
            return most
        return min(most, max(0.0, self._next_step - time.monotonic()))

    def _result(self, caller: int, request: Request) -> Any:
        """What a call gives. A fault of the program costs one call, not all clients."""
        if self.frame == FIRST_FRAME and not self.rules.synchronous:
            now = time.monotonic()
            self._first_call = min(self._first_call, now)
            self._next_step = min(now + GRACE, self._first_call + LONGEST_GRACE)
        try:
            return serve(self.calls, caller, request)
        except Exception as error:  # the last door before everybody's world
            self.log(f"found a fault of the program in {request.method} ({type(error).__name__}: {error}), wanted none")
            found = self.calls[request.method]
            return refused(f"found a fault of caldrive in {request.method}, wanted none: see its output", found.is_void)

    def _forget(self, client: int) -> None:
        """A client has gone, and what was its own goes with it."""
        self.managers = {port: row for port, row in self.managers.items() if row[1] != client}
        if self.settings.keep:
            return
        if client in self._rules:
            del self._rules[client]
            self._next_step = time.monotonic()
        if not self.clients:  # who comes next finds what the first one found
            self.frame, self._episodes, self._numbers = FIRST_FRAME, 0, count(1)
            self._rules.clear()
            self._first_call = self._next_step = math.inf
            self.begin(self.settings.town)
            return
        for actor in self.episode.all(Actor):
            if actor.owner == client and self.episode.get(actor.id) is actor:
                self.destroy(actor)

    @property
    def rules(self) -> Settings:
        """The settings that a client has set last, of those who are there."""
        return next(reversed(self._rules.values()), Settings())

    def set_rules(self, rules: Settings, owner: int) -> None:
        """Other settings from now on, of a client that they go with."""
        self._rules.pop(owner, None)
        self._rules[owner] = rules
        self._next_step = max(self._next_step, time.monotonic())

    def reset_rules(self) -> None:
        """The usual settings."""
        self._rules.clear()

    def sensors(self) -> list[SensorActor]:
        """Those that clients have spawned."""
        return self.episode.all(SensorActor)

    def destroy(self, actor: Actor) -> None:
        """An actor goes, with what is attached to it."""
        for gone in self.episode.remove(actor):
            if gone.stream:
                self.streams.close_stream(gone.stream)

    def tick(self) -> int:
        """Moves the world on by a step and tells everybody; returns its frame."""
        self.streams.settle()
        self.frame += 1
        self.episode.step(min(self.rules.delta or FREE_STEP, LONGEST_STEP))
        self._latest = self._snapshot()
        self.streams.send(WORLD, self._latest)
        heard = []
        for sensor in self.sensors():
            is_off = sensor.is_silent or (self.rules.no_rendering and ".camera." in sensor.kind)
            if self.streams.is_wanted(sensor.stream) and not is_off:
                heard += [(sensor, message) for message in self._hear_sensor(sensor)]
        self._record(heard)
        return self.frame

    def _hear_sensor(self, sensor: SensorActor) -> list[Message]:
        """Sends what a sensor says. A fault silences it."""
        try:
            messages = list(self._senses.messages(sensor, self.episode, self.frame))
            for message in messages:
                self.streams.send(sensor.stream, message)
        except Exception as error:  # a place or a lens that nobody thought of
            self.log(f"found a fault in {sensor.kind} ({type(error).__name__}: {error}), wanted none: it falls silent")
            sensor.is_silent = True
            return []
        return messages

    def _record(self, heard: Sequence[tuple[SensorActor, Message]]) -> None:
        """Takes down the last step. A full disk ends the recording, and not the server."""
        if self._recording is None:
            return
        try:
            self._recording.step(self.episode, heard)
        except OSError as error:
            self.log(f"found that {self.settings.record} cannot be written ({error.strerror}), wanted room: it ends")
            self._recording = None

    def _snapshot(self) -> Sequence[Any]:
        """Who is where now."""
        episode = self.episode
        place = snapshot.header(snapshot.Sensor.WORLD, self.frame, episode.time)
        head = snapshot.world_head(episode.number, episode.time, episode.delta)
        return [b"".join((place, head, *episode.rows()))]

    def _newcomer(self, stream: int) -> Sequence[Any] | None:
        """What a new subscriber gets at once: the latest snapshot."""
        return self._latest if stream == WORLD else None
