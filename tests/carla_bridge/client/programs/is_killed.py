"""Begins an episode, or only lets the server wait for it, and ends like a process that is killed."""

from __future__ import annotations

import os
import sys

from caldrive.carla_bridge.client.connection import Connection
from caldrive.carla_bridge.client.world import CarlaWorld
from tests.carla_bridge.client.programs.drives import AHEAD, ROUTE

if __name__ == "__main__":
    if sys.argv[2:] == ["early"]:
        Connection("127.0.0.1", int(sys.argv[1])).synchronise()
    else:
        CarlaWorld(AHEAD, port=int(sys.argv[1])).reset(ROUTE)
    os._exit(9)
