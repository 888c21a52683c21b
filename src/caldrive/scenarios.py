"""A scenario in JSON's types: in recordings, results and suites."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from caldrive.datatypes import Scenario
from caldrive.typed import as_type


def scenario_values(scenario: Scenario) -> dict[str, Any]:
    """A scenario in JSON's types; an infinite time limit becomes null."""
    return asdict(scenario) | {"time_limit": None if math.isinf(scenario.time_limit) else scenario.time_limit}


def scenario_from_values(values: dict[str, Any]) -> Scenario:
    """The inverse of `scenario_values`. Raises ValueError for what is no scenario."""
    return as_type({name: value for name, value in values.items() if (name, value) != ("time_limit", None)}, Scenario)
