"""The agent: it drives by image, speed and command alone, from its own file alone."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from caldrive.agents.cal import OraclePerception
from caldrive.agents.modular_pipeline.checkpoint import SegmentationInfo, save_segmentation
from caldrive.agents.modular_pipeline.config import SegmentationConfig
from caldrive.agents.modular_pipeline.segmentation import SegmentationNetwork
from caldrive.agents.registry import agent_entry
from caldrive.agents.reinforcement.agent import ReinforcementAgent, load_agent
from caldrive.agents.reinforcement.checkpoint import PolicyInfo, encoder_info, load_policy, save_policy
from caldrive.agents.reinforcement.config import PolicyConfig
from caldrive.agents.reinforcement.encoder import Encoder, load_encoder
from caldrive.agents.reinforcement.inputs import AffordanceEye, FeatureEye, FrameEye
from caldrive.agents.reinforcement.policy import Policy
from caldrive.agents.rows import SHIPPED_MODEL
from caldrive.agents.settings import AgentSettings
from caldrive.datatypes import Affordances, CameraConfig, Command, Control, Observation, Pose
from caldrive.driving.setup import set_up
from caldrive.interfaces import BadImage
from caldrive.perception.network.backbone import Backbone
from caldrive.perception.network.tensor_file import CheckpointError, round_to_half
from caldrive.scenarios import Scenario
from tests.fakes import StraightRoad

PAPER = PolicyConfig("frames", "carla2017", repeat=1, memory=False, hidden=16)
LOOKING = replace(PAPER, action="continuous")
SCENARIO = Scenario("straight", 1, Pose(0, 0, 0), Pose(500, 0, 0), time_limit=60)


def lively(config: PolicyConfig) -> Policy:
    """A policy whose actions depend on what it sees."""
    torch.manual_seed(1)
    policy = Policy(config)
    torch.nn.init.normal_(policy.outputs.weight)
    return policy


def picture(size: tuple[int, int], number: int) -> np.ndarray:
    return np.random.default_rng(number).integers(0, 30 + 18 * number, (*size, 3), np.uint8)


def observation(number: int, size: tuple[int, int] = (84, 84), command: Command = Command.LEFT) -> Observation:
    return Observation(number / 10, picture(size, number), 5.0 + number, command)


def small_encoder() -> Encoder:
    torch.manual_seed(0)
    return Encoder(Backbone(0.05, batch_norm=True).eval(), (64, 64))


def test_the_same_observations_give_the_same_controls_and_others_give_others() -> None:
    def drive(*numbers: int) -> list[Control]:
        agent = ReinforcementAgent(lively(LOOKING), FrameEye())
        agent.reset()
        return [agent.act(observation(k)) for k in numbers]

    assert drive(0, 1, 2, 3, 4) == drive(0, 1, 2, 3, 4)
    assert len(set(drive(*range(12)))) > 1


def test_a_decision_holds_for_some_steps() -> None:
    world = StraightRoad()
    agent = ReinforcementAgent(lively(PolicyConfig(repeat=3)), AffordanceEye(OraclePerception(world.truth)))
    seen = world.reset(SCENARIO)
    agent.reset()
    controls = [agent.act(seen := world.step(agent.act(seen))) for _ in range(6)]
    assert controls[0] == controls[1] or controls[1] == controls[2]
    agent.reset()
    held = [agent.act(replace(seen, speed=float(k))) for k in range(6)]
    assert held[0] == held[1] == held[2] != held[3] == held[4] == held[5]


def test_where_the_image_is_no_use_it_brakes_and_says_why() -> None:
    agent = ReinforcementAgent(lively(PAPER), FrameEye())
    agent.reset()
    assert agent.act(replace(observation(0), image=np.zeros((84, 84, 3), np.uint8))) == Control(brake=1.0)
    assert agent.decision is not None
    assert "black" in agent.decision.note
    agent.act(observation(0, (88, 200)))
    assert "(88, 200, 3)" in agent.decision.note
    assert agent.act(observation(1)) == agent.decision.control
    assert "policy on frames" in agent.decision.note


def test_one_sees_the_affordances_that_another_decides_on() -> None:
    class Seen:
        def reset(self) -> None: ...

        def predict(self, observation: Observation) -> Affordances:
            if math.isnan(observation.speed):
                raise BadImage("no use")
            return Affordances(relative_angle=0.3)

    agent = ReinforcementAgent(lively(PolicyConfig()), AffordanceEye(Seen()))
    agent.act(observation(0))
    assert agent.decision is not None
    assert agent.decision.affordances == Affordances(relative_angle=0.3)
    assert isinstance(agent.perception, Seen)
    with pytest.raises(AttributeError, match="sees no affordances"):
        _ = ReinforcementAgent(lively(PAPER), FrameEye()).perception


def test_a_policy_and_its_encoder_come_back_from_their_file(tmp_path: Path) -> None:
    encoder = small_encoder()
    config = PolicyConfig("features", hidden=16, n_features=encoder.n_features)
    info = PolicyInfo(config, {"steps": 7}, seed=3, steps=7, encoder=encoder_info(encoder))
    save_policy(tmp_path / "rl.safetensors", lively(config), info, encoder)
    _, known, frozen = load_policy(tmp_path / "rl.safetensors")
    assert known == info
    assert frozen is not None
    images = torch.rand(2, 3, 64, 64)
    with torch.inference_mode():
        assert frozen.backbone.eval()(images).numpy() == pytest.approx(encoder.backbone(images).numpy(), abs=0.05)
    agent = load_agent(tmp_path / "rl.safetensors", lambda: pytest.fail("it sees no affordances"))
    assert isinstance(agent.inputs.eye, FeatureEye)
    agent.reset()
    assert agent.act(observation(0, (64, 64))) == agent.act(observation(12, (64, 64)))  # it holds


def test_an_encoder_is_read_from_the_modular_pipelines_file(tmp_path: Path) -> None:
    config = SegmentationConfig(image_width=64, image_height=64, width=0.05)
    network, path = SegmentationNetwork(config).eval(), tmp_path / "mp.safetensors"
    round_to_half(network)
    save_segmentation(path, network, SegmentationInfo(config))
    encoder, images = load_encoder(path), torch.rand(1, 3, 64, 64)
    assert encoder.image_size == (64, 64)
    with torch.inference_mode():
        assert torch.equal(encoder.backbone(images), network.backbone(images))
    with pytest.raises(CheckpointError, match="weights of the agent cal, wanted those of mp"):
        load_encoder(SHIPPED_MODEL)


def test_weights_of_another_agent_are_refused_by_its_name(tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match="weights of the agent cal, wanted those of rl: type --agent cal"):
        set_up(AgentSettings(agent="rl", model=SHIPPED_MODEL))


def test_weights_that_do_not_fit_or_are_not_numbers_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "rl.safetensors"
    save_policy(path, lively(PAPER), PolicyInfo(replace(PAPER, hidden=8)))
    with pytest.raises(CheckpointError, match="do not fit its own settings"):
        load_policy(path)
    policy = lively(PAPER)
    policy.outputs.bias.data.fill_(math.nan)
    save_policy(path, policy, PolicyInfo(PAPER))
    with pytest.raises(CheckpointError, match="not numbers"):
        load_policy(path)
    save_policy(path, lively(PAPER), PolicyInfo(replace(PAPER, sees="features", n_features=4)))
    with pytest.raises(CheckpointError):
        load_policy(path)


def test_without_a_policy_it_is_said_what_to_type() -> None:
    with pytest.raises(FileNotFoundError, match=r"wanted one for the agent rl: .*train --agent rl"):
        set_up(AgentSettings(agent="rl"))


def test_the_row_asks_for_the_camera_that_the_policy_looks_through(tmp_path: Path) -> None:
    path = tmp_path / "rl.safetensors"
    settings = AgentSettings(agent="rl", model=path)
    save_policy(path, lively(PAPER), PolicyInfo(PAPER))
    row = agent_entry("rl")
    assert row.camera(settings) == CameraConfig(width=84, height=84)
    assert row.provenance(settings)["precision"] is None
    assert isinstance(row.make(settings, 0.1, None), ReinforcementAgent)
    with pytest.raises(ValueError, match="a policy that sees frames, wanted one on affordances: type --agent rl"):
        agent_entry("rl-oracle").provenance(settings)
    config = PolicyConfig(hidden=16)
    save_policy(path, lively(config), PolicyInfo(config))
    assert row.camera(settings) == CameraConfig()
    assert len(row.provenance(settings)["model"].split()) == 2
    with pytest.raises(ValueError, match="but the agent rl takes none"):
        row.provenance(replace(settings, controller="paper"))


def test_a_policy_that_learnt_from_another_network_is_refused(tmp_path: Path) -> None:
    path, config = tmp_path / "rl.safetensors", PolicyConfig(hidden=16)
    save_policy(path, lively(config), PolicyInfo(config, perception="0123456789abcdef"))
    with pytest.raises(ValueError, match="learnt from the affordances of network 0123456789abcdef, wanted that of"):
        set_up(AgentSettings(agent="rl", model=path))


def test_a_policy_on_affordances_drives_by_cals_network_or_by_the_truth(tmp_path: Path) -> None:
    path, config = tmp_path / "rl.safetensors", PolicyConfig(hidden=16)
    save_policy(path, lively(config), PolicyInfo(config))
    blind = AgentSettings(agent="rl-oracle", model=path, blind=("red_light",))
    world, agent = set_up(blind)
    assert agent_entry("rl-oracle").privileged
    assert isinstance(agent, ReinforcementAgent)
    assert not isinstance(agent.perception, OraclePerception)  # but the blind one around it
    world.close()
    assert agent_entry("rl").privileged is False
