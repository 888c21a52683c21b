"""Counterfactuals: the same moment of a drive again with one thing changed, and what the network says then.

Attention shows where a network looks. That a prediction hangs on a thing is shown only by a world in which nothing else
is different.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from statistics import mean

import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import CameraConfig, Image
from caldrive.explain.activation_maps import Attention, Reply, ask, attend, frames_back
from caldrive.explain.cases import Case
from caldrive.explain.interventions import UNCHANGED, Intervention, interventions_in
from caldrive.explain.situations import NEAR_CAR
from caldrive.perception.network.network import Network
from caldrive.world.rendering.camera import CameraRig

DIFFERENT = 8  # grey levels from which on a pixel is seen to be another
FEWEST_EPISODES = 5  # of which an interval says anything
FEWEST_CHANGED = 8  # that have to change for a thing to be seen at all: a lamp is small
RESAMPLES, LOW, HIGH = 2000, 2.5, 97.5  # of the bootstrap, and the percentiles of its interval
Values = Sequence[tuple[int, float]]  # of cases, each with its episode
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Studio:
    """Where cases are drawn again, and shown to a network."""

    rig: CameraRig
    network: Network
    method: str = "hirescam"
    """Whose attention is asked for, see `activation_maps.METHODS`."""

    @property
    def camera(self) -> CameraConfig:
        """The network's."""
        height, width = self.network.config.image_size
        return CameraConfig(width=width, height=height)

    def pictures(self, case: Case, intervention: Intervention = UNCHANGED) -> list[Image]:
        """All frames of a case, the oldest first; those that the block of its affordance does not look at stand for
        others."""
        back = frames_back(self.network, case.question.affordance)
        last = len(case.states) - 1
        drawn = intervention.pictures(self.rig, case, self.camera, [last - frames for frames in back])
        place = dict(zip(back, drawn, strict=True))
        return [place.get(last - frame, drawn[-1]) for frame in range(last + 1)]

    def semantics(self, case: Case, intervention: Intervention = UNCHANGED) -> NDArray[np.uint8]:
        """The classes (H, W) of the last one's pixels."""
        thing = intervention.thing(case)
        assert thing is not None
        state = intervention.edit(self.rig.town, case.states[-1], thing)
        return self.rig.render_semantics(state, [self.camera])[0]


@dataclass(frozen=True)
class Seen:
    """A case in the studio, and what the network says of it."""

    studio: Studio
    case: Case
    images: tuple[Image, ...] = field(repr=False)
    reply: Reply

    @cached_property
    def attention(self) -> Attention:
        """Where the network looks."""
        return attend(self.studio.network, self.case.question, self.images, self.studio.method)

    @property
    def is_right(self) -> bool:
        """Whether the network sees what is true; always so where that is the question."""
        return self.case.situation.holds in (None, says(self.case, self.reply))

    def changed(self, intervention: Intervention) -> Counterfactual:
        """The same with a change."""
        network, question = self.studio.network, self.case.question
        images = self.studio.pictures(self.case, intervention)
        return Counterfactual(
            self.case, intervention, self.reply, ask(network, question, images),
            ask(network, question, [*self.images[:-1], images[-1]]), different(self.images[-1], images[-1]), images[-1],
        )  # fmt: skip


@dataclass(frozen=True)
class Change:
    """What one change changes in one case: scores (a probability, or a distance in m) and whether the answer flips."""

    situation: str
    name: str
    control: bool
    """Whether it should change nothing."""
    before: float
    after: float
    """With the change in all frames that the network looks at."""
    now: float
    """With the change in the present frame alone."""
    flips: bool
    """Whether the answer is another one: yes or no, or the number on a sign."""
    flips_now: bool


