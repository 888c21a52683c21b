"""Counterfactuals over many episodes: how much each change changes, what became of the paper's observations, and a
sheet of pictures."""

from __future__ import annotations

import io
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from statistics import mean

import numpy as np
from PIL import Image as Picture
from PIL import ImageDraw

from caldrive.agents.settings import AgentSettings
from caldrive.datatypes import Image, Observation
from caldrive.driving.setup import set_up
from caldrive.explain.cases import SITUATIONS, find_cases
from caldrive.explain.counterfactuals import (
    Counterfactual,
    Effect,
    Seen,
    Studio,
    counterfactuals,
    effects,
    says,
    score,
    see,
)
from caldrive.explain.interventions import INTERVENTIONS, Intervention
from caldrive.explain.observations import STATEMENTS, Finding, Statement, finding, measured
from caldrive.explain.overlay import overlay, said, scale_of
from caldrive.interfaces import Perception
from caldrive.perception.network.network import Network
from caldrive.progress import Progress, silent
from caldrive.scenarios import Scenario
from caldrive.visualization.gauges import BACKGROUND, MUTED, write
from caldrive.world.embedded import EmbeddedWorld
from caldrive.world.rendering.camera import CameraRig
from caldrive.world.town import load_town

CROSSING = 4.0  # times as often as usual people cross the road: else a hazard by a person is rare
CAPTION, GAP = 22, 4  # pixels
HEADS = ("as it was", "with the change", "difference, three times as strong", "attention, as it was")
STRONGER = 3  # times as strong a difference is drawn, as a shadow is faint
Shown = Mapping[Intervention, tuple[Seen, Counterfactual]]


@dataclass(frozen=True)
class DrivingGap:
    """How far the network at the wheel, in 8-bit integers, is from the one that is asked here."""

    cases: int
    other_answers: int
    difference: float
    """Mean, of probabilities."""


@dataclass(frozen=True)
class Study:
    """What was found."""

    found: dict[str, tuple[int, int]]
    """By situation: cases, and those that the network saw right; only these are changed."""
    effects: list[Effect]
    findings: list[Finding]
    shown: Shown
    """An example of each change."""
    gap: DrivingGap


def study(
    network: Network, at_the_wheel: Perception, scenarios: Sequence[Scenario], *, cases: int, layer: str, seed: int,
    progress: Progress = silent,
) -> Study:  # fmt: skip
    """Drives scenarios of one town and changes what is found there. cases: at most, of each situation; seed: decides
    which moments of a drive."""
    found, right = Counter[str](), Counter[str]()
    all_changed, values = list[Counterfactual](), defaultdict[Statement, list[tuple[int, float]]](list)
    shown: dict[Intervention, tuple[Seen, Counterfactual]] = {}
    gaps = list[tuple[bool, float | None]]()
    for seen in _seen(network, scenarios, cases=cases, layer=layer, seed=seed, progress=progress):
        name = seen.case.situation.name
        found[name] += 1
        gaps.append(_driving_gap(at_the_wheel, seen))
        if not seen.is_right:
            continue
        right[name] += 1
        changed = list(counterfactuals(seen))
        for one in changed:
            shown.setdefault(one.intervention, (seen, one))
        for statement, value in measured(seen, changed):
            values[statement].append((seen.case.episode, value))
        all_changed += changed
    return Study(
        found={one.name: (found[one.name], right[one.name]) for one in SITUATIONS},
        effects=effects(all_changed, seed),
        findings=[finding(statement, values[statement], seed) for statement in STATEMENTS],
        shown=shown, gap=_gap(gaps),
    )  # fmt: skip


def _seen(
    network: Network, scenarios: Sequence[Scenario], *, cases: int, layer: str, seed: int, progress: Progress
) -> Iterator[Seen]:
    """The cases of all episodes as the network sees them, up to so many of each situation."""
    world, agent = set_up(AgentSettings(agent="oracle"))
    assert isinstance(world, EmbeddedWorld)
    counts = Counter[str]()
    with closing(world), closing(CameraRig(load_town(scenarios[0].town))) as rig:
        studio = Studio(rig, network, layer)
        for episode, scenario in enumerate(scenarios):
            driving, drawing = (_part(progress, episode, len(scenarios), half) for half in (0, 1))
            there = replace(scenario, crossing=CROSSING)
            found = find_cases(
                world, agent, there, episode=episode, span=network.span, seed=seed, progress=driving
            )  # fmt: skip
            for k, case in enumerate(found):
                drawing("drawing", k / len(found))
                if counts[case.situation.name] < cases:
                    counts[case.situation.name] += 1
                    yield see(studio, case)


def _part(progress: Progress, episode: int, episodes: int, half: int) -> Progress:
    """The progress of the first or the second half of an episode's work."""
    return lambda label, share: progress(
        f"episode {episode + 1} of {episodes}: {label}", (episode + (half + share) / 2) / episodes
    )


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


def _gap(gaps: Sequence[tuple[bool, float | None]]) -> DrivingGap:
    differences = [difference for _, difference in gaps if difference is not None]
    return DrivingGap(len(gaps), sum(is_other for is_other, _ in gaps), mean(differences) if differences else 0.0)


def sheet(shown: Shown, width: int = 300) -> bytes:
    """A PNG: a row for each change, with a moment as it was, as it is with the change, the difference, and where the
    network looked. width: pixels of a picture."""
    rows = [_row(intervention, *shown[intervention], width) for intervention in INTERVENTIONS if intervention in shown]
    head = Picture.new("RGB", (len(HEADS) * (width + GAP), CAPTION), BACKGROUND)
    for k, text in enumerate(HEADS):
        write(ImageDraw.Draw(head), (k * (width + GAP) + 6, CAPTION / 2), text, 13, MUTED)
    content = io.BytesIO()
    Picture.fromarray(np.concatenate([np.asarray(head), *rows])).save(content, "PNG", optimize=True)
    return content.getvalue()


def _row(intervention: Intervention, seen: Seen, changed: Counterfactual, width: int) -> Image:
    before, attention = seen.images[-1], seen.attention
    difference = np.abs(before.astype(int) - changed.image).max(axis=2, keepdims=True) * STRONGER
    looked = overlay(before, attention.now, scale_of([attention.now]), attention.reply.probability)
    gray = np.broadcast_to(difference.clip(max=255).astype(np.uint8), before.shape)
    pictures = [before, changed.image, gray, looked]
    height = round(before.shape[0] * width / before.shape[1])
    page = Picture.new("RGB", (len(pictures) * (width + GAP), height + CAPTION), BACKGROUND)
    for k, picture in enumerate(pictures):
        page.paste(Picture.fromarray(picture).resize((width, height)), (k * (width + GAP), CAPTION))
    kind = " (control)" if intervention.control else ""
    text = f"{intervention.situation}, {intervention.name}{kind}: {said(changed.before)}, then {said(changed.after)}"
    write(ImageDraw.Draw(page), (6, CAPTION / 2), text, 13)
    return np.asarray(page)
