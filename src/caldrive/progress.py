"""How long work tells whoever watches how far it is."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str, float], None]  # what is being done, and the share of it that is done


def silent(label: str, share: float) -> None:
    """Progress that nobody follows."""
