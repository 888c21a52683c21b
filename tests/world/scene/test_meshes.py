"""The primitives: their size, and that they look outwards."""

from __future__ import annotations

import math

import numpy as np
import pytest

from caldrive.datatypes import Semantic
from caldrive.world.scene.meshes import Surface, box, disc, from_hex, lathe, merge, quads, with_class
from tests.world.scene.measures import area_vectors, volume

RED = Surface((255, 0, 0))


def test_a_box_looks_outwards_and_has_its_size() -> None:
    mesh = box((1, 2, 0.5), (2, 4, 1), RED)
    assert np.ptp(mesh.vertices["position"], axis=0) == pytest.approx((2, 4, 1))
    assert volume(mesh) == pytest.approx(8)  # the missing underside lies at z = 0


def test_a_surface_is_on_every_vertex_and_its_texture_repeats_by_the_tile() -> None:
    mesh = box((0, 0, 1), (2, 4, 2), Surface((9, 8, 7), layer=3, tile=0.5, slot=4, spare=5))
    assert (mesh.vertices["color"] == (9, 8, 7)).all()
    assert set(mesh.vertices["slot"]) == {4}
    assert set(mesh.vertices["spare"]) == {5}
    assert set(mesh.vertices["uv"][:, 2]) == {3.0}
    assert np.ptp(mesh.vertices["uv"][:16, 0]) == pytest.approx(4 / 0.5)  # the longer side


def test_normals_agree_with_the_order_of_corners() -> None:
    mesh = merge((box((0, 0, 1), (1, 2, 2), RED), lathe(((0.5, 0.0), (0.4, 1.0)), 6, RED)))
    normals = (mesh.vertices["normal"][mesh.triangles[:, 0]].astype(float) - 128) / 127
    assert ((normals * area_vectors(mesh)).sum(axis=1) > 0).all()


@pytest.mark.parametrize(
    ("facing", "axis", "side"), [(1, "x", (1, 0)), (-1, "x", (-1, 0)), (1, "y", (0, 1)), (-1, "y", (0, -1))]
)
def test_a_disc_looks_where_it_is_told_to(facing: int, axis: str, side: tuple[int, int]) -> None:
    total = area_vectors(disc((0, 0, 1), 1.0, 32, RED, facing, axis=axis)).sum(axis=0)
    assert total[:2] == pytest.approx(math.pi * np.array(side), rel=0.02, abs=1e-6)


def test_quads_without_area_are_left_out() -> None:
    square, line = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 0, 0), (1, 0, 0), (1, 0, 0), (0, 0, 0)]
    assert len(quads([square, line], (0, 0, 0)).triangles) == 2


def test_a_class_is_given_to_what_has_none() -> None:
    mesh = merge((box((0, 0, 1), (1, 1, 1), RED), box((0, 0, 3), (1, 1, 1), Surface((0, 0, 0), slot=Semantic.SIGN))))
    assert set(with_class(mesh, Semantic.FURNITURE).vertices["slot"]) == {Semantic.FURNITURE, Semantic.SIGN}


def test_a_colour_can_be_a_number() -> None:
    assert from_hex(0xFF8000, 0x000001) == ((255, 128, 0), (0, 0, 1))
