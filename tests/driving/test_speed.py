"""How long an agent takes is measured as it is examined: it is given no more."""

from __future__ import annotations

from typing import Any

import pytest

from caldrive.agents.rows import AgentEntry
from caldrive.datatypes import CameraConfig, Control, Observation
from caldrive.driving import speed
from caldrive.driving.settings import AgentSpeedSettings
from caldrive.interfaces import TruthSource

ASIDE = CameraConfig(width=64, height=32)


class Still:
    """Notes what it is given, and stands."""

    truth: TruthSource | None
    seen: Observation

    def reset(self) -> None:
        """It remembers nothing."""

    def act(self, observation: Observation) -> Control:
        self.seen = observation
        return Control(brake=1.0)


@pytest.mark.parametrize("privileged", [False, True])
def test_the_truth_is_for_privileged_agents_and_the_second_camera_for_who_asks(
    privileged: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    agent = Still()

    def make(settings: Any, dt: float, truth: TruthSource | None) -> Still:
        agent.truth = truth
        return agent

    entry = AgentEntry(
        make=make, camera=lambda _: ASIDE, provenance=lambda _: {}, privileged=privileged, auxiliary=lambda _: ASIDE
    )
    monkeypatch.setattr(speed, "agent_entry", lambda name: entry)
    found = speed.measure_agent(AgentSpeedSettings(agent="still", steps=2))
    assert (found.width, found.height) == (64, 32)
    assert (agent.truth is not None) == privileged
    assert agent.seen.auxiliary is not None
    assert agent.seen.auxiliary.shape == (32, 64, 3)
