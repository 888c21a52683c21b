"""The agents that commands drive with: the network that ships, where its car was put."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from caldrive.agents.cal import CALAgent
from caldrive.agents.registry import agent_entry
from caldrive.agents.rows import SHIPPED_MODEL
from caldrive.agents.settings import AgentSettings
from caldrive.driving.setup import set_up
from caldrive.driving.tasks import task_scenarios
from caldrive.interfaces import is_recordable
from caldrive.perception.network.checkpoint import load_network, save_network


def test_the_network_that_ships_is_small() -> None:
    assert SHIPPED_MODEL.stat().st_size < 10e6


@pytest.mark.parametrize("aside", [-1.0, 1.5, 3.5])
def test_the_network_that_ships_knows_how_far_aside_it_is_and_comes_back(aside: float) -> None:
    world, agent = set_up(AgentSettings(cap=20.0))
    assert is_recordable(world)
    assert isinstance(agent, CALAgent)
    for scenario in task_scenarios("town01", "straight", weather=8)[:2]:
        world.reset(scenario)
        observation, seen = world.displace(aside, 0.0), []
        agent.reset()
        for _ in range(80):
            control = agent.act(observation)
            assert agent.decision is not None
            assert agent.decision.affordances is not None
            seen.append(agent.decision.affordances.center_distance)
            observation = world.step(control)
        assert np.mean(seen[:5]) == pytest.approx(max(-2.0, -aside), abs=0.3)
        assert abs(world.truth().affordances.center_distance) < 0.2
    world.close()


def test_a_network_that_would_take_many_times_as_long_does_not_drive(tmp_path: Path) -> None:
    network, info = load_network(SHIPPED_MODEL)
    save_network(tmp_path / "slow.safetensors", network, replace(info, ranges=()), half=True)
    with pytest.raises(ValueError, match=r"found no ranges for 8-bit integers in .*slow\.safetensors"):
        set_up(AgentSettings(model=tmp_path / "slow.safetensors"))


def test_a_model_for_the_oracle_is_refused_before_anything_is_driven() -> None:
    settings = AgentSettings(agent="oracle", model=Path("none.safetensors"))
    with pytest.raises(ValueError, match=r"found --model none\.safetensors, but the oracle takes none"):
        agent_entry("oracle").provenance(settings)
    with pytest.raises(ValueError, match=r"found --model none\.safetensors, but the oracle takes none"):
        set_up(settings)
