"""Cars and people as meshes: their size, and that they look outwards."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from caldrive.world.scene import people
from caldrive.world.scene.cars import LENGTH, SHAPES, WIDTH, CarShape, car_mesh, far_car_mesh
from caldrive.world.scene.meshes import Mesh
from tests.world.scene.measures import volume


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("make", [car_mesh, far_car_mesh])
def test_cars_have_their_size_and_look_outwards(shape: CarShape, make: Callable[[CarShape], Mesh]) -> None:
    mesh = make(shape)
    low, high = mesh.vertices["position"].min(axis=0), mesh.vertices["position"].max(axis=0)
    assert high[0] - low[0] == pytest.approx(LENGTH, abs=0.05)
    assert WIDTH <= high[1] - low[1] < WIDTH + 0.4
    assert 0 <= low[2] < 0.1
    assert high[2] == pytest.approx(shape.height, abs=0.05)
    assert volume(mesh) > 0
    assert len(mesh.triangles) < 300


def test_people_are_as_tall_as_they_say() -> None:
    for mesh in (people.person_mesh(), people.far_person_mesh()):
        assert mesh.vertices["position"][:, 2].max() == pytest.approx(people.HEIGHT, abs=0.03)
        assert mesh.vertices["position"][:, 2].min() == pytest.approx(0, abs=0.02)


def test_people_differ_in_height() -> None:
    heights = people.heights(np.arange(10_000))
    assert heights.min() == pytest.approx(1.6)
    assert heights.max() == pytest.approx(1.9)
