"""The camera agent when its camera fails: it brakes to a stand, stays there and says why, and goes on when it sees."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
import torch

from caldrive.agents.cal import CALAgent
from caldrive.control.controller import CALController
from caldrive.datatypes import Image, Observation, Pose, Step
from caldrive.driving.rollout import rollout
from caldrive.perception.inference.predictor import NetworkPerception
from caldrive.perception.network.network import Network
from caldrive.scenarios import Scenario
from tests.fakes import StraightRoad
from tests.perception.data import HEIGHT, TINY, WIDTH, column_image

SCENARIO = Scenario("straight", 1, Pose(0, 0, 0), Pose(500, 0, 0), time_limit=60)
# The last biases of a network that sees a free road whatever the image shows.
FREE = {
    "hazard_stop": (9.0, -9.0), "red_light": (9.0, -9.0), "speed_sign": (9.0, 0.0, 0.0, 0.0),
    "vehicle_distance": (1.0,), "relative_angle": (0.0,), "center_distance": (0.0,),
}  # fmt: skip
FAILURES: dict[str, tuple[Callable[[], Image], str]] = {
    "black": (lambda: np.zeros((HEIGHT, WIDTH, 3), np.uint8), "black"),
    "of another size": (lambda: np.full((HEIGHT, WIDTH + 1, 3), 90, np.uint8), f"{WIDTH}"),
    "a plain colour": (lambda: np.full((HEIGHT, WIDTH, 3), 90, np.uint8), "plain colour"),
    "frozen": (lambda: column_image(0.3), "has not changed for"),
    "without colours": (lambda: np.full((HEIGHT, WIDTH), 90, np.uint8), "3"),
}


class FailingCamera(StraightRoad):
    """A straight road whose camera shows something else from 8 s to 16 s."""

    bad: Callable[[], Image]

    def _observation(self) -> Observation:
        image = self.bad() if 8 <= self.time < 16 else column_image(math.sin(8 * self.time))
        return replace(super()._observation(), image=image)


def free_road_network() -> Network:
    network = Network(TINY)
    for name, biases in FREE.items():
        for group in network.blocks[name].groups:  # type: ignore[union-attr]
            torch.nn.init.zeros_(group.output.weight)
            group.output.bias.data = torch.tensor(biases)
    return network


def drive(bad: Callable[[], Image], network: Network) -> list[Step]:
    world = FailingCamera()
    world.bad = bad
    agent = CALAgent(NetworkPerception(network, precision="fp32"), CALController())
    return list(islice(rollout(world, agent, SCENARIO), 240))


@pytest.mark.parametrize("failure", FAILURES)
def test_it_brakes_to_a_stand_while_the_image_is(failure: str) -> None:
    bad, words = FAILURES[failure]
    steps = drive(bad, free_road_network())
    before, while_bad, after = steps[70:80], steps[85:160], steps[165:]
    assert min(step.observation.speed for step in before) > 5
    assert all(step.control.throttle == 0 and step.control.brake > 0 for step in while_bad)
    assert while_bad[-1].observation.speed == 0
    assert all(step.decision is not None and words in step.decision.note for step in while_bad)
    assert after[-1].observation.speed > 5


def test_it_never_starts_with_weights_that_are_not_numbers() -> None:
    network = free_road_network()
    next(network.backbone.parameters()).data.fill_(float("nan"))
    steps = drive(FAILURES["black"][0], network)
    assert {step.observation.speed for step in steps} == {0.0}
    assert steps[5].decision is not None
    assert "not numbers" in steps[5].decision.note
