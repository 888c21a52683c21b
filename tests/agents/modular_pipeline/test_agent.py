"""The modular pipeline at the wheel."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from caldrive.agents.modular_pipeline.agent import CRUISE, ModularPipelineAgent, auxiliary_camera
from caldrive.agents.modular_pipeline.checkpoint import SegmentationInfo, save_segmentation
from caldrive.agents.modular_pipeline.config import SegmentationConfig
from caldrive.agents.modular_pipeline.planner import State
from caldrive.agents.modular_pipeline.pursuit import CAR, PursuitState, motion, pursue, wheel_angle
from caldrive.agents.modular_pipeline.scene import SceneClass
from caldrive.agents.modular_pipeline.segmentation import SegmentationNetwork
from caldrive.agents.registry import provenance
from caldrive.agents.settings import AgentSettings
from caldrive.datatypes import DT, KMH, CameraConfig, Command, Control, Observation, Pose
from caldrive.driving.rollout import run_episode
from caldrive.driving.setup import make_world, set_up
from caldrive.driving.tasks import task_scenarios
from caldrive.geometry import moved
from caldrive.results import Outcome
from caldrive.world.embedded import EmbeddedWorld
from caldrive.world.traffic.ego import EgoState, VehicleConfig, advance
from tests.agents.modular_pipeline.semantic_world import CAMERA, SemanticWorld, true_agent


def picture(kind: SceneClass = SceneClass.ROAD, near: bool = False) -> np.ndarray:
    """A semantic picture of the sky above, and of one kind of ground below."""
    image = np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8)
    image[..., 0] = SceneClass.STATIC
    image[CAMERA.height // 2 :, :, 0] = kind
    image[..., 1] = near
    return image


def seen(image: np.ndarray, command: Command = Command.STRAIGHT, speed: float = 3.0) -> Observation:
    return Observation(0.0, image, speed, command)


def test_odometry_knows_what_the_ego_does() -> None:
    state, angle, pose = EgoState(Pose(0.0, 0.0, 0.0), speed=5.0), 0.0, Pose(0.0, 0.0, 0.0)
    for k in range(30):
        steer = 0.5 * math.sin(k / 5)
        angle = wheel_angle(angle, steer, DT)
        state = advance(state, Control(throttle=0.1, steer=steer), DT, VehicleConfig())
        step = motion(state.speed, angle, DT)
        pose = moved(pose, step.x, step.y, step.heading)
    assert math.hypot(pose.x - state.pose.x, pose.y - state.pose.y) < 0.3
    assert pose.heading == pytest.approx(state.pose.heading, abs=0.05)
    assert VehicleConfig().wheelbase == CAR.wheelbase


@pytest.mark.parametrize(("y", "sign"), [(2.0, 1), (-2.0, -1)])
def test_the_wheel_turns_to_the_waypoint(y: float, sign: int) -> None:
    _, control = pursue(np.array([(8.0, y)]), 4.0, 20.0, PursuitState(), DT)
    assert control.steer * sign > 0.1
    assert control.throttle > 0.0
    _, control = pursue(np.array([(8.0, y)]), 8.0, 20.0, PursuitState(), DT)
    assert control.brake > 0.0


def test_a_free_road_is_driven_and_somebody_on_it_stops_the_car() -> None:
    agent = true_agent()
    assert agent.act(seen(picture())).throttle > 0
    assert agent.decision is not None
    assert agent.decision.state == State.ROAD_FOLLOWING
    assert agent.decision.affordances is None
    assert agent.act(seen(picture(SceneClass.DYNAMIC))).brake == 1.0
    assert agent.decision.state == State.HAZARD_STOP
    assert "m² in the way" in agent.decision.note


def test_a_turn_goes_on_behind_an_image_that_is_no_use() -> None:
    """The planner's memory lies in the car's frame, and the car moves on while nothing is seen."""
    agent = true_agent()
    for _ in range(5):
        agent.act(seen(picture(near=True), Command.LEFT))
    before = agent._memory
    agent.act(seen(np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8), Command.LEFT, speed=10.0))
    assert before.turn is not None
    assert agent._memory.turn is not None
    assert agent._memory.turn.exit.x < before.turn.exit.x - 0.5  # 10 m/s for a step of 0.1 s


def test_a_cap_is_kept() -> None:
    agent = true_agent()
    assert agent.cruise == CRUISE
    slow = ModularPipelineAgent(agent.segmenter, CAMERA, (44, 100), DT, cap=10.0)
    slow.act(seen(picture()))
    assert slow.decision is not None
    assert slow.decision.target_speed == 10.0


def test_a_new_episode_forgets_the_last() -> None:
    agent = true_agent()
    first = [agent.act(seen(picture(near=True), Command.LEFT)) for _ in range(5)]
    agent.reset()
    assert agent.decision is None
    assert [agent.act(seen(picture(near=True), Command.LEFT)) for _ in range(5)] == first


@pytest.mark.parametrize(("number", "state"), [(9, State.RIGHT_TURN), (3, State.LEFT_TURN)])
def test_with_true_eyes_a_turn_is_driven_in_its_lane(number: int, state: State) -> None:
    world, agent, scenario = SemanticWorld(), true_agent(), task_scenarios("town01", "one-turn")[number]
    states, shares = set(), []
    result = run_episode(
        world, agent, scenario, lambda step: states.add(agent.decision and agent.decision.state),
        lambda step: shares.append(max(step.truth.opposite_share, step.truth.sidewalk_share)),
    )  # fmt: skip
    world.close()
    assert result.outcome is Outcome.SUCCESS
    assert {state, State.ROAD_FOLLOWING} <= states
    assert max(shares) < 0.1


def test_the_second_camera_is_looked_at_in_left_turns_only() -> None:
    agent = true_agent(auxiliary=True)
    for _ in range(3):
        agent.act(seen(picture(near=True), Command.RIGHT))
    assert agent.decision is not None
    assert agent.decision.state == State.RIGHT_TURN
    agent.reset()
    observation = seen(picture(near=True), Command.LEFT)
    agent.act(observation)
    agent.act(observation)
    assert agent.act(observation).brake == 1.0
    assert agent.decision is not None
    assert "no image of the second camera" in agent.decision.note
    both = replace(observation, auxiliary=picture())
    assert agent.act(both).brake == 0.0
    assert agent.sensed is not None
    alone = true_agent()
    alone.act(observation)
    assert alone.sensed is not None
    assert agent.sensed.grid.seen.sum() > 1.3 * alone.sensed.grid.seen.sum()


def test_a_world_gives_the_second_picture_where_one_is_asked_for() -> None:
    scenario, camera = task_scenarios("town01", "straight")[0], CameraConfig(width=64, height=32)
    one, two = EmbeddedWorld(camera), EmbeddedWorld(camera, auxiliary=auxiliary_camera(camera))
    alone = one.reset(scenario)
    one.close()
    both = two.reset(scenario)
    two.close()
    assert alone.auxiliary is None
    assert both.auxiliary is not None
    assert (alone.image == both.image).all()
    assert both.auxiliary.shape == both.image.shape
    assert (both.auxiliary != both.image).any()


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """A network that has learnt nothing."""
    torch.manual_seed(0)
    config = SegmentationConfig(image_width=64, image_height=32, width=1 / 8)
    save_segmentation(tmp_path / "mp.safetensors", SegmentationNetwork(config), SegmentationInfo(config))
    return tmp_path / "mp.safetensors"


def test_mp_drives_from_the_camera(model: Path) -> None:
    world, agent = set_up(AgentSettings(agent="mp", model=model))
    assert isinstance(agent, ModularPipelineAgent)
    observation = world.reset(task_scenarios("town01", "straight")[0])
    assert observation.image.shape == (32, 64, 3)
    assert observation.auxiliary is None
    controls = [agent.act(observation) for _ in range(2)]
    world.close()
    agent.reset()
    assert agent.act(observation) == controls[0]
    assert set(provenance(AgentSettings(agent="mp", model=model))) >= {"model", "precision"}


def test_mp_asks_for_a_second_camera_as_a_variant(model: Path) -> None:
    settings = AgentSettings(agent="mp", model=model, variant="auxiliary-camera")
    world, _ = set_up(settings)
    observation = world.reset(task_scenarios("town01", "straight")[0])
    world.close()
    assert observation.auxiliary is not None
    assert observation.auxiliary.shape == (32, 64, 3)
    with pytest.raises(ValueError, match=r"found --variant two, wanted one of auxiliary-camera for the agent mp"):
        provenance(replace(settings, variant="two"))
    with pytest.raises(ValueError, match=r"found --controller paper, but the agent mp takes none"):
        provenance(replace(settings, controller="paper"))
    with pytest.raises(ValueError, match=r"found --variant two"):
        set_up(replace(settings, variant="two"))  # also where nobody asks for its provenance


def test_a_world_without_a_second_camera_is_refused() -> None:
    with pytest.raises(
        ValueError, match=r"found that StraightRoad takes no second camera, wanted a parameter auxiliary"
    ):
        make_world("tests.fakes:StraightRoad", CAMERA, auxiliary=auxiliary_camera(CAMERA))


def test_without_a_network_a_sentence_says_what_to_type(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("caldrive.agents.rows.MODELS", tmp_path)
    with pytest.raises(FileNotFoundError, match=r"wanted one for the agent mp: make .*caldrive train --agent mp"):
        set_up(AgentSettings(agent="mp"))


def test_speed_is_measured_in_kilometres_an_hour() -> None:
    control = pursue(np.array([(8.0, 0.0)]), CRUISE * KMH, CRUISE, PursuitState(), DT)[1]
    assert (control.throttle, control.brake) == (0.0, 0.0)
