"""A scenario as text: in recordings, results and suites."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from typing import Any

from caldrive.datatypes import Pose, Scenario


def scenario_to_json(scenario: Scenario) -> str:
    """A scenario as JSON; an infinite time limit becomes null."""
    values = asdict(scenario)
    values["time_limit"] = None if math.isinf(scenario.time_limit) else scenario.time_limit
    return json.dumps(values)


def scenario_from_json(text: str) -> Scenario:
    """The inverse of `scenario_to_json`."""
    values: dict[str, Any] = json.loads(text)
    values["start"], values["goal"] = Pose(**values["start"]), Pose(**values["goal"])
    values["time_limit"] = math.inf if values["time_limit"] is None else values["time_limit"]
    return Scenario(**values)
