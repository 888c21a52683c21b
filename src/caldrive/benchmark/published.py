"""Published numbers, for the columns beside ours: the paper's success (table 1) and kilometres between infractions
(table 2), and CAL's success in NoCrash, which others drove (Codevilla et al. 2019)."""

from __future__ import annotations

from collections.abc import Collection

from caldrive.benchmark.suites import CONDITIONS, DENSITIES
from caldrive.driving.tasks import TASKS
from caldrive.results import InfractionKind

SYSTEMS = ("MP", "CIL", "RL", "CAL")

_ROWS = tuple(CONDITIONS)

# Percent of episodes: straight, one turn, navigation, navigation dynamic; a row for each condition.
_SUCCESS = {
    "MP": ((98, 82, 80, 77), (100, 95, 94, 89), (92, 61, 24, 24), (50, 50, 47, 44)),
    "CIL": ((95, 89, 86, 83), (98, 90, 84, 82), (97, 59, 40, 38), (80, 48, 44, 42)),
    "RL": ((89, 34, 14, 7), (86, 16, 2, 2), (74, 12, 3, 2), (68, 20, 6, 4)),
    "CAL": ((100, 97, 92, 83), (100, 96, 90, 82), (93, 82, 70, 64), (94, 72, 68, 64)),
}
# Percent of episodes: empty, regular, dense; a row for each condition.
_NOCRASH = {"CAL": ((81, 73, 42), (85, 68, 33), (36, 26, 9), (25, 14, 10))}
# A row for each condition, a column for each of SYSTEMS; `>` where no infraction occurred.
_KM = {
    InfractionKind.OPPOSITE_LANE:
        "10.2 33.4 0.18 6.7 | 16.1 57.3 0.09 >60 | 0.45 1.12 0.23 2.21 | 0.40 0.78 0.21 2.24",
    InfractionKind.SIDEWALK:
        "18.3 12.9 0.75 6.1 | 24.2 >57 0.72 6.0 | 0.46 0.76 0.43 0.88 | 0.43 0.81 0.48 1.34",
    InfractionKind.COLLISION_OBJECT:
        "10.0 5.38 0.42 2.5 | 16.1 4.05 0.24 6.0 | 0.44 0.40 0.23 0.36 | 0.45 0.28 0.25 0.31",
    InfractionKind.COLLISION_CAR:
        "16.4 3.26 0.58 12.1 | 20.2 1.86 0.85 >60 | 0.51 0.59 0.41 2.04 | 0.47 0.44 0.37 1.68",
    InfractionKind.COLLISION_PERSON:
        "18.9 6.35 17.8 30.3 | 20.4 11.2 20.6 >60 | 1.40 1.88 2.55 26.49 | 1.46 1.41 2.00 6.72",
}  # fmt: skip
# Supplement 3.2: median distance to the centre line (m), RMS jerk (m/s³); MP was not measured.
COMFORT = {
    "CIL": {"center_distance": 0.390, "jerk": 0.449, "lateral_straight": 0.084, "lateral_turn": 0.242},
    "RL": {"center_distance": 0.755, "jerk": 1.368, "lateral_straight": 0.336, "lateral_turn": 0.548},
    "CAL": {"center_distance": 0.334, "jerk": 0.333, "lateral_straight": 0.052, "lateral_turn": 0.065},
}


def success(system: str, condition: str, task: str, suites: Collection[str] = ()) -> int | None:
    """Percent of a system's episodes that reached their goal; None where nobody says. suites: that our own results are
    of, as for traffic school, which has NoCrash's cells, nobody says how CAL drives."""
    if task in DENSITIES and "traffic-school" in suites:
        return None
    for tasks, table in ((TASKS, _SUCCESS), (tuple(DENSITIES), _NOCRASH)):
        if system in table and condition in CONDITIONS and task in tasks:
            return table[system][_ROWS.index(condition)][tasks.index(task)]
    return None


def km_between(system: str, condition: str, kind: InfractionKind) -> str:
    """Kilometres between two infractions, as printed; empty where the paper says nothing."""
    if system not in SYSTEMS or condition not in CONDITIONS or kind not in _KM:
        return ""
    return _KM[kind].split(" | ")[_ROWS.index(condition)].split()[SYSTEMS.index(system)]
