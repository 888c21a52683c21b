from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from caldrive.compiled import Floats
from caldrive.datatypes import Command, Image, Observation
from caldrive.interfaces import BadImage
from caldrive.perception.camera_faults import FROZEN, TORN, TREMBLING, make_fault
from caldrive.perception.inference.watchdog import Watchdog
from caldrive.perception.network.camera_check import REASONS

HEIGHT, WIDTH = 88, 200
SPEED, DT = 5.0, 0.1
ROAD = np.random.default_rng(0).integers(40, 220, (HEIGHT // 4, 200 + WIDTH // 4, 3), dtype=np.uint8)
SURE = np.array([[-5.0, 5.0, *[0.0] * (len(REASONS) - 1)]], np.float32)  # full of noise
THRESHOLDS = [4.0] * len(REASONS)
FINE = np.array([[5.0, -5.0, *[-5.0] * (len(REASONS) - 1)]], np.float32)


def road(frame: int) -> Image:
    """What a camera sees that moves on by 4 pixels a frame."""
    return np.ascontiguousarray(np.kron(ROAD[:, frame : frame + WIDTH // 4], np.ones((4, 4, 1), np.uint8)))


def see(image: Image, frame: int, speed: float = SPEED) -> Observation:
    return Observation(frame * DT, image, speed, Command.STRAIGHT)


def look(watchdog: Watchdog, observation: Observation, outputs: Floats | None = None) -> str:
    """What the watchdog says to a frame and the camera check's outputs, nothing where it is content."""
    try:
        watchdog.look(observation, outputs)
    except BadImage as error:
        return str(error)
    return ""


def said(images: list[Image], speed: float = SPEED) -> list[str]:
    watchdog = Watchdog()
    return [look(watchdog, see(image, frame, speed)) for frame, image in enumerate(images)]


def test_a_moving_picture_is_no_fault() -> None:
    assert not any(said([road(k) for k in range(100)]))


def test_a_camera_may_fill_the_same_memory_again() -> None:
    watchdog, image = Watchdog(), road(0)
    for k in range(100):
        image[...] = road(k)
        assert not look(watchdog, see(image, k))


def test_images_may_lie_in_memory_in_any_order() -> None:
    assert not any(said([np.asfortranarray(road(k)) for k in range(30)]))
    assert "has not changed" in said([np.asfortranarray(road(0))] * 30)[-1]


@pytest.mark.parametrize("name", [FROZEN, TREMBLING, TORN])
def test_a_picture_that_stands_still_while_the_car_moves_a_metre_is_noticed(name: str) -> None:
    fault = make_fault(name)
    notes = said([fault(road(k), k * DT) for k in range(20)])
    first = next(k for k, note in enumerate(notes) if note)
    assert "has not changed for 1" in notes[first]
    assert first == pytest.approx(1.0 / (SPEED * DT), abs=1)
    assert all(notes[first:])


def test_a_car_that_stands_may_see_the_same_for_ever() -> None:
    assert not any(said([road(0)] * 100, speed=0.0))


def test_a_frozen_picture_stays_noticed_while_the_car_stands_until_it_changes() -> None:
    watchdog = Watchdog()
    for k in range(5):
        note = look(watchdog, see(road(0), k))
    assert note
    assert look(watchdog, see(road(0), 6, speed=0.0))
    assert not look(watchdog, see(road(9), 7, speed=0.0))


def test_a_part_that_never_changes_is_noticed_within_ten_metres() -> None:
    images = [road(k) for k in range(40)]
    for image in images:
        image[60:80, 100:140] = 70
    notes = said(images)
    first = next(k for k, note in enumerate(notes) if note)
    assert "a part of the image" in notes[first]
    assert 8.0 < first * SPEED * DT < 10.0


def test_a_sky_that_never_changes_is_no_fault() -> None:
    images = [road(k) for k in range(60)]
    for image in images:
        image[:44] = 150
    assert not any(said(images))


@pytest.mark.parametrize("colour", [(255, 255, 255), (128, 128, 128), (0, 135, 0), (250, 248, 252)])
def test_a_plain_colour_is_noticed_at_once(colour: tuple[int, int, int]) -> None:
    (note,) = said([np.full((HEIGHT, WIDTH, 3), 1, np.uint8) * np.array(colour, np.uint8)])
    assert "plain colour" in note


def test_an_old_image_is_noticed_and_one_without_a_time_is_new() -> None:
    old = replace(see(road(0), 20), image_time=1.2)
    assert "0.8 s old" in look(Watchdog(), old)
    assert not look(Watchdog(), replace(old, image_time=1.9))
    assert not look(Watchdog(), replace(old, image_time=None))
    assert look(Watchdog(), replace(old, image_time=math.nan))


def test_evidence_of_one_frame_is_not_enough_and_that_of_a_second_is() -> None:
    outputs = [FINE] * 5 + [SURE] + [FINE] * 9 + [SURE] * 10 + [FINE] * 10
    watchdog = Watchdog(THRESHOLDS)
    notes = [look(watchdog, see(road(k), k), output) for k, output in enumerate(outputs)]
    assert not any(notes[:20])
    assert "full of noise" in notes[24]
    assert not notes[-1]


def test_evidence_has_to_fall_well_below_its_threshold_before_images_count_again() -> None:
    between = np.array([[0.0, 3.0, *[-9.0] * (len(REASONS) - 1)]], np.float32)
    outputs = [SURE] * 10 + [between] * 30
    watchdog = Watchdog(THRESHOLDS)
    assert all([look(watchdog, see(road(k), k), output) for k, output in enumerate(outputs)][10:])


def test_an_episode_begins_without_the_last_ones_evidence() -> None:
    watchdog = Watchdog(THRESHOLDS)
    notes = [look(watchdog, see(road(k), k), SURE) for k in range(10)]
    watchdog.reset()
    assert notes[-1]
    assert not look(watchdog, see(road(0), 0), SURE)


@pytest.mark.parametrize(("speed", "backwards"), [(math.nan, False), (math.inf, False), (-3.0, False), (SPEED, True)])
def test_a_speed_or_time_that_makes_no_sense_moves_nothing(speed: float, backwards: bool) -> None:
    watchdog = Watchdog()
    assert not any(look(watchdog, see(road(0), -k if backwards else k, speed)) for k in range(50))


def test_images_of_another_size_begin_anew() -> None:
    watchdog = Watchdog()
    look(watchdog, see(road(0), 0))
    assert not look(watchdog, see(road(0)[:64, :100], 1))
