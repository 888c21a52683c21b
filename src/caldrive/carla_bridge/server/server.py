"""The server: one thread that owns the world, answers calls in their order, and ticks between them.

A step belongs to whoever calls `tick_cue` in synchronous mode, and to the clock otherwise. While no client is there the
world stands at its beginning, so that a program that comes alone finds the same world each time.
"""

from __future__ import annotations

import selectors
from collections.abc import Sequence
from contextlib import ExitStack, closing
from itertools import count
from typing import TYPE_CHECKING, Any

from caldrive.carla_bridge.server.actors import Actor
from caldrive.carla_bridge.server.calls import Call, serve, turned_down
from caldrive.carla_bridge.server.clients import Clients
from caldrive.carla_bridge.server.episode import Episode
from caldrive.carla_bridge.server.layouts import Settings
from caldrive.carla_bridge.server.log import Log, Refusals
from caldrive.carla_bridge.server.maps import Maps, signal_ids
from caldrive.carla_bridge.server.outbox import listening
from caldrive.carla_bridge.server.pace import FREE_STEP, Pace
from caldrive.carla_bridge.server.population import require_room
from caldrive.carla_bridge.server.sensor_actors import SensorActor
from caldrive.carla_bridge.server.sensors import Senses
from caldrive.carla_bridge.server.settings import ServerSettings
from caldrive.carla_bridge.server.streams import WORLD, Streams
from caldrive.carla_bridge.server.wire import Request
from caldrive.world.town import Town, load_town

if TYPE_CHECKING:  # it needs what draws
    from caldrive.carla_bridge.server.run_recording import RunRecording

FIRST_FRAME = 1  # a client that waits for its first snapshot passes over a frame 0
LONGEST_STEP = 10.0  # s
SERVING = 0.01  # s of calls between two looks at the clock


