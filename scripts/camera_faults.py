"""Drives with a camera that fails on the way, and prints what the watchdog makes of each fault.

    python -m scripts.camera_faults [--routes 10] [--faults NAME ...] [--without] [--model FILE] [--out FOLDER]
    python -m scripts.camera_faults --faults none --routes 100 [--first 0]      # false alarms

Half of the routes lie in each town, in the traffic of the paper's last task; the weathers take turns. A fault begins
when the car has driven for 6 s and is faster than 10 km/h. An episode ends when the car stands and knows why, or some
time after the fault; without a fault it ends as usual, and all four tasks take turns. Every episode is a line in
OUT/episodes.jsonl; a run that was stopped goes on. --without drives the same without the watchdog.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

from caldrive.agents.cal import CALAgent
from caldrive.agents.rows import model_path
from caldrive.control.presets import make_controller
from caldrive.datatypes import KMH, CameraConfig, Control, Observation
from caldrive.driving.referee import Referee
from caldrive.driving.rollout import rollout
from caldrive.driving.setup import make_world
from caldrive.driving.tasks import TASKS, USUAL_TRAFFIC, task_scenarios
from caldrive.interfaces import World
from caldrive.perception.camera_faults import FAULTS, Fault, make_fault
from caldrive.perception.inference.predictor import NetworkPerception
from caldrive.results import InfractionKind
from caldrive.scenarios import Scenario

EARLIEST, FASTER = 6.0, 10 * KMH  # when a fault begins
SLOW = ("dying", "fading", "growing grain")
LONGEST = {name: 40.0 if name in SLOW else 20.0 for name in FAULTS}  # s after the fault
NONE = "none"  # a camera that works
STANDS = 0.1  # m/s
HEAD = (
    "fault", "episodes", "noticed", "after (s): median", "longest", "stands after (s): median", "metres until then",
    "hits", "other infractions", "what it says",
)  # fmt: skip
COLLISIONS = (InfractionKind.COLLISION_CAR, InfractionKind.COLLISION_OBJECT, InfractionKind.COLLISION_PERSON)


class FailingCamera(CALAgent):
    """CAL's agent behind a camera that fails. began: when (s), None before."""

    fault: Fault | None = None
    began: float | None = None

    def act(self, observation: Observation) -> Control:
        if (
            self.began is None
            and self.fault is not None
            and observation.time >= EARLIEST
            and observation.speed > FASTER
        ):
            self.began = observation.time
        if self.began is not None and self.fault is not None:
            shown = self.fault(observation.image, observation.time - self.began)
            observation = replace(observation, image=shown)
        return super().act(observation)

    @property
    def noticed(self) -> str:
        """What the watchdog says now."""
        note = self.decision.note if self.decision else ""
        return note.partition(":")[0] if "the camera" in note else ""


