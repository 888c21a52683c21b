"""Comes after somebody who was killed; then looks for a server where there is none. Prints what it finds as JSON."""

from __future__ import annotations

import json
import sys

from caldrive.carla_bridge.client import connection
from caldrive.carla_bridge.client.connection import Connection


def main() -> None:
    here = Connection("127.0.0.1", int(sys.argv[1]))
    found: dict[str, object] = {"left": here.synchronise()}
    found |= {"after": len(here.left_behind()), "delta": here.world.get_settings().fixed_delta_seconds}
    here.close()
    found["sync"] = here.world.get_settings().synchronous_mode
    connection.FIRST_PATIENCE = 0.3
    try:
        Connection("127.0.0.1", int(sys.argv[2]))
    except RuntimeError as error:
        found["error"] = str(error)
    print(json.dumps(found))


if __name__ == "__main__":
    main()
