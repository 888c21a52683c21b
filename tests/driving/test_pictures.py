"""A person's own pictures come in order, whole and upright, from folders, videos and single files."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Picture

from caldrive.datatypes import Image
from caldrive.driving.pictures import open_source
from caldrive.visualization.episode_video import VideoWriter


def halves(height: int = 40, width: int = 60) -> Image:
    """A picture whose left half is red and whose right half is blue."""
    image = np.zeros((height, width, 3), np.uint8)
    image[:, : width // 2, 0] = image[:, width // 2 :, 2] = 200
    return image


def film(path: Path, n: int = 3, rate: float = 20.0) -> Path:
    with VideoWriter(path, rate) as video:
        video.add(halves(64, 96), times=n)
    return path


def test_a_folder_gives_its_pictures_by_name_with_numbers_by_value(tmp_path: Path) -> None:
    for mode, name in (("L", "10.jpg"), ("RGBA", "9.png"), ("RGB", "b2.JPEG"), ("P", "b10.png")):
        Picture.new(mode, (8, 6)).save(tmp_path / name)
    (tmp_path / "notes.txt").write_text("no picture")
    source = open_source(tmp_path)
    pictures = list(source)
    assert [picture.file for picture in pictures] == ["9.png", "10.jpg", "b2.JPEG", "b10.png"]
    assert [picture.time for picture in pictures] == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert {picture.image.shape for picture in pictures} == {(6, 8, 3)}
    assert (source.name, source.count, source.rate) == (tmp_path.name, 4, 10.0)


def test_a_video_gives_its_frames_with_their_times(tmp_path: Path) -> None:
    source = open_source(film(tmp_path / "film.mp4"))
    pictures = list(source)
    assert (source.name, source.count, source.rate) == ("film.mp4", 3, 20.0)
    assert [picture.time for picture in pictures] == pytest.approx([0.0, 0.05, 0.1])
    assert [picture.number for picture in pictures] == [0, 1, 2]
    assert pictures[2].image[32, 10, 0] > 150
    assert len(list(source)) == 3  # it can be read again


def test_pictures_that_are_left_out_are_not_read(tmp_path: Path) -> None:
    for number in range(5):
        Picture.fromarray(halves()).save(tmp_path / f"{number}.png")
    for number in (1, 3):
        (tmp_path / f"{number}.png").write_bytes(b"damaged")
    source = open_source(tmp_path, every=2)
    assert [picture.number for picture in source] == [0, 2, 4]
    assert source.count == 5
    frames = open_source(film(tmp_path / "film.mp4", n=5), every=3)
    assert [(picture.number, picture.time) for picture in frames] == [(0, 0.0), (3, pytest.approx(0.15))]


def test_one_picture_is_a_source_of_one(tmp_path: Path) -> None:
    Picture.fromarray(halves()).save(tmp_path / "one.png")
    assert [picture.file for picture in open_source(tmp_path / "one.png")] == ["one.png"]


def test_a_picture_that_a_camera_stored_lying_stands_upright(tmp_path: Path) -> None:
    picture, quarter_turn_clockwise = Picture.fromarray(halves()), 6
    exif = picture.getexif()
    exif[0x0112] = quarter_turn_clockwise
    picture.save(tmp_path / "one.png", exif=exif)
    [upright] = open_source(tmp_path / "one.png")
    assert upright.image.shape == (60, 40, 3)
    assert (upright.image[5, 20, 0], upright.image[55, 20, 2]) == (200, 200)  # what was left is above


def test_a_video_that_a_telephone_stored_lying_stands_upright(tmp_path: Path) -> None:
    content = bytearray(film(tmp_path / "film.mp4").read_bytes())
    matrix = content.index(b"tkhd") + 44
    quarter_turn_clockwise = (0, 1 << 16, 0, -1 << 16, 0, 0, 0, 0, 1 << 30)
    content[matrix : matrix + 36] = struct.pack(">9i", *quarter_turn_clockwise)
    (tmp_path / "turned.mp4").write_bytes(content)
    upright = next(iter(open_source(tmp_path / "turned.mp4"))).image
    assert upright.shape == (96, 64, 3)
    assert upright[10, 32, 0] > 150
    assert upright[86, 32, 2] > 150


def test_what_holds_no_picture_is_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.mp4").write_text("no video")
    with pytest.raises(FileNotFoundError, match=r"found nothing at .*gone.mp4, wanted a video or a folder"):
        open_source(tmp_path / "gone.mp4")
    with pytest.raises(ValueError, match=r"found no picture in .*empty, wanted files that end in .png, .jpg"):
        open_source(tmp_path / "empty")
    with pytest.raises(ValueError, match=r"found that .*text.mp4 cannot be read as a video"):
        open_source(tmp_path / "text.mp4")


def test_damaged_pictures_and_videos_are_named(tmp_path: Path) -> None:
    noise = np.random.default_rng(0)
    with VideoWriter(tmp_path / "film.mp4") as video:
        for _ in range(20):
            video.add(noise.integers(0, 255, (64, 96, 3), dtype=np.uint8))
    content = (tmp_path / "film.mp4").read_bytes()
    (tmp_path / "short.mp4").write_bytes(content[: len(content) // 2])
    (tmp_path / "bad.png").write_bytes(b"\x89PNG\r\n\x1a\n and no more")
    with pytest.raises(ValueError, match=r"bad.png cannot be read as a picture"):
        list(open_source(tmp_path / "bad.png"))
    with pytest.raises(ValueError, match=r"short.mp4 cannot be read as a video"):
        list(open_source(tmp_path / "short.mp4"))
    (tmp_path / "unknown.mp4").write_bytes(content.replace(b"minf", b"mknf"))  # the part that names the format
    with pytest.raises(ValueError, match=r"found no pictures in .*unknown.mp4 that can be read"):
        open_source(tmp_path / "unknown.mp4")


@pytest.mark.parametrize("side", [12_000, 60_000])
def test_a_picture_that_asks_for_too_much_memory_is_refused_before_it_is_decoded(side: int, tmp_path: Path) -> None:
    Picture.fromarray(halves()).save(tmp_path / "one.jpg")
    jpeg = (tmp_path / "one.jpg").read_bytes()
    at = jpeg.index(b"\xff\xc0") + 5
    (tmp_path / "one.jpg").write_bytes(jpeg[:at] + struct.pack(">HH", side, side) + jpeg[at + 4 :])
    with pytest.raises(ValueError, match=rf"one\.jpg of {side} x {side} pixels, wanted 100 million at most"):
        list(open_source(tmp_path / "one.jpg"))
