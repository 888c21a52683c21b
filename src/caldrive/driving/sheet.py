"""A town on one page: the contact sheet as a PNG file."""

from __future__ import annotations

import io
from pathlib import Path

from PIL import Image as Picture

from caldrive.driving.outputs import require_writable_file
from caldrive.files import write_whole


def write_sheet(town: str, path: Path, width: int | None = None, looks: int = 0) -> tuple[int, int]:
    """Writes a town's contact sheet, shrunk or enlarged to a width in pixels if one is given; returns (width, height).
    looks: see `contact_sheet`.

    Raises ValueError, FileNotFoundError or OSError for an unknown town, a name that is no .png, a locked door.
    """
    if path.suffix.lower() != ".png":
        raise ValueError(
            f"found --sheet {path}, wanted a name that ends in .png: type --sheet {path.with_suffix('.png')}"
        )
    if width is not None and not 16 <= width <= 16384:
        raise ValueError(f"found --width {width}, wanted 16 to 16384 pixels: type --width 1920")
    if not 0 <= looks <= 100:
        raise ValueError(f"found --looks {looks}, wanted 0 to 100: type --looks 8")
    require_writable_file(path, "--sheet")
    from caldrive.world.sheet import contact_sheet

    picture = Picture.fromarray(contact_sheet(town, looks=looks))
    if width is not None:
        picture = picture.resize((width, round(picture.height * width / picture.width)), Picture.Resampling.LANCZOS)
    content = io.BytesIO()
    picture.save(content, "PNG")
    write_whole(path, content.getvalue())
    return picture.size
