"""The table of the affordances (Fig. 3): what each one is. Everything that lists affordances reads it.

To add one, give it the same name in each of these; then record and train again:

* `datatypes.Affordances`: a field; `datatypes.Alternative`, too, where it depends on the command
* `SPECS` here: a row
* `world/truth/labels.py`: what labels it
* `recordings/writer.py`: FORMAT_VERSION raised; `recordings/check.py`: bins of its histogram, where it is continuous
* `perception/network/config.py`: its task block; `perception/training/config.py`: its weight in the loss
* `visualization/gauges.py`: how it is drawn; `benchmark/report/runs.py`: from which error on it counts as wrong
* `search/config.py`, `search/space.py`: its task, and the paper's figures; `explain/faithfulness.py`: what it is about
* `control/`: what it changes, if anything
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from caldrive.datatypes import MAX_CENTER_DISTANCE, MAX_VEHICLE_DISTANCE, SPEED_SIGNS


@dataclass(frozen=True)
class AffordanceSpec:
    """One affordance.

    classes: its values, where 0 stands for none or false; empty for a continuous one. scale: what the network's output
    is multiplied by. low, high: its range. conditional: whether it depends on the command. unit: SI, or km/h on signs.
    """

    name: str
    classes: tuple[int, ...] = ()
    scale: float = 1.0
    low: float = 0.0
    high: float = 1.0
    conditional: bool = False
    unit: str = ""

    @property
    def discrete(self) -> bool:
        """Whether it has classes."""
        return bool(self.classes)

    @property
    def binary(self) -> bool:
        """Whether it is a probability."""
        return len(self.classes) == 2

    @property
    def outputs(self) -> int:
        """Output nodes of the network for one command."""
        return len(self.classes) or 1

    @property
    def metric(self) -> str:
        """The name of its figure in an evaluation: mean IoU of a discrete one, mean absolute error of the others."""
        return f"{self.name}/{'iou' if self.discrete else 'mae'}"

    @property
    def title(self) -> str:
        """The name in words."""
        return self.name.replace("_", " ")


SPECS = (
    AffordanceSpec("hazard_stop", classes=(0, 1)),
    AffordanceSpec("red_light", classes=(0, 1)),
    AffordanceSpec("speed_sign", classes=(0, *SPEED_SIGNS), unit="km/h"),
    AffordanceSpec("vehicle_distance", scale=50.0, high=MAX_VEHICLE_DISTANCE, unit="m"),
    AffordanceSpec("relative_angle", scale=0.759, low=-math.pi, high=math.pi, conditional=True, unit="rad"),
    AffordanceSpec("center_distance", scale=1.65, low=-MAX_CENTER_DISTANCE, high=MAX_CENTER_DISTANCE, conditional=True,
                   unit="m"),
)  # fmt: skip
BY_NAME: Mapping[str, AffordanceSpec] = {spec.name: spec for spec in SPECS}
BINARY = tuple(spec for spec in SPECS if spec.binary)
DISCRETE = tuple(spec for spec in SPECS if spec.discrete)
CONTINUOUS = tuple(spec for spec in SPECS if not spec.discrete)
CONDITIONAL = tuple(spec for spec in SPECS if spec.conditional)


def describe() -> list[dict[str, Any]]:
    """The table in plain values, as a checkpoint keeps it."""
    return [asdict(spec) | {"classes": list(spec.classes)} for spec in SPECS]