class Server:
    """One world, and all clients of it. Raises OSError where a port is taken, ValueError for a town that cannot be."""

    def __init__(self, settings: ServerSettings, recording: RunRecording | None = None) -> None:
        self.settings, self.maps, self._recording = settings, Maps(settings.maps), recording
        self.log = Log()
        self._refusals = Refusals(self.log)
        self._rules: dict[int, Settings] = {}  # of the clients that set some, the latest last
        self.frame, self._episodes, self._numbers = FIRST_FRAME, 0, count(1)
        self.managers: dict[int, tuple[str, int]] = {}
        """Traffic managers that clients run: port to host and owner."""
        self.calls: dict[str, Call] = {}
        self._pace = Pace()
        with ExitStack() as stack:
            host, port = settings.host, settings.port
            self.clients = Clients(listening(host, port), self.log, self._result, self._forget)
            stack.enter_context(closing(self.clients))
            self.streams = Streams(listening(host, port + 1), self.log, self._newcomer)
            stack.enter_context(closing(self.streams))
            self._selector = stack.enter_context(selectors.DefaultSelector())
            for one in (self.clients, self.streams):
                self._selector.register(one, selectors.EVENT_READ, one.poll)
            town = self._suitable(settings.town)
            self._senses = Senses(town)
            stack.callback(lambda: self._senses.close())
            self.episode = self._begin(town)
            stack.callback(lambda: self.episode.close())
            self._latest = self.episode.snapshot(self.frame)
            self.close = stack.pop_all().close
            """Ends it all."""

    def _suitable(self, name: str) -> Town:
        """A town with room for an episode. Raises ValueError, OSError or RuntimeError where there is none."""
        town = load_town(name)
        if town.roads.offset != (0.0, 0.0):
            raise ValueError(
                f"found that {name} lies far from the origin of its map, wanted one within 5 km: move the map"
            )
        require_room(town.roads, self.settings.cars, self.settings.people)
        signal_ids(name, town.roads)  # what cannot be read is found here
        return town

    def _begin(self, town: Town) -> Episode:
        """A new episode in a town. Raises ValueError, OSError or RuntimeError where there cannot be one."""
        self._episodes += 1
        episode = Episode(self._episodes, town, self.settings, signal_ids(town.name, town.roads), self._numbers)
        if self._senses.town is not town:
            self._senses.close()
            self._senses = Senses(town)
        return episode

    def begin(self, name: str | None = None) -> None:
        """Ends the episode and begins another, in the same town or another. Raises ValueError, OSError or RuntimeError
        where there cannot be one: a town that does not suit costs nothing, and one in which nothing moves is left for
        the old one, which begins again.

        Who subscribes already hears of it with the next step, which the clock makes after a while: a client that loads
        a world leaves its old subscription, and crashes where something comes in on it at that moment."""
        old = self.episode.town
        town = self._suitable(name) if name else old
        for actor in self.sensors():
            self.streams.close_stream(actor.stream)
        self.episode.close()
        self._pace.begin_loaded()
        try:
            self.episode = self._begin(town)
        except (ValueError, OSError, RuntimeError):
            self.episode = self._begin(old)
            raise
        finally:
            self._latest = self.episode.snapshot(self.frame)

    def warm_up(self) -> None:
        """Does once what clients would have to wait for the first time; then all is as it was."""
        self.episode.step(FREE_STEP)
        self._senses.warm_up(self.episode)
        self._start_over()

    def _start_over(self) -> None:
        """All is as the first client finds it, to its numbers."""
        self.frame, self._episodes, self._numbers = FIRST_FRAME, 0, count(1)
        self._rules.clear()
        self._begin_again(self.settings.town)
        self._pace.begin()

    def run(self) -> None:
        """Serves until it is interrupted."""
        while True:
            self.turn()

    def turn(self, patience: float = 1.0) -> None:
        """Waits until something happens, at most some seconds, and does it."""
        for key, _ in self._selector.select(self._patience(patience)):
            key.data()
        self.clients.serve_some(SERVING)
        if not self.clients or self.rules.synchronous or self._pace.left() > 0.0:
            return
        if self._pace.owes_frame:
            self._pace.show()
            self._show()
        else:
            self._pace.step(self.rules.delta)
            self._tick_by_the_clock()

    def _tick_by_the_clock(self) -> None:
        """A step that no client asked for. A fault costs the episode, not the server."""
        try:
            self.tick()
        except Exception as error:  # nobody else could hear of it
            self.log(
                f"found a fault of the program ({type(error).__name__}: {error}), wanted none: the town begins again"
            )
            self._begin_again(self.episode.town.name)

    def _begin_again(self, town: str) -> None:
        """Another episode that no client asked for."""
        try:
            self.begin(town)
        except (ValueError, OSError, RuntimeError) as error:
            self.log(f"found that {town} cannot begin again ({error}), wanted it: start the server anew")

    def _patience(self, most: float) -> float:
        """s to wait for the next call."""
        if self.clients.is_busy:
            return 0.0
        return most if not self.clients or self.rules.synchronous else min(most, self._pace.left())

    def _result(self, caller: int, request: Request) -> Any:
        """What a call gives. A fault of the program costs one call, not all clients."""
        if not self.rules.synchronous:
            self._pace.hear()
        try:
            result = serve(self.calls, caller, request)
            self._refusals.note(caller, request, result)
        except Exception as error:  # the last door before everybody's world
            self.log(f"found a fault of the program in {request.method} ({type(error).__name__}: {error}), wanted none")
            return turned_down(
                f"found a fault of caldrive in {request.method}, wanted none: see its output",
                self.calls[request.method],
            )
        if self.episode.has_changed and self._pace.stands and not (self.rules.synchronous or self._pace.owes_frame):
            self._show()  # in CARLA the next frame, which comes at once, shows who was spawned
        return result

    def _forget(self, client: int) -> None:
        """A client has gone, and what was its own goes with it."""
        self._refusals.forget(client)
        self.managers = {port: row for port, row in self.managers.items() if row[1] != client}
        if self.settings.keep:
            return
        if client in self._rules:
            del self._rules[client]
            self._pace.go_on()
        if not self.clients:
            self._start_over()
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
        self._pace.go_on()

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
        self._pace.stands = False
        self.episode.step(self.rules.delta or FREE_STEP)
        self._show()
        heard = []
        for sensor in self.sensors():
            is_off = sensor.is_silent or (self.rules.no_rendering and ".camera." in sensor.kind)
            if self.streams.is_wanted(sensor.stream) and not is_off:
                for message in self._senses.heard(sensor, self.episode, self.frame, self.log):
                    self.streams.send(sensor.stream, message)
                    heard.append((sensor, message))
        if self._recording is not None:
            self._recording.step(self.episode, heard, self.log)
        return self.frame

    def _show(self) -> None:
        """Tells everybody who is where now: a frame."""
        self.frame += 1
        self._latest = self.episode.snapshot(self.frame)
        self.streams.send(WORLD, [self._latest])

    def _newcomer(self, stream: int) -> Sequence[Any] | None:
        """What a new subscriber gets at once: the latest snapshot."""
        return [self._latest] if stream == WORLD else None
