from __future__ import annotations

import json
import math
import struct
import tracemalloc
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from caldrive.datatypes import Alternative, Command
from caldrive.recordings import reader
from caldrive.recordings.reader import read_episode
from caldrive.recordings.writer import FORMAT_VERSION, EpisodeError, EpisodeWriter
from caldrive.scenarios import scenario_from_values, scenario_values
from tests.perception.data import HEIGHT, SCENARIO, WIDTH, make_frame


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "drive.parquet"
    with EpisodeWriter(path, SCENARIO) as writer:
        for index in range(3):
            for camera in (1, 0):
                writer.append(make_frame(index, index / 4, hazard=index == 2, camera=camera))
    return path


def test_gives_back_what_another_command_would_ask_for(tmp_path: Path) -> None:
    with EpisodeWriter(tmp_path / "drive.parquet", SCENARIO) as writer:
        for index in (0, 8):
            writer.append(make_frame(index, 0.5))
    episode = read_episode(tmp_path / "drive.parquet")
    assert [frame.other for frame in episode] == [None, Alternative(Command.LEFT, 0.3, 0.5)]
    assert episode.columns["other_command"].tolist() == ["", "left"]


def test_gives_back_what_was_written(path: Path) -> None:
    episode = read_episode(path)
    assert episode.id == "drive"
    assert episode.scenario == SCENARIO
    assert len(episode) == 6
    for frame, (camera, index) in zip(episode, [(c, i) for c in (0, 1) for i in range(3)], strict=True):
        written = make_frame(index, index / 4, hazard=index == 2, camera=camera)
        assert vars(frame) | {"image": None} == vars(written) | {"image": None}


def test_images_survive_jpeg_in_their_own_colours(path: Path) -> None:
    image = read_episode(path).image(2)
    wanted = make_frame(2, 0.5, hazard=True).image
    assert image.shape == (HEIGHT, WIDTH, 3)
    assert np.abs(image.astype(int) - wanted).mean() < 3
    assert image[2, 2, 0] > 200 > 20 > image[2, 2, 2]


def test_columns_are_arrays_with_zero_for_no_sign(path: Path) -> None:
    columns = read_episode(path).columns
    assert columns["speed_sign"].tolist() == [0, 0, 30] * 2
    assert columns["center_distance"].dtype == np.float64
    assert columns["camera"].tolist() == [0, 0, 0, 1, 1, 1]
    assert columns["command"][0] == Command.LEFT.value
    assert columns["driven_steer"].tolist() == [-0.2] * 6


def test_same_frames_make_the_same_bytes(path: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.parquet"
    with EpisodeWriter(again, SCENARIO, id="drive") as writer:
        for index in range(3):
            for camera in (1, 0):
                writer.append(make_frame(index, index / 4, hazard=index == 2, camera=camera))
    assert again.read_bytes() == path.read_bytes()


def test_an_error_while_recording_leaves_no_file(tmp_path: Path) -> None:
    def drive() -> None:
        with EpisodeWriter(tmp_path / "broken.parquet", SCENARIO) as writer:
            writer.append(make_frame(0))
            raise RuntimeError("the world ended")

    with pytest.raises(RuntimeError, match="ended"):
        drive()
    assert list(tmp_path.iterdir()) == []


def test_an_episode_without_frames_is_refused(tmp_path: Path) -> None:
    with pytest.raises(EpisodeError, match="without frames"):
        EpisodeWriter(tmp_path / "empty.parquet", SCENARIO).close()


@pytest.mark.parametrize("limit", [math.inf, 54.0])
def test_a_scenario_survives_json(limit: float) -> None:
    scenario = replace(SCENARIO, time_limit=limit)
    text = json.dumps(scenario_values(scenario), allow_nan=False)
    assert scenario_from_values(json.loads(text)) == scenario


def test_missing_damaged_and_foreign_files_are_told_apart(path: Path, tmp_path: Path) -> None:
    with pytest.raises(EpisodeError, match="there is no episode"):
        read_episode(tmp_path / "nowhere.parquet")
    cut = tmp_path / "cut.parquet"
    cut.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(EpisodeError, match="damaged"):
        read_episode(cut)
    foreign = tmp_path / "foreign.parquet"
    pq.write_table(pa.table({"a": [1]}), foreign)
    with pytest.raises(EpisodeError, match="no episode of caldrive"):
        read_episode(foreign)


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("hazard_stop", 1.5),
        ("hazard_stop", 0.5),
        ("vehicle_distance", -1.0),
        ("speed_sign", 45),
        ("relative_angle", 4.0),
        ("center_distance", 1e300),
        ("time", math.inf),
        ("speed", -1e300),
        ("frame", 0),
    ],
)
def test_labels_that_cannot_be_are_named(column: str, value: float, path: Path) -> None:
    table = pq.read_table(path)
    at = table.schema.get_field_index(column)
    spoilt = pa.array([value] * len(table), table.schema.field(at).type)
    pq.write_table(table.set_column(at, table.schema.field(at), spoilt), path)
    with pytest.raises(EpisodeError, match=f"values in {column} that cannot be"):
        read_episode(path)


