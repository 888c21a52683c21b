"""The imitation agent at the wheel."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
import torch

from caldrive.agents.conditional_imitation.agent import ImitationAgent, WheelRules, rules_for, wheel_control
from caldrive.agents.conditional_imitation.checkpoint import ImitationInfo, save_imitation
from caldrive.agents.conditional_imitation.config import ImitationNetworkConfig
from caldrive.agents.conditional_imitation.engine import image_engine
from caldrive.agents.conditional_imitation.network import ImitationNetwork
from caldrive.agents.registry import agent_entry, provenance
from caldrive.agents.settings import AgentSettings
from caldrive.datatypes import Command, Control
from caldrive.driving.setup import set_up
from caldrive.perception.images import to_float
from caldrive.perception.inference.precision import has_vnni
from caldrive.perception.network.calibration import input_ranges
from tests.agents.conditional_imitation.data import SMALL
from tests.perception.data import column_image, see

RULES = WheelRules()


@pytest.fixture
def agent() -> ImitationAgent:
    torch.manual_seed(0)
    return ImitationAgent(ImitationNetwork(SMALL))


@pytest.mark.parametrize(
    ("outputs", "speed", "wanted"),
    [
        ((0.1, 0.5, 0.05), 3.0, Control(0.5, 0.0, 0.1)),  # a slight brake is none
        ((0.0, 0.6, 0.5), 3.0, Control(0.6, 0.0, 0.0)),  # more throttle than brake
        ((0.0, 0.3, 0.5), 3.0, Control(0.3, 0.5, 0.0)),
        ((0.0, 0.5, 0.0), 10.1, Control(0.0, 0.0, 0.0)),  # nobody speeds up above 10 m/s
        ((-1.7, -0.2, 1.4), 3.0, Control(0.0, 1.0, -1.0)),  # outputs have no limits, controls have
    ],
)
def test_outputs_become_a_control_by_the_released_agents_rules(
    outputs: tuple[float, float, float], speed: float, wanted: Control
) -> None:
    assert wheel_control(*outputs, speed, RULES) == wanted


def test_the_forced_stop_fix_moves_a_car_on_that_stands_without_a_reason() -> None:
    assert wheel_control(0.0, 0.1, 0.9, 0.0, RULES, seen_speed=5.0) == Control(0.1 + 5.6 / 25, 0.0, 0.0)
    assert wheel_control(0.0, 0.1, 0.9, 0.0, RULES, seen_speed=1.0).brake == 0.9  # the image shows a standing car
    assert wheel_control(0.0, 0.1, 0.9, 3.0, RULES, seen_speed=5.0).brake == 0.9  # this one does not stand
    assert wheel_control(0.0, 0.1, 0.9, 0.0, RULES).brake == 0.9


def test_above_a_cap_there_is_no_throttle() -> None:
    assert wheel_control(0.0, 0.5, 0.0, 5.6, rules_for(20.0)).throttle == 0.0
    assert wheel_control(0.0, 0.5, 0.0, 5.5, rules_for(20.0)).throttle == 0.5
    assert rules_for(None) == RULES


def test_the_same_observation_gives_the_same_control(agent: ImitationAgent) -> None:
    first = agent.act(see(column_image(0.3)))
    agent.act(see(column_image(-0.9)))
    assert agent.act(see(column_image(0.3))) == first
    assert agent.act(see(column_image(-0.3))) != first
    other = replace(see(column_image(0.3)), command=Command.RIGHT)
    assert agent.act(other) != first


def test_an_image_that_is_no_use_ends_in_the_brake(agent: ImitationAgent) -> None:
    black = see(np.zeros((*SMALL.image_size, 3), np.uint8))
    assert agent.act(black) == Control(brake=1.0)
    assert agent.decision is not None
    assert "black" in agent.decision.note


def test_it_drives_by_its_name(tmp_path: Path) -> None:
    path = tmp_path / "cil.safetensors"
    torch.manual_seed(0)
    save_imitation(path, ImitationNetwork(SMALL), ImitationInfo(SMALL))
    settings = AgentSettings(agent="cil", model=path, variant="avoid-stopping")
    world, agent = set_up(settings)
    assert isinstance(agent, ImitationAgent)
    assert agent.avoid_stopping
    camera = agent_entry("cil").camera(settings)
    assert camera is not None
    assert (camera.height, camera.width) == SMALL.image_size
    assert provenance(settings)["model"]
    world.close()


def test_what_it_does_not_take_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="found --variant blue, wanted one of avoid-stopping for the agent cil"):
        provenance(AgentSettings(agent="cil", model=tmp_path, variant="blue"))
    with pytest.raises(ValueError, match="found --controller paper, but the agent cil takes none"):
        provenance(AgentSettings(agent="cil", model=tmp_path, controller="paper"))
    with pytest.raises(ValueError, match="found --variant blue, but the agent cal takes none"):
        provenance(AgentSettings(variant="blue"))
    path = tmp_path / "cil.safetensors"
    save_imitation(path, ImitationNetwork(SMALL), ImitationInfo(SMALL))
    with pytest.raises(ValueError, match="ImitationAgent has no perception that could be blind"):
        set_up(AgentSettings(agent="cil", model=path, blind=("hazard_stop",)))


@pytest.mark.parametrize("backbone", ["published", "cal"])
def test_integers_say_what_whole_numbers_say(backbone: Literal["published", "cal"]) -> None:
    torch.manual_seed(0)
    network = ImitationNetwork(ImitationNetworkConfig(backbone=backbone)).eval()
    image = np.random.default_rng(0).integers(0, 255, (88, 200, 3), dtype=np.uint8)
    with torch.inference_mode():
        ranges = input_ranges(network.trunk, network.prepared(to_float(image[None])))
    precisions = ("fp32", "int8" if has_vnni() else "int7")  # 8 bits overflow without VNNI
    whole, integers = (image_engine(network, precision, ranges, threads=1)(image) for precision in precisions)
    assert float((whole - integers).abs().mean()) < 0.1 * float(whole.abs().mean())
