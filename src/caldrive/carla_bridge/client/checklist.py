"""What caldrive needs of a CARLA server, looked at one by one: for a person who has a GPU, and a real CARLA on it.

The server of the embedded world speaks CARLA's protocol as we understood it. Whether that was right, only a real CARLA
can tell.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from functools import partial

import numpy as np

from caldrive.carla_bridge.client.actors import lights_at_posts, place_of, transform_of
from caldrive.carla_bridge.client.connection import Connection
from caldrive.carla_bridge.client.ego import DROP, MODEL
from caldrive.carla_bridge.client.episode import Episode
from caldrive.carla_bridge.client.sensors import RGB, SEMANTIC, classes, picture
from caldrive.datatypes import DT, CameraConfig, ContactKind, Control, Semantic
from caldrive.scenarios import Scenario
from caldrive.world.roads.route import random_route
from caldrive.world.town import load_town
from caldrive.world.traffic.ego import VehicleConfig

CAMERA, USUAL = CameraConfig(), VehicleConfig()
STEPS = 50  # that are counted
BEGIN, AHEAD, WAY = 5.0, 15.0, 60.0  # m: the start on its lane, from there to the car that is hit, and of the route
NEAR_SIGN = 5.0  # m from a sign of CARLA's to that of the map


@dataclass(frozen=True)
class Check:
    """One row."""

    what: str
    """What was looked at."""
    ok: bool
    """Whether it is as it should be."""
    found: str
    """In words."""


class Visit:
    """A stay on a server, with a car on its longest street."""

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self.town = load_town(str(connection.map_file()))
        lane = max(self.town.roads.driveable, key=lambda lane: lane.line.length)
        start = lane.line.pose_at(BEGIN)
        self.route = random_route(self.town.roads, start, WAY, np.random.default_rng(0))
        self.begin()

    def begin(self) -> None:
        """The car stands at its start, alone."""
        self.connection.clear()
        start, goal = self.route.line.pose_at(0.0), self.route.line.pose_at(self.route.length)
        scenario = Scenario(self.town.name, 1, start, goal)
        self.episode = Episode(self.connection, self.town, scenario, self.route, [CAMERA])

    def drive(self, control: Control, seconds: float) -> None:
        """Goes on for a while."""
        for _ in range(round(seconds / DT)):
            self.episode.step(control)


def checklist(host: str, port: int) -> Iterator[Check]:
    """Looks at a server. Raises RuntimeError where none of the client's version answers."""
    with closing(Connection(host, port)) as connection:
        yield Check("version", True, f"CARLA {connection.client.get_server_version()} with {connection.map_name}")
        connection.synchronise()
        begun: list[Visit] = []
        yield _checked("map", lambda: _map(connection, begun))
        for what, look in LOOKS.items() if begun else ():
            yield _checked(what, partial(look, *begun))
    yield _checked("cleaning up", partial(_cleaned_up, host, port))


def _checked(what: str, look: Callable[[], str]) -> Check:
    """A row, by something that says what it found or raises what is wrong with it: whatever that is, the next row is
    looked at."""
    try:
        return Check(what, True, look())
    except (ValueError, RuntimeError) as error:
        return Check(what, False, str(error))
    except Exception as error:  # CARLA may answer something that nobody thought of
        fault = f"{type(error).__name__}: {error}"
        return Check(what, False, f"found a fault ({fault}), wanted an answer that caldrive understands: report it")


def _require(met: bool, found: str, wanted: str) -> str:
    """What was found. Raises ValueError where it is not what was wanted."""
    if not met:
        raise ValueError(f"found {found}, wanted {wanted}")
    return found


def _map(connection: Connection, begun: list[Visit]) -> str:
    """Whether our reader takes the map; then a visit has begun on it."""
    begun.append(Visit(connection))
    roads = begun[0].town.roads
    lost = f"; left out: {', '.join(roads.dropped)}" if roads.dropped else ""
    return f"{len(roads.driveable)} lanes, {len(roads.posts)} lights, {len(roads.signs)} speed signs{lost}"


def _clock(visit: Visit) -> str:
    began, frames = visit.connection.time, [visit.connection.tick() for _ in range(STEPS)]
    lasted = visit.connection.time - began
    in_order = frames == list(range(frames[0], frames[0] + STEPS))
    found = f"{lasted:.2f} s and frames {frames[0]} to {frames[-1]} in {STEPS} steps"
    return _require(abs(lasted - STEPS * DT) < DT / 2 and in_order, found, f"{STEPS * DT:.2f} s and a frame a step")


def _pace(visit: Visit) -> str:
    began = time.perf_counter()
    visit.drive(Control(), STEPS * DT)
    pace = STEPS / (time.perf_counter() - began)
    return f"{pace:.0f} steps a second with a picture of {CAMERA.width} x {CAMERA.height}"


def _picture(visit: Visit) -> str:
    [image] = visit.episode.look([CAMERA], RGB)
    pixels = picture(image)
    found = (
        f"{image.width} x {image.height}, {image.fov:.0f} degrees, mean {pixels.mean():.0f}, spread {pixels.std():.0f}"
    )
    right = pixels.shape == (CAMERA.height, CAMERA.width, 3) and abs(image.fov - CAMERA.fov) < 0.1
    return _require(right and pixels.std() > 10, found, f"{CAMERA.width} x {CAMERA.height}, {CAMERA.fov:.0f} degrees")


