"""Which moments of a drive are worth recording."""

from __future__ import annotations

from collections.abc import Iterator

from caldrive.datatypes import Observation
from caldrive.world.embedded import EmbeddedWorld

PATIENCE, SEARCH = 2, 6  # times the wanted duration that a drive may last; of a tailgater, who has to find a car
BEGINNING = 6  # a tailgater's first moments tell, one in so many of those wanted, and later it takes a car
MEETING = 25.0  # m; a car ahead that is nearer
STANDING = 0.1  # m/s
STOOD = 15  # moments that tell when the car comes to stand,
RUN, EVERY = 9, 135  # and then a run of so many in so many: single ones would have no history


def moments(world: EmbeddedWorld, duration: float, tailgating: bool) -> Iterator[tuple[int, Observation, bool]]:
    """Moments by number, and whether each tells something new, until `duration` (s) of them did, patience or the route
    ends, or the car touches something.

    A car that stands tells the same until what it should stop for changes. A tailgater tells at first, for the empty
    street, and then where a car is near.
    """
    wanted, told, stood, before = round(duration / world.dt), 0, 0, (0.0, 0.0)
    beginning = max(1, wanted // BEGINNING)
    for index in range((SEARCH if tailgating else PATIENCE) * wanted):
        labels = world.truth().affordances
        reasons = labels.hazard_stop, labels.red_light
        stood = stood + 1 if world.observation.speed < STANDING and reasons == before else 0
        before = reasons
        telling = stood <= STOOD or stood % EVERY < RUN
        telling = telling and (not tailgating or index < beginning or labels.vehicle_distance < MEETING)
        told += telling
        yield index, world.observation, telling
        truth = world.truth()
        if told == wanted or truth.contacts or truth.route_done >= truth.route_length - 5:
            return
