"""The format of the CARLA paper's imitation data: our recordings in it, and its frames as an imitation reads them."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

from caldrive.cli import main
from caldrive.datatypes import Command, Control
from caldrive.files import locked_folder
from caldrive.perception.training.config import TrainingConfig
from caldrive.perception.training.train import train
from caldrive.recordings import corl2017_writer
from caldrive.recordings.corl2017 import COLUMNS, read_corl2017
from caldrive.recordings.corl2017_writer import distance_to_junction, targets, write_corl2017
from caldrive.recordings.folder import find_episodes, split
from caldrive.recordings.reader import Episode, read_episode
from caldrive.recordings.writer import EpisodeError, EpisodeWriter
from caldrive.scenarios import Scenario
from tests.perception.data import SCENARIO, TINY, make_frame, record

SIZE = (88, 200)
COLUMN = {name: k for k, name in enumerate(COLUMNS)}


def record_drive(folder: Path, episodes: int = 4, frames: int = 75, scenario: Scenario = SCENARIO) -> Path:
    """Episodes of three cameras, with another image, speed and control in each frame."""
    for number in range(episodes):
        with EpisodeWriter(folder / f"episode-{number:05d}.parquet", scenario) as writer:
            for index in range(frames):
                for camera, left in enumerate((-0.5, 0.0, 0.5)):
                    clean = Control(index / 100, 0.25, 0.5 - index / 100)
                    writer.append(
                        replace(
                            make_frame(index),
                            speed=index / 5, clean=clean, driven=replace(clean, steer=-0.25) if index % 2 else clean,
                            image=np.full((*SIZE, 3), (3 * index, 50 * number, 80 * camera), np.uint8),
                            camera=camera, camera_left=left,
                            camera_yaw=(camera - 1) / 10, junction=index % 40 >= 30,
                        )
                    )  # fmt: skip
    return folder


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_drive(tmp_path_factory.mktemp("recording"))


@pytest.fixture(scope="module")
def written(recording: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("written")
    write_corl2017(recording, folder, validation_share=0.25)
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_the_files_are_laid_out_as_public_readers_expect(written: Path) -> None:
    assert sorted(contents(written)) == [
        *("SeqTrain/data_00000.h5", "SeqTrain/data_00001.h5", "SeqTrain/data_00002.h5", "SeqVal/data_00000.h5"),
        "corl2017.json",
    ]
    for path in written.glob("*/*.h5"):
        with h5py.File(path, "r") as file:
            assert (file["rgb"].shape, file["rgb"].dtype) == ((200, 88, 200, 3), np.uint8)
            assert (file["targets"].shape, file["targets"].dtype) == ((200, 28), np.float32)
            assert set(file["targets"][:, 24]) <= {2, 3, 4, 5}  # they take a branch by this number


def test_frames_that_fill_no_file_are_counted(recording: Path, tmp_path: Path) -> None:
    found = write_corl2017(recording, tmp_path, validation_share=0.25)
    assert (found.files, found.frames, found.left_out) == (4, 800, 75 + 25)


def test_what_was_written_is_read_again(recording: Path, written: Path) -> None:
    episodes, _ = split(find_episodes(recording), 0.25, 0)
    frames = read_corl2017(written / "SeqTrain")

    def column(name: str) -> NDArray[Any]:
        return np.concatenate([episode.columns[name] for episode in episodes])[:600]

    images = np.stack([episode.image(k) for episode in episodes for k in range(len(episode))])[:600]
    assert len(frames) == 600
    np.testing.assert_array_equal(frames.images(np.arange(600)), images)
    np.testing.assert_array_equal(frames.images(np.array([599, 3, 3, 201])), images[[599, 3, 3, 201]])
    clean = np.stack([column(f"clean_{name}") for name in ("throttle", "brake", "steer")], axis=1)
    np.testing.assert_allclose(frames.control, clean, atol=1e-6)
    for name in ("speed", "camera_left", "camera_yaw"):
        np.testing.assert_allclose(getattr(frames, name), column(name), rtol=1e-6, atol=1e-7)
    assert frames.is_ours
    expected = [tuple(Command).index(Command(command)) for command in column("command")]
    assert frames.command.tolist() == expected  # to follow the lane and to go straight on are one command of ours


def test_no_images_are_no_images(written: Path) -> None:
    assert read_corl2017(written / "SeqVal").images(np.array([], np.int64)).shape == (0, 88, 200, 3)


def one_frame(tmp_path: Path, **changes: Any) -> dict[str, float]:
    """What the format says of one frame, by column."""
    with EpisodeWriter(tmp_path / "drive.parquet", SCENARIO) as writer:
        writer.append(replace(make_frame(7), **changes))
    return dict(zip(COLUMNS, targets(read_episode(tmp_path / "drive.parquet"))[0].tolist(), strict=True))


def test_left_is_negative_and_speed_in_kmh(tmp_path: Path) -> None:
    found = one_frame(
        tmp_path, clean=Control(0.5, 0.25, 0.75), driven=Control(0.5, 0.0, -0.25), speed=10.0, camera_left=0.5,
        camera_yaw=math.radians(10), time=2.5,
    )  # fmt: skip
    assert (found["steer"], found["gas"], found["brake"]) == (-0.75, 0.5, 0.25)
    assert (found["steer_noise"], found["gas_noise"], found["brake_noise"], found["noise"]) == (0.25, 0.5, 0.0, 1.0)
    assert found["speed"] == pytest.approx(36.0)
    assert found["camera_yaw"] == pytest.approx(-10.0)
    assert (found["camera"], found["game_time"]) == (1.0, 2500.0)


@pytest.mark.parametrize(("left", "camera"), [(0.0, 0), (0.5, 1), (-0.5, 2)])
def test_the_camera_in_the_middle_is_number_0(left: float, camera: int, tmp_path: Path) -> None:
    assert one_frame(tmp_path, camera_left=left)["camera"] == camera


def test_a_drive_without_perturbation_has_no_noise(tmp_path: Path) -> None:
    assert one_frame(tmp_path, clean=Control(0.5, 0.0, 0.1), driven=Control(0.5, 0.0, 0.1))["noise"] == 0.0


@pytest.mark.parametrize(("command", "number"), [(Command.LEFT, 3), (Command.RIGHT, 4), (Command.STRAIGHT, 5)])
def test_a_command_keeps_its_number_at_a_junction(command: Command, number: int, tmp_path: Path) -> None:
    assert one_frame(tmp_path, command=command, junction=True)["command"] == number


def commands_of(
    tmp_path: Path, speed: float, command: Command, junctions: tuple[int, ...], frames: Iterable[int] = range(60)
) -> list[float]:
    """The format's commands of a drive at a constant speed, 10 frames a second."""
    with EpisodeWriter(tmp_path / "drive.parquet", SCENARIO) as writer:
        for k in frames:
            writer.append(replace(make_frame(k), speed=speed, command=command, junction=k in junctions))
    found: list[float] = targets(read_episode(tmp_path / "drive.parquet"))[:, COLUMN["command"]].tolist()
    return found


