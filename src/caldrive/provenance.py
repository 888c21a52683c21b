"""Which code made a result: a version that is raised when behaviour changes, and not when a file moves.

A recording, a benchmark's results and a replay are continued or compared only under one version. Moving a function,
renaming it or rewording a comment leaves it alone; anything that changes a number raises it. `tests/test_provenance.py`
drives, records and sees a few fixed situations and fails when their numbers change while the version does not.
"""

from __future__ import annotations

BEHAVIOUR_VERSION = 1


def code_version() -> str:
    """The code that results depend on (world, agents, referee, recorder), in one word."""
    return f"behaviour-{BEHAVIOUR_VERSION}"
