"""Imitation learns from HDF5 files what it learns from the recording that they were written from."""

from __future__ import annotations

import math
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from caldrive.agents.conditional_imitation import learner
from caldrive.agents.conditional_imitation.checkpoint import load_imitation
from caldrive.agents.conditional_imitation.labels import (
    Demonstrations,
    corl2017_demonstrations,
    recorded_demonstrations,
)
from caldrive.agents.conditional_imitation.learner import train_imitation
from caldrive.control.lateral import LateralConfig
from caldrive.perception.dataset.frames import Frames
from caldrive.recordings.corl2017 import CAMERA_LEFT, DrivenFrames, read_corl2017
from caldrive.recordings.corl2017_writer import write_corl2017
from caldrive.recordings.folder import find_episodes, split
from tests.agents.conditional_imitation.data import SHORT, SMALL
from tests.recordings.test_corl2017 import record_drive

WHEEL = LateralConfig().max_angle


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A recording, and the same as HDF5."""
    recording, written = (tmp_path_factory.mktemp(name) for name in ("recording", "written"))
    write_corl2017(record_drive(recording), written, validation_share=0.25)
    return recording, written


def test_the_labels_are_those_of_the_recording(folders: tuple[Path, Path]) -> None:
    recording, written = folders
    validation = split(find_episodes(recording), 0.25, 0)[1]
    recorded = recorded_demonstrations(Frames(validation, (88, 200)), WHEEL)
    read = corl2017_demonstrations(read_corl2017(written / "SeqVal"), WHEEL)
    n = len(read)
    np.testing.assert_array_equal(read.command, recorded.command[:n])
    np.testing.assert_allclose(read.controls, recorded.controls[:n], atol=1e-6)
    np.testing.assert_allclose(read.speed, recorded.speed[:n], atol=1e-5)
    np.testing.assert_array_equal(read.images(np.arange(3)), recorded.images(np.arange(3)))


def test_hdf5_files_train_the_network(
    folders: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(learner, "RANGE_FRAMES", 8)
    network = replace(SMALL, image_width=200, image_height=88)
    _, info = load_imitation(train_imitation(replace(SHORT, steps=2), folders[1], tmp_path, network))
    assert (info.data["train_frames"], info.data["validation_frames"]) == (600, 200)
    with pytest.raises(ValueError, match=r"found HDF5 files of 200 x 88 pixels in .*wanted 64 x 32 for the network"):
        train_imitation(SHORT, folders[1], tmp_path / "other", SMALL)


def test_the_wheel_of_a_foreign_car_is_carlas_unless_told(
    folders: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wheels: list[float] = []

    def noted(frames: DrivenFrames, wheel: float) -> Demonstrations:
        wheels.append(math.degrees(wheel))
        return corl2017_demonstrations(frames, wheel)

    def read(**settings: Any) -> float:
        wheels.clear()
        learner._read_corl2017(replace(SHORT, **settings), network, foreign if is_foreign else folders[1])
        return round(wheels[0], 6)

    network, foreign, is_foreign = replace(SMALL, image_width=200, image_height=88), tmp_path / "foreign", False
    monkeypatch.setattr(learner, "corl2017_demonstrations", noted)
    shutil.copytree(folders[1], foreign)
    for path in foreign.glob("*/*.h5"):
        with h5py.File(path, "r+") as file:
            del file[CAMERA_LEFT]  # what others' recorders do not write
    assert read() == 35.0
    is_foreign = True
    assert read() == 70.0
    assert read(wheel_angle=50.0) == 50.0


def test_one_of_the_two_hdf5_folders_is_not_enough(folders: tuple[Path, Path], tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"found HDF5 files in .*SeqTrain, wanted SeqTrain and SeqVal beside"):
        train_imitation(SHORT, folders[1] / "SeqTrain", tmp_path / "out", SMALL)
