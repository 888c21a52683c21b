"""The network looks at a person's own pictures: what it is given, and what is told about it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from caldrive.datatypes import Affordances, Command, Image, Observation
from caldrive.driving.pictures import SourcePicture
from caldrive.driving.see import Viewer, parse_crop
from caldrive.interfaces import BadImage

SIZE = (20, 9)


@dataclass
class Brightness:
    """A perception that takes how bright an image is for a hazard, and keeps what it was given."""

    observations: list[Observation] = field(default_factory=list)

    def reset(self) -> None:
        self.observations.clear()

    def predict(self, observation: Observation) -> Affordances:
        self.observations.append(observation)
        if not observation.image.any():
            raise BadImage("the image is black: brake, and look at the camera")
        return Affordances(hazard_stop=float(observation.image.mean()) / 255)


def picture(image: Image, number: int = 0) -> SourcePicture:
    return SourcePicture(number, "", number / 10, image)


def stripes(height: int = 90, width: int = 200) -> Image:
    """Rows that are as bright as their number."""
    return np.broadcast_to(np.arange(height, dtype=np.uint8)[:, None, None], (height, width, 3)).copy()


def test_the_network_is_given_the_rows_that_were_asked_for_in_its_size() -> None:
    perception = Brightness()
    seen = Viewer(perception, SIZE, Command.LEFT, (45, 63)).look(picture(stripes()), "1")
    [observation] = perception.observations
    assert observation.image.shape == (9, 20, 3)
    assert observation.image[:, 0, 0].tolist() == pytest.approx([45.5 + 2 * k for k in range(9)], abs=0.5)
    assert observation.command is Command.LEFT
    assert seen.rows == (45, 63)
    assert seen.affordances is not None
    assert seen.affordances.hazard_stop == pytest.approx(54 / 255, abs=2e-3)
    assert replace(seen.affordances, hazard_stop=0.0) == Affordances()


def test_a_picture_that_tells_nothing_is_marked_and_the_next_is_looked_at() -> None:
    viewer = Viewer(Brightness(), SIZE, Command.STRAIGHT)
    black, bright = (viewer.look(picture(np.full((90, 200, 3), level, np.uint8)), "") for level in (0, 255))
    assert (black.affordances, black.note) == (None, "the image is black")
    assert (bright.affordances, bright.note) == (Affordances(hazard_stop=1.0), "")


def test_a_picture_of_another_shape_is_named_with_rows_that_fit() -> None:
    fitting, tall = (Viewer(Brightness(), SIZE, Command.STRAIGHT) for _ in range(2))
    fitting.look(picture(stripes(90, 200)), "")
    for k in range(2):
        tall.look(picture(stripes(150, 200), k), "")
    assert fitting.notes == ()
    [note] = tall.notes
    assert "200 x 150 pixels are squeezed into the network's 20 x 9" in note
    assert "--crop 30:120" in note


def test_a_crop_outside_a_picture_is_refused_with_its_rows() -> None:
    viewer = Viewer(Brightness(), SIZE, Command.STRAIGHT, (20, 91))
    with pytest.raises(ValueError, match=r"found --crop 20:91 where picture 0 has 90 rows.*type --crop 18:72"):
        viewer.look(picture(stripes()), "")


@pytest.mark.parametrize("text", ["", "120", "a:b", "-1:5", "480:120", "5:5", "1:2:3"])
def test_a_crop_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="type --crop 120:480"):
        parse_crop(text)


def test_a_crop_is_a_first_row_and_the_one_after_the_last() -> None:
    assert parse_crop("120:480") == (120, 480)
