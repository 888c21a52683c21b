"""What an option's number may be, looked at before the work begins."""

from __future__ import annotations

import math

MOST_SEED = 2**31 - 1  # a million times as much is still a seed for torch
MOST_WORKERS = 1024


def require_within(option: str, value: float, low: float, high: float, usual: float) -> None:
    """Raises ValueError where the value of an option is not a number from low to high; usual: what to type instead."""
    if not low <= value <= high:
        wanted = f"{low} or more" if high == math.inf else f"{low} to {high}"
        raise ValueError(f"found {option} {value}, wanted {wanted}: type {option} {usual}")
