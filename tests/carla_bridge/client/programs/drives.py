"""Drives through the protocol, looks around there, and meets others; prints what was true as JSON."""

from __future__ import annotations

import json
import sys
from contextlib import closing
from dataclasses import astuple, replace
from typing import Any

import numpy as np

from caldrive import CALAgent, CALController, OraclePerception, run_episode, task_scenarios
from caldrive.carla_bridge.client.connection import Connection, served_town
from caldrive.carla_bridge.client.world import CarlaWorld
from caldrive.datatypes import CameraConfig, Control, Step
from caldrive.interfaces import RecordableWorld, World

ROUTE = task_scenarios("town01", "straight")[6]  # no light stands on it, so that nothing depends on when it begins
AHEAD, ASIDE = CameraConfig(width=96, height=48), CameraConfig(width=96, height=48, left=0.5, yaw=0.2)
OTHERS = 4


def figures(step: Step) -> list[Any]:
    """What is true at a step, as numbers."""
    truth = step.truth
    pose = truth.ego.pose.x, truth.ego.pose.y, truth.ego.pose.heading, truth.ego.speed
    return [truth.time, *pose, *astuple(truth.affordances), truth.route_done, truth.goal_distance, truth.speed_limit]


def driven(world: World, town: str) -> tuple[str, list[list[Any]]]:
    """How the oracle drives the route: the outcome, and the figures of each step."""
    agent, rows = CALAgent(OraclePerception(world.truth), CALController()), list[list[Any]]()
    result = run_episode(world, agent, replace(ROUTE, town=town), lambda step: rows.append(figures(step)))
    return result.outcome.value, rows


def looked(world: RecordableWorld, town: str) -> dict[str, Any]:
    """What is seen from the start and from beside it, and the labels there."""
    seen = world.reset(replace(ROUTE, town=town))
    world.displace(0.4, 0.1)
    classes, images = world.semantic_images([AHEAD, ASIDE]), world.images([AHEAD, ASIDE])
    return {
        "first": seen.image.tolist(), "images": np.stack(images).tolist(), "classes": np.stack(classes).tolist(),
        "labels": [astuple(world.labels_at(mount)) for mount in (AHEAD, ASIDE)],
        "others": len(world.other_commands_at(AHEAD)),
    }  # fmt: skip


def among_others(world: CarlaWorld, town: str) -> dict[str, Any]:
    """Two episodes among others."""
    counts, scenario = [], replace(ROUTE, town=town, n_vehicles=OTHERS, n_pedestrians=OTHERS, weather=6)
    for _ in range(2):
        world.reset(scenario)
        for _ in range(30):
            world.step(Control(brake=1.0))
        truth = world.truth()
        counts.append((len(truth.vehicles), len(truth.pedestrians)))
    cars, people = ([one.speed for one in kind] for kind in (truth.vehicles, truth.pedestrians))
    return {"counts": counts, "cars": cars, "people": people}


def main() -> None:
    port = int(sys.argv[1])
    assert served_town("127.0.0.1", port, "TOWN01") == "town01"  # it is known here
    with closing(Connection("127.0.0.1", port)) as connection:
        town = str(connection.map_file())  # but its roads can be read, as those of CARLA's maps are
    with closing(CarlaWorld(AHEAD, port=port)) as world:
        outcome, rows = driven(world, town)
        found: dict[str, Any] = {"town": town, "outcome": outcome, "rows": rows, "looked": looked(world, town)}
        found |= among_others(world, town)
    with closing(Connection("127.0.0.1", port)) as connection:
        found |= {"left": len(connection.left_behind()), "sync": connection.world.get_settings().synchronous_mode}
    print(json.dumps(found))


if __name__ == "__main__":
    main()
