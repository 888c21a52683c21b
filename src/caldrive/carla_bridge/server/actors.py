"""The actors of an episode: what every one of them has, and the kinds that only stand, look or listen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum

from caldrive.carla_bridge.axes import Placement, compose
from caldrive.carla_bridge.server.layouts import ActorDescription, AttributeValue, BoundingBox, Vector
from caldrive.carla_bridge.server.snapshot import NOTHING, Triple

STILL: tuple[Triple, Triple, Triple] = (NOTHING, NOTHING, NOTHING)
OFF_GROUND = 5.0  # m above or below the ground, from which on nothing is met
NOBODY = 0  # the owner of what is there from the beginning
ActorLayout = tuple[int, int, ActorDescription, BoundingBox, bytes, bytes]


class Label(IntEnum):
    """CARLA's semantic classes, as far as there is something of them here."""

    ROAD = 1
    SIDEWALK = 2
    BUILDING = 3
    WALL = 4
    FENCE = 5
    POLE = 6
    LIGHT = 7
    SIGN = 8
    VEGETATION = 9
    TERRAIN = 10
    SKY = 11
    PEDESTRIAN = 12
    CAR = 14
    STATIC = 20
    LINE = 24


LABELS = {  # by the beginning of an actor's id
    "vehicle.": Label.CAR, "walker.": Label.PEDESTRIAN, "traffic.traffic_light": Label.LIGHT, "traffic.": Label.SIGN,
    "static.": Label.STATIC,
}  # fmt: skip


@dataclass(eq=False)
class Actor:
    """Something in the world with a number. Its place is relative to its parent's where it has one."""

    id: int
    description: ActorDescription
    own_place: Placement
    owner: int = NOBODY
    """Whose it is: the number of a client's connection."""
    parent: Actor | None = None
    box: BoundingBox = BoundingBox()
    stream: int = 0
    """The number of its stream, 0 for none."""
    sign: str = ""
    """Of a sign or a light: its id on the map."""
    motion: tuple[Triple, Triple, Triple] = STILL
    """Velocity (m/s), angular velocity (degrees/s) and acceleration (m/s²), in CARLA's axes."""
    children: list[Actor] = field(default_factory=list)

    @property
    def kind(self) -> str:
        """Its type, such as `vehicle.tesla.model3`."""
        return self.description.id

    @property
    def place(self) -> Placement:
        """Where it is."""
        return compose(self.parent.place, self.own_place) if self.parent else self.own_place

    @property
    def is_aside(self) -> bool:
        """Whether a program has put it far below the ground, where it waits to be needed."""
        return self.own_place.z <= -OFF_GROUND

    @property
    def depth(self) -> int:
        """How many actors it is attached to in a row."""
        return self.parent.depth + 1 if self.parent else 0

    def put(self, place: Placement) -> None:
        """It is at a place from now on; as CARLA has it, that is relative for what is attached."""
        self.own_place = place

    def layout(self, token: bytes) -> ActorLayout:
        """As it goes to a client."""
        label = next((label for begin, label in LABELS.items() if self.kind.startswith(begin)), None)
        tags = bytes([label]) if label is not None else b""
        return self.id, self.parent.id if self.parent else 0, self.description, self.box, tags, token


def is_on_ground(place: Placement) -> bool:
    """Whether something meets what is in the town."""
    return abs(place.z) < OFF_GROUND


def box_of(size: Sequence[float], up: float) -> BoundingBox:
    """A box of a length, width and height in m, whose middle is so far above its actor's origin."""
    length, width, height = size
    return BoundingBox(Vector(0.0, 0.0, up), Vector(length / 2, width / 2, height / 2))


def description(id: str, **attributes: str) -> ActorDescription:
    """Of an actor that no client asked for."""
    return ActorDescription(0, id, tuple(AttributeValue(name, 4, value) for name, value in attributes.items()))


@dataclass(eq=False)
class NativeCar(Actor):
    """A car of the town's own, which SUMO drives."""

    limit: float = 30.0
    """km/h, the lawful one where it is."""


@dataclass(eq=False)
class Prop(Actor):
    """A thing that a client put somewhere: it can be hit, and is not drawn."""