@dataclass(frozen=True)
class Counterfactual:
    """What a network says of a case, and of the same with a change."""

    case: Case
    intervention: Intervention
    before: Reply
    after: Reply
    """With the change in all frames that it looks at."""
    after_now: Reply
    """With the change in the present one alone."""
    where: Mask = field(repr=False)
    """The pixels (H, W) of the present one that the change changes."""
    image: Image = field(repr=False)
    """The present one with the change."""

    @property
    def is_seen(self) -> bool:
        """Whether there is anything to see of what is changed."""
        return int(self.where.sum()) >= FEWEST_CHANGED

    @property
    def change(self) -> float:
        """By how much the probability rises, or the distance in m."""
        return score(self.after) - score(self.before)

    @property
    def summary(self) -> Change:
        """The same as numbers."""
        before = says(self.case, self.before)
        return Change(
            self.intervention.situation, self.intervention.name, self.intervention.control,
            score(self.before), score(self.after), score(self.after_now),
            says(self.case, self.after) != before, says(self.case, self.after_now) != before,
        )  # fmt: skip


def see(studio: Studio, case: Case) -> Seen:
    """What the network says of a case as it was."""
    images = tuple(studio.pictures(case))
    return Seen(studio, case, images, ask(studio.network, case.question, images))


def counterfactuals(seen: Seen) -> Iterator[Counterfactual]:
    """A case with each change of which anything is to be seen."""
    for intervention in interventions_in(seen.case):
        one = seen.changed(intervention)
        if one.is_seen:
            yield one


def different(one: Image, other: Image) -> Mask:
    """Where two images (H, W, 3) differ."""
    result: Mask = np.abs(one.astype(int) - other).max(axis=2) >= DIFFERENT
    return result


def score(reply: Reply) -> float:
    """The probability of the class that is asked about, or the value."""
    return reply.value if reply.probability is None else reply.probability


def says(case: Case, reply: Reply) -> bool:
    """Whether a network says yes: there is a red light, a hazard, this number on a sign, a car nearer than 20 m."""
    if reply.probability is None:
        return reply.value < NEAR_CAR
    if case.question.label is not None:
        return reply.value == case.question.label
    return reply.probability >= 0.5


def interval(values: Values, seed: int) -> tuple[float, float] | None:
    """The bootstrap's 95 % interval of a mean, where whole episodes are drawn: what happens in one belongs together.
    None for so few episodes that it would say nothing."""
    episodes = sorted({episode for episode, _ in values})
    if len(episodes) < FEWEST_EPISODES:
        return None
    sums = np.array([sum(value for one, value in values if one == episode) for episode in episodes])
    sizes = np.array([sum(one == episode for one, _ in values) for episode in episodes])
    drawn = np.random.default_rng(seed).integers(len(episodes), size=(RESAMPLES, len(episodes)))
    low, high = np.percentile(sums[drawn].sum(axis=1) / sizes[drawn].sum(axis=1), (LOW, HIGH)).tolist()
    return low, high


@dataclass(frozen=True)
class Effect:
    """What a change changes, over all cases that the network saw right. Of a probability, or of a distance in m."""

    situation: str
    change: str
    control: bool
    """Whether it should change nothing."""
    cases: int
    episodes: int
    before: float
    """Mean, as the next ones."""
    after: float
    """With the change in all frames that the network looks at."""
    difference: float
    interval: tuple[float, float] | None
    """Of the difference, 95 %; None for too few episodes."""
    flipped: int
    """Cases in which the answer is another one: yes or no, or the number on a sign."""
    difference_now: float
    """With the change in the present frame alone, as the next one."""
    flipped_now: int


def effects(found: Sequence[tuple[int, Change]], seed: int = 0) -> list[Effect]:
    """One for each change. found: with their episodes."""
    by_change: dict[tuple[str, str, bool], list[tuple[int, Change]]] = {}
    for episode, one in found:
        by_change.setdefault((one.situation, one.name, one.control), []).append((episode, one))
    return [_effect(members, seed) for members in by_change.values()]


def _effect(found: Sequence[tuple[int, Change]], seed: int) -> Effect:
    changes, first = [one for _, one in found], found[0][1]
    before, after, now = (mean(getattr(one, name) for one in changes) for name in ("before", "after", "now"))
    return Effect(
        first.situation, first.name, first.control, len(found), len({episode for episode, _ in found}),
        before=before, after=after, difference=after - before,
        interval=interval([(episode, one.after - one.before) for episode, one in found], seed),
        flipped=sum(one.flips for one in changes), difference_now=now - before,
        flipped_now=sum(one.flips_now for one in changes),
    )  # fmt: skip
