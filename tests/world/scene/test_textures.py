"""The texture array."""

from __future__ import annotations

from caldrive.world.scene.textures import Tex, texture_layers


def test_layers_stand_in_the_order_of_their_names() -> None:
    layers = texture_layers()
    assert layers.shape[0] == len(Tex)
    red = layers[Tex.SIGN_60].astype(int)
    assert red[2, 2, 0] > red[2, 2, 1] + 100  # the sign's corner is as red as its ring


def test_layers_drawn_again_are_the_same() -> None:
    assert (texture_layers() == texture_layers()).all()
