"""What is looked for in a picture."""

from __future__ import annotations

from caldrive.datatypes import Image


def count(image: Image, color: tuple[int, int, int]) -> int:
    """Pixels of exactly a colour."""
    return int((image == color).all(-1).sum())
