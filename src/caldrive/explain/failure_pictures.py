"""Pictures of how failures came about: an episode is driven again until it goes wrong, and what the camera saw and what
the network looked at are drawn in the seconds before.

They lie in `attention` in the run's folder, and are not drawn again.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from glob import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import simplejpeg

from caldrive.affordances import BY_NAME
from caldrive.agents.rows import model_path
from caldrive.agents.settings import AgentSettings
from caldrive.benchmark.artifacts import JPEG, read_still, read_trace
from caldrive.benchmark.report.failure_cards import by_importance
from caldrive.benchmark.report.runs import BenchmarkRun, Failure, FailureMoment, failures
from caldrive.benchmark.run_folder import RunFolder
from caldrive.datatypes import CameraConfig, Command, Image, Step
from caldrive.driving.rollout import rollout
from caldrive.driving.setup import set_up
from caldrive.explain.blame import MUST_AGREE, require_same
from caldrive.explain.moments import Glance, Plan, plan
from caldrive.files import as_type, json_line, locked_folder, read_json, write_whole
from caldrive.interfaces import World, is_recordable
from caldrive.progress import Progress, silent
from caldrive.visualization.gauges import value_text

if TYPE_CHECKING:  # who only reads what was drawn waits for no torch
    from caldrive.perception.network.network import Network

FOLDER, VERSION = "attention", 2
MOST = 30  # failures that are drawn; more would not fit on a page
STILL = replace(CameraConfig(), width=320, height=141)
QUALITY = JPEG | {"quality": 65}
SAME = 0.01  # m, within which a car is at the same place
NO_NETWORK = "No attention: only CAL's own network can show where it looks."
OTHERWISE = "Driven again, the episode went differently: this agent does not do the same each time."


@dataclass(frozen=True)
class Drawn:
    """What is drawn of a failure, as JSON beside its pictures."""

    version: int
    """Of this file."""
    driven_by: dict[str, Any]
    """What drove it, of `MUST_AGREE`."""
    plan: Plan
    """What was looked at."""
    replies: tuple[str, ...] = ()
    """What the network says at each moment, where its driver does not see it."""
    note: str = ""
    """Why there is no attention, or no picture at all."""


@dataclass(frozen=True)
class Snapshot:
    """What was seen at a moment."""

    still: Image
    """(H, W, 3), to be looked at."""
    images: tuple[Image, ...]
    """What the network looks at, the oldest first."""
    command: Command
    """What the navigation system asked for."""


def draw_pictures(runs: Sequence[BenchmarkRun], progress: Progress = silent) -> None:
    """Draws what is missing of as many failures as fit on a page, those first that broke a rule.

    Raises ValueError where a run was driven by other code or another network, RuntimeError without Captum.
    """
    failed = failures(runs)
    shown = [failed[k] for k in by_importance(failed)[:MOST]]
    plans = [_missing(run, [failure for failure in shown if failure.run == run.name]) for run in runs]
    done, total = 0, sum(map(len, plans))
    for run, missing in zip(runs, plans, strict=True):
        for _ in _draw_run(run, missing) if missing else ():
            done += 1
            progress(f"pictures of failures: {done} of {total}", done / total)


def _missing(run: BenchmarkRun, wanted: Sequence[Failure]) -> dict[str, Plan]:
    """What to draw of some failures, by their keys, without what is drawn and what left no trace."""
    driver, plans = RunFolder(run.folder).driver, dict[str, Plan]()
    for failure in wanted:
        key = failure.result.trial.key
        if trace := read_trace(run.folder, key):
            before, plans[key] = _read(run, key), plan(failure, trace, driver)
            if before is not None and before.plan == plans[key]:
                del plans[key]
    return plans


def _draw_run(run: BenchmarkRun, plans: Mapping[str, Plan]) -> Iterator[str]:
    """Drives failures of a run again and draws them; yields the key of each that is done."""
    folder = RunFolder(run.folder)
    require_same(folder)
    network = _network(folder.driver)
    scenarios = {trial.key: trial.scenario for trial in folder.trials}
    with locked_folder(run.folder / FOLDER):
        world, agent = set_up(folder.driver)
        with closing(world):
            for key, wanted in plans.items():
                drive = rollout(world, agent, scenarios[key])
                snapshots = list(_snapshots(world, drive, wanted.glances, network.span if network else 1))
                _save(run, key, wanted, snapshots, network)
                yield key


def _network(driver: AgentSettings) -> Network | None:
    """The network that drove, None for an agent without one of ours."""
    if driver.agent != "cal":
        return None
    from caldrive.explain.activation_maps import require_captum
    from caldrive.perception.network.checkpoint import load_network

    require_captum()
    return load_network(model_path(driver.model))[0]


def _snapshots(world: World, drive: Iterable[Step], glances: Sequence[Glance], span: int) -> Iterator[Snapshot]:
    """What is seen at some moments of a drive, each with the last `span` images; no more once the car is elsewhere than
    it was."""
    assert is_recordable(world)  # both worlds of benchmarks are
    images, wanted = deque[Image](maxlen=span), {glance.step: glance for glance in glances}
    for number, step in enumerate(drive):
        images.append(step.observation.image)
        if (glance := wanted.get(number)) is not None:
            pose = step.truth.ego.pose
            if math.hypot(pose.x - glance.x, pose.y - glance.y) > SAME:
                return
            yield Snapshot(world.images([STILL])[0], tuple(images), step.observation.command)
        if number >= max(wanted):
            return


def _save(run: BenchmarkRun, key: str, wanted: Plan, snapshots: Sequence[Snapshot], network: Network | None) -> None:
    """Writes a failure's pictures, and last what says that they are there."""
    path, pictures, replies, note = _path(run, key), list[Image](), tuple[str, ...](), ""
    if len(snapshots) < len(wanted.glances):
        snapshots, note = (), OTHERWISE
    elif network is None or wanted.affordance is None:
        note = NO_NETWORK
    else:
        pictures, replies = _attention(network, wanted.affordance, snapshots)
    path.unlink(missing_ok=True)  # what it says may be of other pictures
    for kind, drawn in (("still", [one.still for one in snapshots]), ("attention", pictures)):
        for old in path.parent.glob(f"{escape(key)}-[0-9]-{kind}.jpg"):
            old.unlink()
        for k, picture in enumerate(drawn):
            write_whole(_picture_path(path, k, kind), simplejpeg.encode_jpeg(picture, **QUALITY))
    blind = wanted.affordance in (run.description.get("blind") or ())
    record = Drawn(VERSION, _driven_by(run), wanted, replies if blind else (), note)
    write_whole(path, json_line(asdict(record)))


