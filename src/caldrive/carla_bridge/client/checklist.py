"""What caldrive needs of a CARLA server, looked at one by one: for a person who has a GPU, and a real CARLA on it.

The embedded world's server passes by being what we wrote; only a real CARLA can tell whether we understood it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass

import numpy as np

from caldrive.carla_bridge.client.actors import lights_at_posts, place_of, transform_of
from caldrive.carla_bridge.client.connection import Connection
from caldrive.carla_bridge.client.ego import DROP, MODEL
from caldrive.carla_bridge.client.episode import Episode
from caldrive.carla_bridge.client.sensors import RGB, SEMANTIC, classes, picture
from caldrive.datatypes import DT, CameraConfig, ContactKind, Control, LightState, Semantic
from caldrive.scenarios import Scenario
from caldrive.world.roads.route import Route, random_route
from caldrive.world.town import Town, load_town
from caldrive.world.traffic.ego import VehicleConfig

CAMERA, USUAL = CameraConfig(), VehicleConfig()
STEPS = 50  # whose pace is measured
BEGIN, AHEAD, WAY = 5.0, 15.0, 60.0  # m: the start on its lane, to the car that is hit, and of the route
NEAR_SIGN = 5.0  # m from a sign of CARLA's to that of the map


@dataclass(frozen=True)
class Check:
    """One row: what was looked at, whether it is as it should be, and what was found."""

    what: str
    ok: bool
    found: str


class _Visit:
    """A stay on a server, with a car on a straight street."""

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self.town: Town = load_town(str(connection.map_file()))
        lane = max(self.town.roads.driveable, key=lambda lane: lane.line.length)
        self.route: Route = random_route(
            self.town.roads, lane.line.pose_at(BEGIN), WAY, np.random.default_rng(0), None
        )  # fmt: skip
        self.begin()

    def begin(self) -> None:
        """The car stands at its start."""
        self.connection.clear()
        start, goal = self.route.line.pose_at(0.0), self.route.line.pose_at(self.route.length)
        scenario = Scenario(self.town.name, 1, start, goal)
        self.episode = Episode(self.connection, self.town, scenario, self.route, [CAMERA])

    def drive(self, control: Control, seconds: float) -> None:
        """Goes on for a while."""
        for _ in range(round(seconds / DT)):
            self.episode.step(control)


def checklist(host: str, port: int) -> Iterator[Check]:
    """Looks at a server; takes a minute or two. Raises RuntimeError where none of the client's version answers."""
    with closing(Connection(host, port)) as connection:
        yield Check("version", True, f"CARLA {connection.client.get_server_version()} with {connection.map_name}")
        connection.synchronise()
        visit = _Visit(connection)
        for what, look in LOOKS.items():
            yield _checked(what, lambda look=look: look(visit))  # type: ignore[misc]
    yield _checked("cleaning up", lambda: _cleaned_up(host, port))


def _checked(what: str, look: Callable[[], str]) -> Check:
    try:
        return Check(what, True, look())
    except (ValueError, RuntimeError) as error:
        return Check(what, False, str(error))


def _require(met: bool, sentence: str) -> None:
    if not met:
        raise ValueError(sentence)


def _map(visit: _Visit) -> str:
    roads = visit.town.roads
    lost = f"; left out: {', '.join(roads.dropped)}" if roads.dropped else ""
    return f"{len(roads.driveable)} lanes, {len(roads.posts)} lights, {len(roads.signs)} speed signs{lost}"


def _clock(visit: _Visit) -> str:
    began, frames = visit.connection.time, [visit.connection.tick() for _ in range(STEPS)]
    lasted = visit.connection.time - began
    _require(
        abs(lasted - STEPS * DT) < DT / 2 and frames == list(range(frames[0], frames[0] + STEPS)),
        f"found {lasted:.2f} s and the frames {frames[0]} to {frames[-1]} after {STEPS} steps, wanted {STEPS * DT:.2f} s "
        "and one frame a step: end other clients",
    )
    return f"{STEPS} steps are {lasted:.2f} s"


def _pace(visit: _Visit) -> str:
    began = time.perf_counter()
    visit.drive(Control(), STEPS * DT)
    pace = STEPS / (time.perf_counter() - began)
    _require(
        pace > 1 / DT,
        f"found {pace:.1f} steps a second, wanted more than {1 / DT:.0f}: start CARLA with -quality-level=Low",
    )
    return f"{pace:.0f} steps a second with a picture of {CAMERA.width} x {CAMERA.height}"


def _picture(visit: _Visit) -> str:
    [image] = visit.episode.look([CAMERA], RGB)
    pixels = picture(image)
    spread = float(pixels.std())
    _require(
        pixels.shape == (CAMERA.height, CAMERA.width, 3) and abs(image.fov - CAMERA.fov) < 0.1 and spread > 10,
        f"found {pixels.shape}, {image.fov:.0f} degrees and a spread of {spread:.0f}, wanted a picture of something: "
        "start CARLA with -RenderOffScreen, not with no rendering",
    )
    return f"{image.width} x {image.height}, {image.fov:.0f} degrees, a mean of {pixels.mean():.0f} and a spread of {spread:.0f}"


def _semantic(visit: _Visit) -> str:
    [image] = visit.episode.look([CAMERA], SEMANTIC)
    seen = classes(image)
    road, sky = float((seen[-20:] == Semantic.ROAD).mean()), float((seen[:20] != Semantic.ROAD).mean())
    _require(
        road > 0.5 and sky > 0.9,
        f"found {road:.0%} road below and {1 - sky:.0%} above, wanted a street: correct CLASSES",
    )
    return f"{road:.0%} of the lowest rows are road; classes: {', '.join(Semantic(k).name.lower() for k in np.unique(seen))}"


