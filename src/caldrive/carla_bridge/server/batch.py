"""Batches: many commands in one call, each answered by itself."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

from caldrive.carla_bridge.server.actor_calls import ActorCalls
from caldrive.carla_bridge.server.calls import arguments_of, call, converted
from caldrive.carla_bridge.server.layouts import ActorDescription, Layout, Transform, placement
from caldrive.carla_bridge.server.light_calls import LightCalls
from caldrive.carla_bridge.server.server import Server
from caldrive.carla_bridge.server.vehicle_calls import VehicleCalls
from caldrive.carla_bridge.server.wire import Refusal

MOST_COMMANDS = 10_000
DEEPEST = 8  # commands that follow on commands


class Spawn(Layout, frozen=True):
    """Command 0."""

    description: ActorDescription
    transform: Transform
    parent: tuple[bool | int, ...]
    attachment: int = 0
    socket: str = ""
    then: tuple[Any, ...] = ()


class Batches:
    """They do what the single calls do."""

    def __init__(self, server: Server, actors: ActorCalls, vehicles: VehicleCalls, lights: LightCalls) -> None:
        self._server, self._actors = server, actors
        self._commands: dict[int, tuple[Callable[..., Any], type[Any]]] = {}
        for number, method in (
            (1, actors.destroy), (2, vehicles.control), (3, vehicles.ackermann), (4, vehicles.walk),
            (5, vehicles.set_physics), (6, actors.set_transform), (8, actors.set_velocity), (9, actors.set_turning),
            (10, actors.add_impulse), (11, actors.add_force), (12, actors.turn), (13, actors.turn),
            (14, actors.simulate_physics), (15, actors.enable_gravity), (16, vehicles.autopilot),
            (17, vehicles.debug_telemetry), (19, actors.set_location), (21, lights.set_light),
        ):  # fmt: skip
            self._commands[number] = method, arguments_of(method)
        self._commands[7] = self._follow, tuple[int, Transform, float]
        self._commands[18] = self._set_lights, tuple[int, int]
        self._vehicles = vehicles

    @call("apply_batch", is_bare=True)
    def apply(self, caller: int, commands: list[Any], tick: bool = False) -> list[Any]:
        """All of them in their order; the number of its actor for each, or why it was refused."""
        if len(commands) > MOST_COMMANDS:
            raise Refusal(f"found {len(commands)} commands in a batch, wanted {MOST_COMMANDS} at most: send fewer")
        results = [self._result(caller, command) for command in commands]
        if tick and self._server.rules.synchronous:
            self._server.tick()
        return results

    def _result(self, caller: int, command: Any) -> Any:
        try:
            return ((1, self._do(caller, command, 0, 0)),)
        except Refusal as refusal:
            return ((0, (str(refusal),)),)

    def _do(self, caller: int, command: Any, future: int, depth: int) -> int:
        """A command; future: the actor that is meant by number 0. Raises Refusal."""
        match command:
            case [[0, payload]] if depth < DEEPEST:
                return self._spawn(caller, converted(payload, Spawn, "a spawn command"), future, depth)
            case [[int(index), [int(number), *rest]]] if index in self._commands:
                method, kind = self._commands[index]
                number = number or future
                method(caller, *converted([number, *rest], kind, f"command {index}"))
                return number
        raise Refusal("found a command that caldrive does not know, wanted one of CARLA 0.9.16: leave it out")

    def _spawn(self, caller: int, asked: Spawn, future: int, depth: int) -> int:
        parent = (int(asked.parent[1]) or future) if asked.parent[:1] == (True,) and len(asked.parent) > 1 else None
        if parent == 0:
            raise Refusal(
                f"found FutureActor as what {asked.description.id[:80]} is attached to, wanted it in a then()"
            )
        actor = self._actors.spawn(caller, asked.description, placement(asked.transform), parent)
        for command in asked.then:
            with suppress(Refusal):  # the actor is there, and its client has to know
                self._do(caller, command, actor.id, depth + 1)
        return actor.id

    def _follow(self, caller: int, number: int, at: Transform, speed: float) -> None:
        self._vehicles.follow_crowd(number, at, speed)

    def _set_lights(self, caller: int, number: int, flags: int) -> None:
        self._vehicles.set_vehicle_lights(caller, number, (flags,))