def _attention(network: Network, affordance: str, snapshots: Sequence[Snapshot]) -> tuple[list[Image], tuple[str, ...]]:
    """The stills with what the network looks at in each, and what it says. Each has a scale of its own: the gradient is
    many times larger in one moment than in another."""
    from caldrive.explain.activation_maps import Question, attend
    from caldrive.explain.overlay import overlay, scale_of

    attentions = [attend(network, Question(affordance, one.command), one.images) for one in snapshots]
    pictures = [
        overlay(one.still, attention.now, scale_of([attention.now]), attention.reply.probability)
        for one, attention in zip(snapshots, attentions, strict=True)
    ]
    return pictures, tuple(value_text(BY_NAME[affordance], attention.reply.value) for attention in attentions)


def with_pictures(run: BenchmarkRun) -> BenchmarkRun:
    """A run with the pictures of its failures that are drawn. Raises ValueError where one is damaged."""
    explanations = dict(run.explanations)
    for failure in run.failures:
        key = failure.result.trial.key
        if drawn := _read(run, key):
            moments = tuple(_moments(_path(run, key), drawn))
            explanations[key] = replace(failure.explanation, moments=moments, note=drawn.note)
    return replace(run, explanations=explanations)


def _moments(path: Path, drawn: Drawn) -> Iterator[FailureMoment]:
    """The moments of a failure, from the pictures that are beside its file."""
    for k, glance in enumerate(drawn.plan.glances):
        text = f"{glance.text}; the network says {drawn.replies[k]}" if drawn.replies else glance.text
        still, attention = (_picture_path(path, k, kind) for kind in ("still", "attention"))
        if still.is_file():
            seen = read_still(attention) if attention.is_file() else None
            yield FailureMoment(glance.title, text, read_still(still), seen)


def _read(run: BenchmarkRun, key: str) -> Drawn | None:
    """What is drawn of a failure; None where nothing is, or of results that are not those of the run."""
    path = _path(run, key)
    if not path.is_file():
        return None
    try:
        values = read_json(path.read_bytes(), dict[str, Any])
        if (values.get("version"), values.get("driven_by")) != (VERSION, _driven_by(run)):
            return None
        return as_type(values, Drawn)
    except ValueError as error:
        raise ValueError(f"found {path} damaged ({error}), wanted what is drawn of a failure: remove it") from error


def _driven_by(run: BenchmarkRun) -> dict[str, Any]:
    return {name: run.description.get(name) for name in MUST_AGREE}


def _path(run: BenchmarkRun, key: str) -> Path:
    return run.folder / FOLDER / f"{key}.json"


def _picture_path(path: Path, k: int, kind: str) -> Path:
    return path.with_name(f"{path.stem}-{k}-{kind}.jpg")
