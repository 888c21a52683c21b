"""CARLA's client library, imported where somebody drives in CARLA."""

from __future__ import annotations

import os
import tempfile
from typing import Any


def carla_module() -> Any:
    """CARLA's client library. Raises RuntimeError where it is not installed."""
    if "HOME" not in os.environ:  # as in some containers; the library ends the process without it
        home = os.path.expanduser("~")
        os.environ["HOME"] = home if os.path.isabs(home) else tempfile.gettempdir()
    try:
        import carla
    except ModuleNotFoundError as error:
        if error.name != "carla":
            raise
        raise RuntimeError(
            "found no CARLA client, wanted carla 0.9.16, which Python 3.10 to 3.12 can have: type pip install "
            "'caldrive[carla]'"
        ) from error
    return carla
