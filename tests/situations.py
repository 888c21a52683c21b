"""A few fixed situations whose numbers stand for the metrics of the whole: `python -m tests.situations` keeps them.

The numbers are rounded and compared with a tolerance, as processors of different kinds differ in the last bits.
"""

from __future__ import annotations

import hashlib
import json
import math
import tempfile
from collections.abc import Iterator
from contextlib import closing
from dataclasses import astuple, replace
from pathlib import Path
from typing import Any

import numpy as np

from caldrive.agents.cal import CALAgent, OraclePerception
from caldrive.agents.rows import SHIPPED_MODEL
from caldrive.benchmark.episode_metrics import EpisodeMetrics
from caldrive.benchmark.suites import SUITES, suite, to_json
from caldrive.collection.config import CollectConfig
from caldrive.collection.recorder import record_episode
from caldrive.control.controller import CALController
from caldrive.control.presets import PAPER
from caldrive.datatypes import CameraConfig, Control, Observation, Step
from caldrive.driving.rollout import run_episode
from caldrive.driving.tasks import task_scenarios
from caldrive.interfaces import Agent
from caldrive.perception.inference.predictor import NetworkPerception
from caldrive.provenance import BEHAVIOUR_VERSION
from caldrive.recordings.reader import read_episode
from caldrive.results import result_values
from caldrive.scenarios import Scenario
from caldrive.world.embedded import EmbeddedWorld

KEPT = Path(__file__).parent / "situations.json"
Numbers = dict[str, list[float]]


class Reckless:
    """Full throttle with the wheel a little to the right: it meets kerbs, objects and cars."""

    decision = None

    def reset(self) -> None:
        """Nothing to forget."""

    def act(self, observation: Observation) -> Control:
        return Control(throttle=1.0, steer=-0.12 * math.sin(observation.time))


def numbers(value: Any) -> Iterator[float]:
    """All numbers in a nested value, in order."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list | tuple):
        for part in value:
            yield from numbers(part)
    elif isinstance(value, int | float) and math.isfinite(value):
        yield round(float(value), 4)


def driven(world: EmbeddedWorld, agent: Agent, scenario: Scenario) -> list[float]:
    """A drive's ego, control, truth and neighbours in every twentieth step, and what referee and figures say of it."""
    rows: list[Any] = []
    metrics = EpisodeMetrics()

    def watch(step: Step) -> None:
        metrics.add(step)
        if round(step.truth.time * 10) % 20 == 0:
            cars = [astuple(car.pose) for car in step.truth.vehicles[:5]]
            people = [astuple(one.pose) for one in step.truth.pedestrians[:5]]
            rows.append([astuple(step.truth.ego.pose), step.observation.speed, astuple(step.control), cars, people])
            rows.append([astuple(step.truth.affordances), step.truth.opposite_share, step.truth.speed_limit])

    result = run_episode(world, agent, scenario, watch)
    return list(numbers([rows, result_values(result), metrics.compute(result.infractions)]))


def limited(town: str, task: str, number: int, weather: int = 6, **traffic: int) -> Scenario:
    """A task's scenario that ends after 30 s."""
    return replace(task_scenarios(town, task, weather, seed=3, **traffic)[number], time_limit=30.0)  # type: ignore[arg-type]


def drives() -> Numbers:
    """The oracle in traffic under both controllers, and a driver who hits things."""
    with closing(EmbeddedWorld()) as world:
        oracle = CALAgent(OraclePerception(world.truth), CALController())
        by_paper = CALAgent(OraclePerception(world.truth), CALController(PAPER))
        return {
            "oracle, town01": driven(world, oracle, limited("town01", "navigation-dynamic", 3)),
            "oracle, town02": driven(world, oracle, limited("town02", "navigation", 7, cars=30, people=100)),
            "paper's controller": driven(world, by_paper, limited("town01", "one-turn", 2, cars=40, people=40)),
            "reckless": driven(world, Reckless(), limited("town02", "straight", 1, cars=20, people=150)),
        }


def recorded() -> Numbers:
    """Two recorded episodes: labels and controls of every 15th row, and how bright the pictures are, in blocks."""
    config = CollectConfig(episodes=2, duration=4.0, cars=30, people=30, semantic=True, seed=11)
    found: Numbers = {}
    with closing(EmbeddedWorld()) as world, tempfile.TemporaryDirectory() as folder:
        for number in range(config.episodes):
            record_episode(world, config, number, Path(folder))
            episode = read_episode(Path(folder) / f"episode-{number:05d}.parquet", semantic=True)
            columns = [c[::15].tolist() for n, c in episode.columns.items() if n != "episode"]
            found[f"recorded episode {number}"] = list(numbers(columns))
            classes = [np.bincount(episode.semantic(k).ravel(), minlength=12).tolist() for k in range(0, 60, 20)]
            found[f"semantic pixels {number}"] = list(numbers(classes))
            found[f"brightness {number}"] = [
                float(v) for k in range(0, 60, 20) for v in blocks(np.asarray(episode.image(k)))
            ]
    return found


def blocks(image: np.ndarray[Any, Any]) -> list[float]:
    """Mean of each block of 22 x 50 pixels and each colour."""
    height, width = image.shape[:2]
    parts = image[: height // 22 * 22, : width // 50 * 50].reshape(height // 22, 22, width // 50, 50, 3)
    return [round(float(v), 1) for v in parts.mean(axis=(1, 3)).ravel()]


def seen() -> Numbers:
    """What the network makes of a short drive's pictures, in 32 bits, as their integers differ between processors."""
    perception = NetworkPerception(SHIPPED_MODEL, precision="fp32")
    scenario = limited("town01", "navigation", 5, weather=3, cars=20, people=20)
    rows = []
    with closing(EmbeddedWorld(CameraConfig())) as world:
        observation = world.reset(scenario)
        for _ in range(15):
            rows.append(astuple(perception.predict(observation)))
            observation = world.step(Control(throttle=0.5))
    return {"network": list(numbers(rows))}


def fixed() -> dict[str, str]:
    """What must not change at all: suites with their routes, and the towns' networks."""
    import caldrive.world.embedded as world_module

    data = Path(world_module.__file__).parent.rglob("*.net.xml")
    texts = {name: to_json(suite(name)).encode() for name in SUITES}
    texts |= {path.name: path.read_bytes() for path in data}
    return {name: hashlib.sha256(text).hexdigest()[:16] for name, text in sorted(texts.items())}


def measured() -> Numbers:
    """The numbers of all situations by their names."""
    return drives() | recorded() | seen()


if __name__ == "__main__":
    kept = {"version": BEHAVIOUR_VERSION, "fixed": fixed(), "numbers": measured()}
    KEPT.write_text(json.dumps(kept, separators=(",", ":")).replace('],"', '],\n"') + "\n")