def test_far_from_a_junction_the_command_is_to_follow_the_lane(tmp_path: Path) -> None:
    commands = commands_of(tmp_path, 10.0, Command.STRAIGHT, junctions=(40, 41, 42))
    assert commands[:20] == [2] * 20  # 40 to 21 m before it
    assert commands[20:] == [5] * 40  # behind it the recording ends within 20 m


@pytest.mark.parametrize(("command", "number"), [(Command.LEFT, 3), (Command.RIGHT, 4)])
def test_a_turn_that_was_told_far_from_its_junction_stays_one(command: Command, number: int, tmp_path: Path) -> None:
    assert set(commands_of(tmp_path, 10.0, command, junctions=(40, 41, 42))) == {number}


def test_a_car_that_waits_at_a_junction_keeps_its_command(tmp_path: Path) -> None:
    assert set(commands_of(tmp_path, 0.0, Command.STRAIGHT, junctions=(59,))) == {5}


def test_what_lies_behind_a_gap_in_a_recording_is_not_known(tmp_path: Path) -> None:
    frames = [*range(30), *range(60, 90)]  # 3 s are missing, in which the car may have met any junction
    assert commands_of(tmp_path, 10.0, Command.STRAIGHT, (89,), frames)[:39] == [2] * 9 + [5] * 21 + [2] * 9