def _ego(visit: _Visit) -> str:
    ego, axle = visit.episode.state.ego, visit.episode.labels.front_axle
    _require(
        abs(ego.length - USUAL.length) < 0.3 and abs(ego.width - USUAL.width) < 0.3,
        f"found {MODEL} of {ego.length:.2f} x {ego.width:.2f} m, wanted about {USUAL.length} x {USUAL.width} m",
    )
    return f"{MODEL}, {ego.length:.2f} x {ego.width:.2f} m, front axle {axle:.2f} m ahead of its middle"


def _on_lane(visit: _Visit) -> str:
    seen = visit.episode.truth.affordances
    _require(
        abs(seen.center_distance) < 0.2 and abs(seen.relative_angle) < 0.05,
        f"found the car {seen.center_distance:.2f} m beside its line and turned by {seen.relative_angle:.2f} rad, wanted "
        "it on the line: the axes or the map differ",
    )
    return f"{seen.center_distance:+.2f} m beside the line of our map, turned by {seen.relative_angle:+.3f} rad"


def _pedals(visit: _Visit) -> str:
    visit.begin()
    visit.drive(Control(throttle=0.6), 4.0)
    speed, done = visit.episode.state.ego.speed, visit.episode.state.progress
    visit.drive(Control(brake=1.0), 3.0)
    stopped = visit.episode.state.ego.speed
    _require(
        speed > 3.0 and done > 4.0 and stopped < 0.2,
        f"found {speed:.1f} m/s after 4 s of throttle and {stopped:.1f} m/s after 3 s of brake, wanted 3 or more, and 0",
    )
    return f"{speed:.1f} m/s after 4 s at throttle 0.6, {stopped:.1f} after 3 s of the brake"


def _wheel(visit: _Visit) -> str:
    visit.begin()
    visit.drive(Control(throttle=0.5), 2.0)
    before = visit.episode.state.ego.pose
    visit.drive(Control(throttle=0.3, steer=0.3), 1.0)
    after = visit.episode.state.ego.pose
    turned = math.remainder(after.heading - before.heading, math.tau)
    _require(turned > 0.01, f"found a turn of {turned:+.3f} rad with the wheel to the left, wanted one to the left (+)")
    return f"{turned:+.3f} rad in a second with the wheel at +0.3 (left)"


def _lights(visit: _Visit) -> str:
    posts = visit.town.roads.posts
    lights = lights_at_posts(visit.connection, visit.town.roads)
    found = sum(light is not None for light in lights)
    _require(
        found == len(posts), f"found lights of CARLA's for {found} of the map's {len(posts)} stop lines, wanted all"
    )
    return f"all {len(posts)} stop lines of the map have one"


def _light_states(visit: _Visit) -> str:
    lights = lights_at_posts(visit.connection, visit.town.roads)
    if not lights or lights[0] is None:
        return "the map has none"
    states, shown = visit.connection.carla.TrafficLightState, []
    for state in (states.Red, states.Green):
        lights[0].set_state(state)
        visit.drive(Control(brake=1.0), 2 * DT)
        shown.append(visit.episode.state.lights[0].state)
    _require(
        shown == [LightState.RED, LightState.GREEN],
        f"found {[one.value for one in shown]}, wanted red and green as they were set",
    )
    return "red and green are read as they were set"


def _signs(visit: _Visit) -> str:
    actors = visit.connection.world.get_actors().filter("traffic.speed_limit.*")
    roads, known = visit.town.roads, 0
    for actor in actors:
        at, limit = place_of(actor.get_transform(), roads.offset), actor.type_id.rpartition(".")[2]
        known += any(
            str(sign.limit) == limit and math.hypot(sign.stands_at.x - at.x, sign.stands_at.y - at.y) < NEAR_SIGN
            for sign in roads.signs
        )
    _require(known == len(actors), f"found {known} of CARLA's {len(actors)} speed signs on the map, wanted all")
    return f"all {len(actors)} are where the map says"


def _collision(visit: _Visit) -> str:
    visit.begin()
    connection, roads = visit.connection, visit.town.roads
    place = transform_of(connection.carla, visit.route.line.pose_at(AHEAD), DROP, roads.offset)
    _require(connection.spawn(connection.blueprint(MODEL), place) is not None, "found no room for a car ahead")
    for _ in range(80):
        visit.episode.step(Control(throttle=0.6))
        for contact in visit.episode.state.contacts:
            _require(
                contact.kind is ContactKind.CAR and contact.at_fault, f"found {contact}, wanted a car that was hit"
            )
            return f"a car that was hit, with {contact.impulse:.0f} N s"
    raise ValueError("found no collision with a car in the way, wanted one")


def _cleaned_up(host: str, port: int) -> str:
    with closing(Connection(host, port)) as connection:
        left = connection.left_behind()
        synchronous = connection.world.get_settings().synchronous_mode
    _require(
        not left and not synchronous,
        f"found {len(left)} actors of ours and synchronous mode {synchronous}, wanted neither",
    )
    return "no actor of ours is left, and the clock is the server's own"


LOOKS: dict[str, Callable[[_Visit], str]] = {
    "map": _map, "clock": _clock, "pace": _pace, "picture": _picture, "classes of pixels": _semantic, "car": _ego,
    "car on its lane": _on_lane, "pedals": _pedals, "steering wheel": _wheel, "lights": _lights,
    "what lights show": _light_states, "speed signs": _signs, "collision": _collision,
}  # fmt: skip
