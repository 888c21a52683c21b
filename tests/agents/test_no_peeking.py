"""No agent under test can peek: it gives the same controls whatever the truth, the map and the route are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from caldrive.agents.conditional_imitation.checkpoint import ImitationInfo, save_imitation
from caldrive.agents.conditional_imitation.network import ImitationNetwork
from caldrive.agents.modular_pipeline.checkpoint import SegmentationInfo, save_segmentation
from caldrive.agents.modular_pipeline.config import SegmentationConfig
from caldrive.agents.modular_pipeline.segmentation import SegmentationNetwork
from caldrive.agents.registry import AGENTS, agent_entry
from caldrive.agents.reinforcement.checkpoint import PolicyInfo, save_policy
from caldrive.agents.reinforcement.config import PolicyConfig
from caldrive.agents.reinforcement.policy import Policy
from caldrive.agents.settings import AgentSettings
from caldrive.datatypes import Command, Control, Observation, Pose, Truth
from caldrive.driving import setup
from caldrive.driving.setup import set_up
from caldrive.scenarios import Scenario
from tests.agents.conditional_imitation.data import SMALL
from tests.fakes import StraightRoad

SCENARIO = Scenario("straight", 1, Pose(0, 0, 0), Pose(500, 0, 0), time_limit=60)
LOOKING = PolicyConfig("frames", repeat=1, memory=False, hidden=16)


class NoiseWorld(StraightRoad):
    """All that an agent could peek at is noise, and who looks at it is noted."""

    asked = 0

    def truth(self) -> Truth:
        self.asked += 1
        truth, rng = super().truth(), np.random.default_rng(self.asked)
        seen = replace(truth.affordances, hazard_stop=True, red_light=True, relative_angle=rng.normal())
        return replace(truth, affordances=seen, route_done=rng.uniform(0, 400))


def imitation(path: Path) -> None:
    save_imitation(path, ImitationNetwork(SMALL), ImitationInfo(SMALL))


def pipeline(path: Path) -> None:
    config = SegmentationConfig(image_width=64, image_height=32, width=1 / 8)
    save_segmentation(path, SegmentationNetwork(config), SegmentationInfo(config))


def policy(path: Path, config: PolicyConfig = LOOKING) -> None:
    actor = Policy(config)
    torch.nn.init.normal_(actor.outputs.weight)  # else it acts alike whatever it sees
    save_policy(path, actor, PolicyInfo(config))


def affordance_policy(path: Path) -> None:
    policy(path, PolicyConfig("affordances", hidden=16))


MODELS: dict[str, tuple[str, Callable[[Path], None] | None]] = {
    "CAL": ("cal", None),
    "imitation": ("cil", imitation),
    "pipeline": ("mp", pipeline),
    "policy on frames": ("rl", policy),
    "policy on CAL's affordances": ("rl", affordance_policy),
}


def test_every_agent_under_test_is_caught_where_it_peeks() -> None:
    assert {name for name, _ in MODELS.values()} == {name for name, row in AGENTS.items() if not row.privileged}


@pytest.mark.parametrize("which", MODELS)
def test_an_agent_gives_the_same_controls_where_truth_and_route_are_noise(
    which: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, save = MODELS[which]
    torch.manual_seed(1)
    if save is not None:
        save(tmp_path / "model.safetensors")
    settings = AgentSettings(agent=name, model=tmp_path / "model.safetensors" if save else None)
    camera = agent_entry(name).camera(settings)
    assert camera is not None
    rng = np.random.default_rng(3)
    images = rng.integers(0, 255, (5, camera.height, camera.width, 3), np.uint8)
    images[1:3] = images[1:3] // 4 + 90
    seen = [Observation(k / 10, image, 3.0 + k, Command.LEFT) for k, image in enumerate(images)]

    def drive(world: StraightRoad) -> list[Control]:
        monkeypatch.setattr(setup, "make_world", lambda *_, **__: world)
        _, agent = set_up(settings)
        world.reset(SCENARIO)
        agent.reset()
        controls = []
        for observation in seen:
            controls.append(agent.act(observation))
            StraightRoad.step(world, Control(throttle=1.0))
        return controls

    controls = drive(StraightRoad())
    noise = NoiseWorld(light=20.0, speed=30)
    assert drive(noise) == controls
    assert not noise.asked
    assert len(set(controls)) > 1
