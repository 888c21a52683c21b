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
from caldrive.agents.reinforcement.checkpoint import PolicyInfo, encoder_info, save_policy
from caldrive.agents.reinforcement.config import PolicyConfig
from caldrive.agents.reinforcement.encoder import Encoder
from caldrive.agents.reinforcement.policy import Policy
from caldrive.agents.settings import AgentSettings
from caldrive.datatypes import Command, Control, Observation, Pose, Truth
from caldrive.driving import setup
from caldrive.driving.setup import set_up
from caldrive.perception.network.backbone import Backbone
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


def feature_policy(path: Path) -> None:
    encoder = Encoder(Backbone(0.05, batch_norm=True).eval(), (64, 64))
    config = PolicyConfig("features", hidden=16, n_features=encoder.n_features)
    torch.manual_seed(1)
    actor = Policy(config)
    torch.nn.init.normal_(actor.outputs.weight)
    save_policy(path, actor, PolicyInfo(config, encoder=encoder_info(encoder)), encoder)


MODELS: dict[str, tuple[str, Callable[[Path], None] | None, str | None]] = {
    "CAL": ("cal", None, None),
    "imitation": ("cil", imitation, None),
    "imitation that avoids stopping": ("cil", imitation, "avoid-stopping"),
    "pipeline": ("mp", pipeline, None),
    "pipeline with a second camera": ("mp", pipeline, "auxiliary-camera"),
    "policy on frames": ("rl", policy, None),
    "policy on features": ("rl", feature_policy, None),
    "policy on CAL's affordances": ("rl", affordance_policy, None),
}


def test_every_agent_under_test_is_caught_where_it_peeks() -> None:
    tried = {(name, variant) for name, _, variant in MODELS.values()}
    under_test = {name: row for name, row in AGENTS.items() if not row.privileged}
    assert tried == {(name, variant) for name, row in under_test.items() for variant in (None, *row.variants)}


@pytest.mark.parametrize("which", MODELS)
def test_an_agent_gives_the_same_controls_where_truth_and_route_are_noise(
    which: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, save, variant = MODELS[which]
    torch.manual_seed(1)
    if save is not None:
        save(tmp_path / "model.safetensors")
    settings = AgentSettings(agent=name, model=tmp_path / "model.safetensors" if save else None, variant=variant)
    camera = agent_entry(name).camera(settings)
    assert camera is not None
    rng = np.random.default_rng(3)
    images = rng.integers(0, 255, (5, camera.height, camera.width, 3), np.uint8)
    images[1:3] = images[1:3] // 4 + 90
    second = images[::-1] if variant == "auxiliary-camera" else [None] * len(images)
    seen = [Observation(k / 10, images[k], 3.0 + k, Command.LEFT, auxiliary=second[k]) for k in range(len(images))]

    def drive(world: StraightRoad, scenario: Scenario) -> list[Control]:
        monkeypatch.setattr(setup, "make_world", lambda *_, **__: world)
        _, agent = set_up(settings)
        world.reset(scenario)
        agent.reset()
        controls = []
        for observation in seen:
            controls.append(agent.act(observation))
            StraightRoad.step(world, Control(throttle=1.0))
        return controls

    controls = drive(StraightRoad(), SCENARIO)
    noise = NoiseWorld(light=20.0, speed=30, route=rng.normal(scale=50.0, size=(40, 2)).cumsum(axis=0))
    elsewhere = replace(SCENARIO, town="nowhere", weather=14, start=Pose(3, 9, 2), goal=Pose(-40, 70, 0))
    assert drive(noise, elsewhere) == controls
    assert not noise.asked
    assert len(set(controls)) > 1
