"""Tiny recordings for the tests of perception: a bright column that stands where the centre line lies."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from caldrive.affordances import SPECS
from caldrive.datatypes import Affordances, Alternative, Command, Control, Image, Observation, Pose
from caldrive.perception.network.config import BlockConfig, NetworkConfig
from caldrive.perception.training.config import TrainingConfig
from caldrive.recordings.writer import EpisodeWriter, Frame
from caldrive.scenarios import Scenario

HEIGHT, WIDTH = 32, 64
SCENARIO = Scenario("town01", weather=1, start=Pose(0, 0, 0), goal=Pose(1, 2, 3), seed=7)
TINY = NetworkConfig(
    image_width=WIDTH,
    image_height=HEIGHT,
    width=1 / 8,
    hazard_stop=BlockConfig("tconv", 8, 0.0, length=4),
    red_light=BlockConfig("gru", 8, 0.0, length=3, dilation=2),
    speed_sign=BlockConfig("dense", 8, 0.0),
    vehicle_distance=BlockConfig("lstm", 8, 0.0, length=2),
    relative_angle=BlockConfig("dense", 8, 0.0, length=2),
    center_distance=BlockConfig("dense", 8, 0.0),
)
SHORT = TrainingConfig(
    steps=6, batch=4, window=3, warm_up=2, history_steps=0, camera_check_steps=0, evaluate_every=100, save_every=2,
    precision="fp32", validation_share=0.3,
)  # fmt: skip
HISTORY = replace(SHORT, steps=11, history_steps=5, history_batch=8)  # with a second stage


def column_image(center_distance: float, red: bool = False) -> Image:
    """A grey image with a white column, far left for +1 m and far right for -1 m; a red top for a hazard."""
    image = np.full((HEIGHT, WIDTH, 3), 60, np.uint8)
    x = round((1 - center_distance) / 2 * (WIDTH - 8))
    image[:, x : x + 8] = 255
    if red:
        image[: HEIGHT // 2] = (220, 0, 0)
    return image


def make_frame(index: int, center_distance: float = 0.0, hazard: bool = False, camera: int = 0) -> Frame:
    """A frame of a drive whose command changes every four frames, with a junction in one frame of eight."""
    command = (Command.LEFT, Command.STRAIGHT, Command.RIGHT)[index // 4 % 3]
    return Frame(
        index=index,
        time=index / 10,
        speed=5.0,
        command=command,
        affordances=Affordances(
            hazard_stop=float(hazard),
            speed_sign=30 if hazard else None,
            vehicle_distance=20.0,
            relative_angle=0.1,
            center_distance=center_distance,
        ),
        driven=Control(0.5, 0.0, -0.2),
        clean=Control(0.5, 0.0, 0.1),
        image=column_image(center_distance, hazard),
        camera=camera,
        camera_left=camera / 2,
        camera_yaw=0.1,
        junction=index % 8 == 7,
        other=Alternative(Command.LEFT, 0.3, center_distance) if command is Command.RIGHT else None,
    )


def record(
    folder: Path,
    n_episodes: int = 3,
    n_frames: int = 40,
    n_cameras: int = 2,
    semantic: bool = False,
    scenario: Scenario = SCENARIO,
) -> Path:
    """Episodes whose column wanders, with a hazard now and then; semantic images of noise."""
    rng, classes = np.random.default_rng(0), np.random.default_rng(1)
    for episode in range(n_episodes):
        with EpisodeWriter(folder / f"episode{episode}.parquet", scenario) as writer:
            for index in range(n_frames):
                for camera in range(n_cameras):
                    frame = make_frame(index, float(rng.uniform(-1, 1)), bool(rng.random() < 0.15), camera)
                    semantics = classes.integers(0, 8, (HEIGHT, WIDTH), dtype=np.uint8) if semantic else None
                    writer.append(replace(frame, semantic=semantics))
    return folder


def see(image: Image, index: int = 0) -> Observation:
    """An image as the driver of frame `index` has it before him."""
    frame = make_frame(index)
    return Observation(frame.time, image, frame.speed, frame.command)


def values(a: Affordances) -> list[float]:
    """All of them as numbers."""
    return [float(getattr(a, spec.name) or 0) for spec in SPECS]
