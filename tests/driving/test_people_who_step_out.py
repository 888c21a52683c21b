"""People who step out: an attentive driver touches none of them, one who does not look does."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace

import pytest

from caldrive.agents.settings import AgentSettings
from caldrive.driving.referee import Referee
from caldrive.driving.rollout import run_episode
from caldrive.driving.rules import STRICT
from caldrive.driving.setup import set_up
from caldrive.driving.tasks import task_scenarios
from caldrive.results import InfractionKind


@pytest.mark.parametrize("route", [0, 1])
@pytest.mark.parametrize(("blind", "touches"), [((), False), (("hazard_stop",), True)], ids=["attentive", "blind"])
def test_who_looks_touches_nobody_and_who_does_not_does(
    blind: tuple[str, ...], touches: bool, route: int, no_sumo_left: None
) -> None:
    scenario = task_scenarios("town01", "navigation-dynamic", seed=5)[route]
    crowd = replace(scenario, n_vehicles=0, n_pedestrians=80, crossing=4.0, time_limit=120.0)
    world, agent = set_up(AgentSettings(agent="oracle", cap=20.0, blind=blind))
    with closing(world):
        result = run_episode(world, agent, crowd, referee=Referee(crowd, rules=STRICT))
    assert result.distance > 300.0
    assert bool(result.touches) is touches
    assert all(touch.kind is InfractionKind.COLLISION_PERSON and touch.at_fault for touch in result.touches)