def test_the_way_to_a_junction_is_what_the_car_drives() -> None:
    time, speed = np.array([0.0, 1.0, 2.0, 4.0]), np.array([0.0, 2.0, 2.0, 2.0])
    found = distance_to_junction(time, speed, np.array([False, False, True, False]))
    assert found.tolist() == [3.0, 2.0, 0.0, 0.0]
    assert distance_to_junction(time, speed, np.zeros(4, bool)).tolist() == [7.0, 6.0, 4.0, 0.0]


def test_a_recording_that_is_killed_goes_on_to_the_same_files(
    recording: Path, written: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write, paths = corl2017_writer._file, []

    def break_off(episodes: list[Episode], number: int) -> bytes:
        paths.append(number)
        if len(paths) == 3:
            raise KeyboardInterrupt
        return write(episodes, number)

    with monkeypatch.context() as patch:
        patch.setattr(corl2017_writer, "_file", break_off)
        with pytest.raises(KeyboardInterrupt):
            write_corl2017(recording, tmp_path, validation_share=0.25)
    assert len(list(tmp_path.glob("*/*.h5"))) == 2
    (tmp_path / "SeqTrain" / "data_00001.h5").write_bytes(b"half a file")
    kept = (tmp_path / "SeqTrain" / "data_00000.h5").stat().st_mtime_ns
    write_corl2017(recording, tmp_path, validation_share=0.25)
    assert contents(tmp_path) == contents(written)
    assert (tmp_path / "SeqTrain" / "data_00000.h5").stat().st_mtime_ns == kept


def test_a_folder_with_files_of_another_recording_is_left_alone(recording: Path, written: Path) -> None:
    before = contents(written)
    with pytest.raises(ValueError, match="found files of another recording, share or seed in"):
        write_corl2017(recording, written, validation_share=0.5)
    assert contents(written) == before


def test_two_that_write_into_one_folder_are_refused(recording: Path, tmp_path: Path) -> None:
    with locked_folder(tmp_path), pytest.raises(ValueError, match="found another process at work"):
        write_corl2017(recording, tmp_path)


def test_images_of_another_size_are_refused_before_anything_is_written(tmp_path: Path) -> None:
    recording = record(tmp_path / "recording")
    with pytest.raises(EpisodeError, match=r"images of 64 x 32 in .*, wanted 200 x 88: record with --width 200"):
        write_corl2017(recording, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_too_few_frames_are_refused_before_anything_is_written(tmp_path: Path) -> None:
    recording = record_drive(tmp_path / "recording", episodes=2, frames=20)
    with pytest.raises(EpisodeError, match=r"found 60 frames for SeqTrain in .*, wanted 200 or more"):
        write_corl2017(recording, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_town_that_only_judges_is_not_given_to_learn_from(tmp_path: Path) -> None:
    recording = record_drive(tmp_path / "recording", 2, 4, replace(SCENARIO, town="random:9000000"))
    with pytest.raises(ValueError, match="found random:9000000 to learn from"):
        write_corl2017(recording, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.fixture
def spoilt(written: Path, tmp_path: Path) -> Iterator[Any]:
    """A file whose datasets a test changes."""
    content = next(written.glob("SeqVal/*.h5")).read_bytes()
    (tmp_path / "data_00007.h5").write_bytes(content)
    with h5py.File(tmp_path / "data_00007.h5", "r+") as file:
        yield file


def exchange(file: Any, name: str, data: NDArray[Any]) -> None:
    del file[name]
    file[name] = data


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        ("steer", math.nan, "values of steer in .* that cannot be"),
        ("speed", math.inf, "values of speed in"),
        ("camera_yaw", 1e6, "values of camera_yaw in"),
        ("command", 1.0, "found the command 1 in .*, wanted 0 or 2 to 5"),
        ("command", math.nan, "found the command nan in"),
    ],
)
def test_values_that_cannot_be_are_named(column: str, value: float, message: str, spoilt: Any, tmp_path: Path) -> None:
    spoilt["targets"][3, COLUMN[column]] = value
    spoilt.close()
    with pytest.raises(EpisodeError, match=message):
        read_corl2017(tmp_path)


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("rgb", np.zeros((200, 66, 200, 3), np.uint8), r"found rgb \(200, 66, 200, 3\) of uint8"),
        ("rgb", np.zeros((200, 88, 200, 3), np.float32), r"found rgb .* of float32 in .*, wanted .* of uint8"),
        ("rgb", np.zeros((120, 88, 200, 3), np.uint8), r"found rgb \(120, 88, 200, 3\)"),
        ("targets", np.zeros((200, 27), np.float32), r"found targets \(200, 27\) of float32"),
        ("camera_left", np.zeros(7, np.float32), r"found camera_left \(7,\)"),
    ],
)
def test_datasets_of_another_shape_or_type_are_named(
    name: str, data: NDArray[Any], message: str, spoilt: Any, tmp_path: Path
) -> None:
    exchange(spoilt, name, data)
    spoilt.close()
    with pytest.raises(EpisodeError, match=message):
        read_corl2017(tmp_path)


