"""Memory of a training's steps, which all ask for the same large blocks."""

from __future__ import annotations

import ctypes

# What glibc's mallopt calls them, from its malloc.h.
TRIM_THRESHOLD, TOP_PAD, MMAP_THRESHOLD = -1, -2, -3
KEPT = 2_000_000_000  # bytes


def keep_memory() -> bool:
    """Keep freed blocks for the next step, which saves wiping them: on two cores a fifth of a step's time.

    From then on the whole process gives back no memory. Returns whether this system's malloc can do that; glibc's can
    from 2.35 on.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):  # not glibc
        return False
    wanted = {MMAP_THRESHOLD: KEPT, TRIM_THRESHOLD: KEPT, TOP_PAD: KEPT // 4}
    return all(mallopt(name, size) for name, size in wanted.items())
