"""A town on one page: the contact sheet as a PNG file."""

from __future__ import annotations

import io
from pathlib import Path

from PIL import Image as Picture

from caldrive.config import MOST_PIXELS
from caldrive.driving.limits import require_within
from caldrive.driving.outputs import require_writable_file
from caldrive.files import write_whole


def write_sheet(town: str, path: Path, width: int | None = None, looks: int = 0) -> tuple[int, int]:
    """Writes a town's contact sheet, shrunk or enlarged to a width in pixels if one is given; returns (width, height).
    looks: see `contact_sheet`.

    Raises ValueError, FileNotFoundError or OSError for an unknown town, a name that is no .png, a locked door.
    """
    require_writable_file(path, "--sheet", ".png")
    if width is not None:
        require_within("--width", width, 16, 4 * MOST_PIXELS, 1920)
    require_within("--looks", looks, 0, 100, 8)
    from caldrive.world.sheet import contact_sheet

    picture = Picture.fromarray(contact_sheet(town, looks=looks))
    if width is not None:
        picture = picture.resize((width, round(picture.height * width / picture.width)), Picture.Resampling.LANCZOS)
    content = io.BytesIO()
    picture.save(content, "PNG")
    write_whole(path, content.getvalue())
    return picture.size