def test_a_file_without_images_is_named(spoilt: Any, tmp_path: Path) -> None:
    del spoilt["rgb"]
    spoilt.close()
    with pytest.raises(EpisodeError, match=r"found no rgb in .*data_00007\.h5"):
        read_corl2017(tmp_path)


def test_a_published_file_has_no_camera_left_and_may_have_more_datasets(spoilt: Any, tmp_path: Path) -> None:
    del spoilt["camera_left"]
    spoilt["depth"] = np.zeros((200, 88, 200, 3), np.uint8)
    spoilt["targets"][:4, COLUMN["command"]] = (0, 2, 3, 4)
    for name, value in (("speed", -3.6), ("steer", 1.25), ("gas", 1.5)):
        spoilt["targets"][0, COLUMN[name]] = value
    spoilt.close()
    frames = read_corl2017(tmp_path)
    assert not frames.camera_left.any()
    commands = [tuple(Command)[number] for number in frames.command[:4]]
    assert commands == [Command.STRAIGHT, Command.STRAIGHT, Command.LEFT, Command.RIGHT]
    assert frames.speed[0] == pytest.approx(-1.0)
    assert frames.control[0, [0, 2]].tolist() == [1.0, -1.0]


@pytest.mark.parametrize("content", [b"", b"no HDF5", None], ids=["empty", "text", "cut"])
def test_a_damaged_file_is_named(content: bytes | None, written: Path, tmp_path: Path) -> None:
    whole = next(written.glob("SeqVal/*.h5")).read_bytes()
    (tmp_path / "data_06790.h5").write_bytes(whole[:-1000] if content is None else content)
    with pytest.raises(EpisodeError, match=r"data_06790\.h5 is damaged or no HDF5 file"):
        read_corl2017(tmp_path)


def test_a_file_that_is_damaged_later_is_named_when_it_is_looked_at(spoilt: Any, tmp_path: Path) -> None:
    spoilt.close()
    frames = read_corl2017(tmp_path)
    (tmp_path / "data_00007.h5").write_bytes(b"")
    with pytest.raises(EpisodeError, match=r"data_00007\.h5 is damaged"):
        frames.images(np.array([1]))


def test_the_folder_above_says_which_to_give(written: Path) -> None:
    with pytest.raises(EpisodeError, match=r"found no file \*\.h5 in .*, type .*SeqTrain"):
        read_corl2017(written)


def test_affordances_cannot_be_learnt_from_such_files(written: Path, tmp_path: Path) -> None:
    with pytest.raises(EpisodeError, match=r"found HDF5 files in .*, which say nothing of affordances"):
        train(TrainingConfig(), written, tmp_path / "out", TINY)


def test_without_h5py_the_message_names_the_extra(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "h5py", None)
    assert main(["convert", str(recording), "--out", str(tmp_path / "out")]) == 2
    assert "type pip install 'caldrive[hdf5]'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_verb_says_how_much_there_is(recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["convert", str(recording), "--out", str(tmp_path), "--validation-share", "0.25"]) == 0
    assert "800 frames in 4 files; 100 fill no further file" in capsys.readouterr().out
