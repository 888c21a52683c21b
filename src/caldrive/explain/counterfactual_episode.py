"""One episode of a study of counterfactuals: driven, changed, asked, and kept in a file."""

from __future__ import annotations

import base64
import json
import math
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from caldrive.agents.settings import AgentSettings
from caldrive.datatypes import Observation
from caldrive.driving.setup import set_up
from caldrive.explain.cases import SITUATIONS, find_cases
from caldrive.explain.counterfactual_sheet import row
from caldrive.explain.counterfactuals import Change, Seen, Studio, counterfactuals, says, score, see
from caldrive.explain.observations import measured
from caldrive.files import read_json, write_whole
from caldrive.interfaces import Agent, Perception
from caldrive.perception.inference.predictor import NetworkPerception
from caldrive.perception.network.checkpoint import load_network
from caldrive.provenance import code_version, file_digest
from caldrive.scenarios import Scenario
from caldrive.world.embedded import EmbeddedWorld
from caldrive.world.rendering.camera import CameraRig
from caldrive.world.town import load_town

CROSSING = 4.0  # times as often as usual people cross the road: else a hazard by a person is rare


@dataclass(frozen=True)
class StudyConfig:
    """What is studied. scenarios: of one town; cases: at most, of each situation; method: see
    `activation_maps.METHODS`; seed: decides which moments of a drive."""

    model: Path
    scenarios: tuple[Scenario, ...]
    cases: int
    method: str
    seed: int

    @property
    def most(self) -> int:
        """Cases of a situation from one episode: what happens in one belongs together."""
        return math.ceil(self.cases / len(self.scenarios))

    def decisive(self) -> dict[str, object]:
        """All that the findings depend on, in JSON's types."""
        about = {"code": code_version(), "model": file_digest(self.model), "cases": self.cases, "method": self.method}
        scenarios = json.loads(json.dumps([asdict(scenario) for scenario in self.scenarios]))
        return about | {"seed": self.seed, "scenarios": scenarios}


@dataclass
class EpisodeFindings:
    """What was found in an episode, as its file keeps it."""

    found: dict[str, tuple[int, int]] = field(default_factory=lambda: {one.name: (0, 0) for one in SITUATIONS})
    """By situation: cases, and those that the network saw right; only these are changed."""
    changes: list[Change] = field(default_factory=list)
    observations: list[tuple[str, float]] = field(default_factory=list)
    """By a statement's text, what a case says of it."""
    gaps: list[tuple[bool, float | None]] = field(default_factory=list)
    """Of each case, see `DrivingGap`: whether the answer is another one, and by how much the probability differs."""
    rows: dict[str, str] = field(default_factory=dict)
    """Of the sheet, by the change: an example as PNG, in base64."""


def study_episode(config: StudyConfig, out: Path, episode: int) -> None:
    """What a worker does: drives an episode, asks the network of its cases, and writes its file."""
    at_the_wheel = NetworkPerception(config.model, threads=1, watchdog=False)  # torch's threads, too, for all episodes
    network, _ = load_network(config.model)
    scenario = replace(config.scenarios[episode], crossing=CROSSING)
    world, oracle = set_up(AgentSettings(agent="oracle"))
    assert isinstance(world, EmbeddedWorld)
    findings, shown = EpisodeFindings(), shown_before(out, episode)
    with closing(world), closing(CameraRig(load_town(scenario.town))) as rig:
        studio = Studio(rig, network, config.method)
        for seen in _seen(studio, world, oracle, scenario, config=config, episode=episode):
            findings.gaps.append(_driving_gap(at_the_wheel, seen))
            _add(findings, seen, shown)
    write_whole(episode_path(out, episode), json.dumps(asdict(findings)).encode())


def _seen(
    studio: Studio, world: EmbeddedWorld, oracle: Agent, scenario: Scenario, *, config: StudyConfig, episode: int
) -> Iterator[Seen]:
    """The cases of an episode as the network sees them, of each situation as many as are its share."""
    counts = Counter[str]()
    rng = np.random.default_rng([config.seed, episode])
    cases = find_cases(world, oracle, scenario, span=studio.network.span, rng=rng)
    for case in cases:
        counts[case.situation.name] += 1
        if counts[case.situation.name] <= config.most:
            yield see(studio, case)


def _add(findings: EpisodeFindings, seen: Seen, shown: set[str]) -> None:
    """Adds what a case shows. shown: the changes of which another episode keeps an example."""
    name = seen.case.situation.name
    found, right = findings.found[name]
    findings.found[name] = found + 1, right + seen.is_right
    if not seen.is_right:
        return
    changed = list(counterfactuals(seen))
    for one in changed:
        if (key := one.intervention.key) not in shown:
            shown.add(key)
            findings.rows[key] = base64.b64encode(row(seen, one)).decode()
    findings.changes += [one.summary for one in changed]
    findings.observations += [(statement.text, value) for statement, value in measured(seen, changed)]


def _driving_gap(perception: Perception, seen: Seen) -> tuple[bool, float | None]:
    """Whether the network at the wheel gives another answer to a case, and by how much its probability differs."""
    perception.reset()
    command = seen.case.question.command
    for k, image in enumerate(seen.images):
        affordances = perception.predict(Observation(time=0.1 * k, image=image, speed=0.0, command=command))
    value = float(getattr(affordances, seen.case.question.affordance) or 0)
    is_binary = seen.case.question.spec.binary
    there = replace(seen.reply, value=value, probability=value if is_binary else seen.reply.probability)
    is_other = says(seen.case, there) != says(seen.case, seen.reply)
    return is_other, abs(value - score(seen.reply)) if is_binary else None


def episode_path(out: Path, episode: int) -> Path:
    """The file of an episode in a study's folder."""
    return out / "episodes" / f"{episode:04d}.json"


def read_findings(path: Path) -> EpisodeFindings:
    """What a file keeps. Raises ValueError where it is damaged."""
    try:
        return read_json(path.read_bytes(), EpisodeFindings)
    except ValueError as error:
        raise ValueError(f"found that {path} is damaged ({error}), wanted an episode's findings: remove it") from error


def shown_before(out: Path, episode: int) -> set[str]:
    """The changes of which an earlier episode keeps an example: the first one is shown, whoever was faster."""
    paths = [episode_path(out, k) for k in range(episode)]
    return {key for path in paths if path.is_file() for key in read_findings(path).rows}
