"""The calls about traffic lights."""

from __future__ import annotations

from caldrive.carla_bridge.server.actor_calls import ActorCalls, finite
from caldrive.carla_bridge.server.calls import call
from caldrive.carla_bridge.server.layouts import BoundingBox, Vector
from caldrive.carla_bridge.server.lights import STATES, Light, LightKeeper
from caldrive.carla_bridge.server.server import Server
from caldrive.carla_bridge.server.wire import Refusal

MOST_TIME = 1e6  # s that a light may show the same


class LightCalls:
    """They answer from one server; actors: finds them."""

    def __init__(self, server: Server, actors: ActorCalls) -> None:
        self._server, self._actors = server, actors

    @property
    def _keeper(self) -> LightKeeper:
        return self._server.episode.lights

    def _light(self, number: int) -> Light:
        return self._actors.find(number, Light)

    @call("set_traffic_light_state")
    def set_light(self, caller: int, number: int, state: int) -> None:
        """It shows that as long as it lasts. Raises Refusal for a light that is off, as ours always show something."""
        light = self._light(number)
        if state not in STATES:
            raise Refusal(
                f"found state {state} of a light, as of one that is off, wanted Red, Yellow or Green: set one"
            )
        self._keeper.hold(light, STATES[state], self._server.episode.time)

    def _set_time(self, number: int, place: int, seconds: float) -> None:
        light = self._light(number)
        times = list(light.times)
        times[place] = max(0.0, finite(seconds, MOST_TIME))
        light.times = (times[0], times[1], times[2])

    @call("set_traffic_light_green_time")
    def set_green(self, caller: int, number: int, seconds: float) -> None:
        """How long a green that a client asked for lasts."""
        self._set_time(number, 0, seconds)

    @call("set_traffic_light_yellow_time")
    def set_yellow(self, caller: int, number: int, seconds: float) -> None:
        """Likewise."""
        self._set_time(number, 1, seconds)

    @call("set_traffic_light_red_time")
    def set_red(self, caller: int, number: int, seconds: float) -> None:
        """Likewise."""
        self._set_time(number, 2, seconds)

    @call("freeze_traffic_light")
    def freeze(self, caller: int, number: int, is_frozen: bool) -> None:
        """The lights of its junction stay as they are."""
        self._keeper.freeze(self._light(number), is_frozen)

    @call("freeze_all_traffic_lights")
    def freeze_all(self, caller: int, is_frozen: bool) -> None:
        """All lights stay as they are."""
        for light in self._keeper.actors:
            self._keeper.freeze(light, is_frozen)

    @call("reset_traffic_light_group")
    def reset(self, caller: int, number: int) -> None:
        """The lights of a junction do as they would alone."""
        self._keeper.release(self._keeper.of_junction(self._light(number)), self._server.episode.time)

    @call("reset_all_traffic_lights")
    def reset_all(self, caller: int) -> None:
        """Likewise all of them."""
        self._keeper.release(self._keeper.actors, self._server.episode.time)

    @call("get_group_traffic_lights")
    def group(self, caller: int, number: int) -> list[int]:
        """The lights of its junction, with itself."""
        return [one.id for one in self._keeper.of_junction(self._light(number))]

    @call("get_light_boxes")
    def light_boxes(self, caller: int, number: int) -> list[BoundingBox]:
        """The box of its lamps, in the world."""
        at = self._light(number).place
        return [BoundingBox(Vector(at.x, -at.y, 3.0), Vector(0.2, 0.2, 0.5))]
