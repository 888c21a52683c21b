"""What an imitation learns: the driver's clean control, as from each camera's place, each command as often."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from caldrive.agents.conditional_imitation.labels import (
    Camera,
    CommandSampler,
    Demonstrations,
    corrected_steer,
    recorded_demonstrations,
)
from caldrive.control.controller import CALController
from caldrive.control.lateral import LateralConfig
from caldrive.datatypes import Affordances, Command
from caldrive.perception.dataset.frames import Frames
from caldrive.perception.network.network import COMMANDS
from caldrive.recordings.folder import find_episodes
from tests.perception.data import HEIGHT, WIDTH, record


def corrected(steer: float, left: float, yaw: float, speed: float) -> NDArray[np.float64]:
    """The label of one frame under the command straight."""
    law, (one, aside, turned, fast) = LateralConfig(), (np.array([value]) for value in (steer, left, yaw, speed))
    return corrected_steer(one, Camera(aside, turned), fast, np.array([law.straight[0]]), law.max_angle)


def frames_of(commands: list[int], steer: list[float]) -> Demonstrations:
    n = len(commands)
    controls = np.stack([np.array(steer), np.zeros(n), np.zeros(n)], axis=1)
    images = np.zeros((n, 4, 4, 3), np.uint8)
    return Demonstrations(
        np.zeros(n), np.array(commands), controls, lambda ids: images[ids], lambda ids: None, "digest"
    )


@pytest.mark.parametrize(("left", "yaw"), [(0.5, 0.0), (-0.5, 0.1), (0.0, -0.2)])
def test_the_label_of_a_camera_aside_is_what_the_driver_would_do_there(left: float, yaw: float) -> None:
    # On a straight road, in the middle of the lane: the car that stands where the camera does lies aside and is turned.
    there = Affordances(relative_angle=-yaw, center_distance=-left)
    wanted = CALController().step(there, 5.0, Command.STRAIGHT).control.steer
    label = corrected(0.0, left, yaw, 5.0)
    assert label[0] == pytest.approx(wanted, abs=0.12 * abs(wanted))  # of which the damping takes a tenth


def test_a_label_is_never_more_than_the_wheel_can_do() -> None:
    assert corrected(0.9, -0.5, -math.pi / 4, 0.0)[0] == 1.0


def test_the_clean_control_is_learnt_and_never_the_disturbed_one(tmp_path: Path) -> None:
    frames = Frames(find_episodes(record(tmp_path, n_cameras=1)), (HEIGHT, WIDTH))
    driven = recorded_demonstrations(frames, LateralConfig().max_angle)
    assert frames.column("driven_steer")[0] == -0.2
    straight = corrected(0.1, 0.0, 0.1, 5.0)
    np.testing.assert_allclose(driven.controls, np.tile([straight[0], 0.5, 0.0], (len(frames), 1)))


def test_every_command_has_the_same_share_of_a_batch() -> None:
    sampler = CommandSampler(frames_of([0] * 90 + [1] * 5 + [2] * 5, [0.0] * 100), balance=0.0, seed=1)
    commands = np.array([0] * 90 + [1] * 5 + [2] * 5)[sampler.draw(3, 64)]
    assert sorted(np.bincount(commands)) == [21, 21, 22]
    half = commands[::2]  # what the first of two processes has that share a batch
    assert min(np.bincount(half)) > 4
    assert (sampler.draw(3, 64) == sampler.draw(3, 64)).all()
    assert (sampler.draw(3, 64) != sampler.draw(4, 64)).any()


def test_balanced_frames_steer_more_often() -> None:
    frames = frames_of([0, 1, 2] * 100, ([0.0] * 3 * 9 + [0.9] * 3) * 10)
    share = [
        np.mean(np.abs(frames.controls[CommandSampler(frames, balance, 0).draw(0, 3000), 0]) > 0.5)
        for balance in (0.0, 0.5, 1.0)
    ]
    assert share == pytest.approx([0.1, 0.25, 0.5], abs=0.03)


def test_a_command_that_never_comes_is_named() -> None:
    with pytest.raises(ValueError, match=f"found no frame with the command {COMMANDS[2].value}"):
        CommandSampler(frames_of([0, 1], [0.0, 0.0]), balance=0.0, seed=0)