def scenario(k: int, task: str) -> Scenario:
    """The k-th route: towns and weathers take turns, and there is the usual traffic in every task."""
    town = ("town01", "town02")[k % 2]
    cars, people = USUAL_TRAFFIC[town]
    routes = task_scenarios(town, task, weather=1 + (5 * k + k // 14) % 14, cars=cars, people=people)
    return routes[(k * 5) // 2 % len(routes)]


def drive(world: World, agent: FailingCamera, scenario: Scenario, name: str) -> dict[str, Any]:
    """One episode: when the fault was noticed and when the car stood (s after it began), and what it hit from then
    on."""
    referee = Referee(scenario)
    noticed = stood = why = None
    metres = seconds = 0.0
    alarms = 0
    for step in rollout(world, agent, scenario):
        outcome = referee.watch(step.truth)
        alarms += bool(agent.noticed)
        if agent.noticed and noticed is None:
            noticed, why = step.observation.time - (agent.began or 0.0), agent.noticed
        if agent.began is not None:
            seconds = step.observation.time - agent.began
            metres += step.observation.speed * world.dt
            if agent.noticed and step.observation.speed < STANDS:
                stood = seconds
        if outcome is not None or stood is not None or seconds > LONGEST.get(name, math.inf):
            break
    after = [i for i in referee.infractions if agent.began is not None and i.time >= agent.began and i.at_fault]
    hits = [i.kind.value.removeprefix("collision with ") for i in after if i.kind in COLLISIONS]
    broken = [i.kind.value for i in after if i.kind not in COLLISIONS]
    return {
        "began": agent.began, "noticed": noticed, "stood": stood, "metres": round(metres, 1), "why": why,
        "hits": hits, "broken": broken, "steps": referee.result().duration / world.dt, "alarms": alarms,
    }  # fmt: skip


def episodes(options: argparse.Namespace, done: set[str]) -> Iterator[dict[str, Any]]:
    """The episodes that are not done yet, as they are driven."""
    world = make_world(camera=CameraConfig())
    perception = NetworkPerception(model_path(options.model), threads=1, watchdog=not options.without)
    try:
        for k, name in product(range(options.first, options.routes), options.faults):
            key = f"{name}/{k}/{'without' if options.without else 'with'}"
            if key in done:
                continue
            where = scenario(k, TASKS[k // 2 % len(TASKS)] if name == NONE else TASKS[-1])
            agent = FailingCamera(perception, make_controller("default", 20.0, world.dt))
            agent.fault = None if name == NONE else make_fault(name, seed=k)
            about = {"key": key, "fault": name, "town": where.town, "weather": where.weather, "task": where.task}
            yield about | drive(world, agent, where, name)
    finally:
        world.close()


def table(rows: list[dict[str, Any]]) -> str:
    """A line for each fault."""
    lines = [f"| {' | '.join(HEAD)} |", "|---" * len(HEAD) + "|"]
    for name in FAULTS:
        of = [row for row in rows if row["fault"] == name and row["began"] is not None]
        if not of:
            continue
        seen = sorted(row["noticed"] for row in of if row["noticed"] is not None)
        stood = [row["stood"] for row in of if row["stood"] is not None]
        hits = sum(len(row["hits"]) for row in of)
        whys = {_plainly(row["why"]) for row in of if row["why"]}
        cells = [
            name, str(len(of)), str(len(seen)), _number(seen), f"{seen[-1]:.1f}" if seen else "-", _number(stood),
            _number([row["metres"] for row in of]), str(hits), str(sum(len(row["broken"]) for row in of)),
            "; ".join(sorted(whys)),
        ]  # fmt: skip
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _number(values: list[float]) -> str:
    return f"{statistics.median(values):.1f}" if values else "-"


def _plainly(why: str) -> str:
    return " ".join("..." if any(map(str.isdigit, word)) else word for word in why.split())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--routes", type=int, default=10)
    parser.add_argument("--faults", nargs="+", default=list(FAULTS), choices=(*FAULTS, NONE))
    parser.add_argument("--first", type=int, default=0, help="the first route")
    parser.add_argument("--without", action="store_true", help="drive without the watchdog")
    parser.add_argument("--model", type=Path)
    parser.add_argument("--out", type=Path, default=Path("out/camera-faults"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / "episodes.jsonl"
    rows = [json.loads(line) for line in path.read_text().splitlines()] if path.is_file() else []
    with path.open("a") as file:
        for row in episodes(options, {row["key"] for row in rows}):
            file.write(json.dumps(row) + "\n")
            file.flush()
            rows.append(row)
            print(f"{row['key']}: noticed {row['noticed']}, stood {row['stood']}, hits {row['hits']}", flush=True)
    kind = "without" if options.without else "with"
    rows = [row for row in rows if row["key"].endswith(f"/{kind}")]
    print(table(rows))
    fine = [row for row in rows if row["fault"] == NONE]
    alarms, steps = sum(row["alarms"] for row in fine), sum(row["steps"] for row in fine)
    print(f"working camera: {len(fine)} episodes, {steps:.0f} frames, {alarms} frames with a false alarm")


if __name__ == "__main__":
    main()