def _semantic(visit: Visit) -> str:
    [image] = visit.episode.look([CAMERA], SEMANTIC)
    seen = classes(image)
    below, above = (float((rows == Semantic.ROAD).mean()) for rows in (seen[-20:], seen[:20]))
    names, street = ", ".join(Semantic(k).name.lower() for k in np.unique(seen)), "over 50% below and under 10% above"
    return _require(below > 0.5 and above < 0.1, f"{below:.0%} road below, {above:.0%} above; {names}", street)


def _car(visit: Visit) -> str:
    ego, axle = visit.episode.state.ego, visit.episode.labels.front_axle
    found = f"{MODEL}, {ego.length:.2f} x {ego.width:.2f} m, front axle {axle:.2f} m ahead of its middle"
    near = abs(ego.length - USUAL.length) < 0.3 and abs(ego.width - USUAL.width) < 0.3
    return _require(near, found, f"about {USUAL.length} x {USUAL.width} m")


def _on_lane(visit: Visit) -> str:
    seen = visit.episode.truth.affordances
    found = f"{seen.center_distance:+.2f} m to the line of the map, {seen.relative_angle:+.3f} rad"
    return _require(abs(seen.center_distance) < 0.2 and abs(seen.relative_angle) < 0.05, found, "0 and 0")


def _pedals(visit: Visit) -> str:
    visit.begin()
    visit.drive(Control(throttle=0.6), 4.0)
    speed = visit.episode.state.ego.speed
    visit.drive(Control(brake=1.0), 3.0)
    stopped = visit.episode.state.ego.speed
    found = f"{speed:.1f} m/s after 4 s of throttle 0.6, {stopped:.1f} m/s after 3 s of the brake"
    return _require(speed > 3.0 and stopped < 0.2, found, "3 m/s or more, and 0")


def _wheel(visit: Visit) -> str:
    visit.begin()
    visit.drive(Control(throttle=0.5), 2.0)
    before = visit.episode.state.ego.pose.heading
    visit.drive(Control(throttle=0.3, steer=0.3), 1.0)
    turned = math.remainder(visit.episode.state.ego.pose.heading - before, math.tau)
    return _require(turned > 0.01, f"{turned:+.3f} rad in a second of steer +0.3", "a turn to the left, +")


def _lights(visit: Visit) -> str:
    found = lights_at_posts(visit.connection, visit.town.roads)
    n, of = sum(light is not None for light in found), len(found)
    return _require(n == of, f"lights at {n} of the map's {of} stop lines", "one at each")


def _light_states(visit: Visit) -> str:
    lights = lights_at_posts(visit.connection, visit.town.roads)
    if not lights or lights[0] is None:
        return "the map has none"
    states, shown = visit.connection.carla.TrafficLightState, []
    for state in (states.Red, states.Green):
        lights[0].set_state(state)
        visit.drive(Control(brake=1.0), 2 * DT)
        shown.append(visit.episode.state.lights[0].state.value)
    return _require(shown == ["red", "green"], " and ".join(shown), "red and green, as they were set")


def _signs(visit: Visit) -> str:
    actors, roads = visit.connection.world.get_actors().filter("traffic.speed_limit.*"), visit.town.roads
    known = 0
    for actor in actors:
        at, limit = place_of(actor.get_transform(), roads.offset), actor.type_id.rpartition(".")[2]
        posts = [sign.stands_at for sign in roads.signs if str(sign.limit) == limit]
        known += any(math.hypot(post.x - at.x, post.y - at.y) < NEAR_SIGN for post in posts)
    return _require(known == len(actors), f"{known} of CARLA's {len(actors)} on the map", "all of them")


def _collision(visit: Visit) -> str:
    visit.begin()
    connection, pose = visit.connection, visit.route.line.pose_at(AHEAD)
    place = transform_of(connection.carla, pose, DROP, visit.town.roads.offset)
    _require(connection.spawn(connection.blueprint(MODEL), place) is not None, "no room for a car ahead", "some")
    for _ in range(80):
        visit.episode.step(Control(throttle=0.6))
        if contacts := visit.episode.state.contacts:
            hit = contacts[0].kind is ContactKind.CAR and contacts[0].at_fault
            return _require(hit, f"{contacts[0].kind.value}, {contacts[0].impulse:.0f} N s", "a car that was hit")
    return _require(False, "no contact with a car in the way", "one")


def _cleaned_up(host: str, port: int) -> str:
    with closing(Connection(host, port)) as connection:
        left, waits = len(connection.left_behind()), connection.world.get_settings().synchronous_mode
    found = f"{left} actors of ours, and a clock that {'waits for a client' if waits else 'goes by itself'}"
    return _require(not left and not waits, found, "none, and one that goes by itself")


LOOKS: dict[str, Callable[[Visit], str]] = {
    "clock": _clock, "pace": _pace, "picture": _picture, "classes of pixels": _semantic, "car": _car,
    "car on its lane": _on_lane, "pedals": _pedals, "steering wheel": _wheel, "lights": _lights,
    "what lights show": _light_states, "speed signs": _signs, "collision": _collision,
}  # fmt: skip
