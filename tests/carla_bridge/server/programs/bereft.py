"""Ticks until the server is gone; prints what the client says then."""

from __future__ import annotations

import json

from tests.carla_bridge.server.programs.session import connect, run, synchronous


def main() -> None:
    client = connect()
    client.set_timeout(3.0)
    world = client.get_world()
    synchronous(world)
    print("ticking", flush=True)
    try:
        while True:
            world.tick()
    except RuntimeError as error:
        print(json.dumps({"said": str(error)}))


if __name__ == "__main__":
    run(main)