def test_another_version_is_refused(path: Path) -> None:
    table = pq.read_table(path)
    metadata = {
        b"caldrive": table.schema.metadata[b"caldrive"].replace(
            f'"version": {FORMAT_VERSION}'.encode(), b'"version": 99'
        )
    }
    pq.write_table(table.replace_schema_metadata(metadata), path)
    with pytest.raises(EpisodeError, match="format 99"):
        read_episode(path)


def test_a_bit_that_turned_over_in_an_image_is_found(path: Path) -> None:
    content = bytearray(path.read_bytes())
    image = read_episode(path).jpegs[1]
    content[content.index(image) + len(image) - 20] ^= 1
    path.write_bytes(content)
    with pytest.raises(EpisodeError, match="is damaged"):
        read_episode(path)


def test_a_damaged_image_is_named_when_it_is_looked_at(path: Path) -> None:
    episode = read_episode(path)
    episode.jpegs[1] = b"no picture"
    with pytest.raises(EpisodeError, match="row 1"):
        episode.image(1)


def test_without_images_an_episode_is_its_columns(path: Path) -> None:
    whole, columns = read_episode(path), read_episode(path, images=False)
    assert columns.jpegs == []
    assert len(columns) == len(whole) == 6
    assert columns.columns["center_distance"].tolist() == whole.columns["center_distance"].tolist()


def _with_size(jpeg: bytes, width: int, height: int) -> bytes:
    """A JPEG whose header says another size."""
    at = jpeg.index(b"\xff\xc0") + 5
    return jpeg[:at] + struct.pack(">HH", height, width) + jpeg[at + 4 :]


def test_an_image_that_asks_for_too_much_memory_is_refused_before_it_is_decoded(path: Path) -> None:
    episode = read_episode(path)
    episode.jpegs[1] = _with_size(episode.jpegs[1], 60_000, 60_000)
    with pytest.raises(EpisodeError, match=r"row 1 of .* damaged image") as caught:
        episode.image(1)
    assert "60000 x 60000 pixels, wanted 100 million at most" in str(caught.value.__cause__)


def test_a_semantic_image_is_unpacked_no_further_than_its_image_is_large(path: Path) -> None:
    episode = replace(read_episode(path), semantics=[zlib.compress(bytes(10**8))] * 6)
    tracemalloc.start()
    with pytest.raises(EpisodeError, match="damaged semantic image"):
        episode.semantic(0)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 10**7


@pytest.mark.parametrize("times", [(0.0, 0.1, 0.1), (0.0, 0.2, 0.1)], ids=["stands still", "goes back"])
def test_a_time_that_does_not_go_on_is_named(times: tuple[float, ...], tmp_path: Path) -> None:
    with EpisodeWriter(tmp_path / "drive.parquet", SCENARIO) as writer:
        for index, time in enumerate(times):
            writer.append(replace(make_frame(index), time=time))
    with pytest.raises(EpisodeError, match=r"drive\.parquet has values in time that cannot be"):
        read_episode(tmp_path / "drive.parquet")


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"weather": 15}, "has weather 15, 1 to 14 can be"),
        ({"town": "atlantis"}, "has town 'atlantis', town01, town02"),
    ],
)
def test_conditions_that_no_recorder_knows_are_named(wrong: dict[str, Any], sentence: str, tmp_path: Path) -> None:
    with EpisodeWriter(tmp_path / "drive.parquet", replace(SCENARIO, **wrong)) as writer:
        writer.append(make_frame(0))
    with pytest.raises(EpisodeError, match=sentence):
        read_episode(tmp_path / "drive.parquet")


def test_more_rows_than_there_is_memory_for_are_refused_before_they_are_read(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reader, "MOST_ROWS", 5)
    monkeypatch.setattr(pq.ParquetFile, "read", lambda *_: pytest.fail("read"))
    with pytest.raises(EpisodeError, match="has 6 rows, 1 to 5 can be"):
        read_episode(path)
