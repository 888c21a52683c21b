"""The paper's three observations on attention (section 4.3, Fig. 4) as statements, each tested on cases of a drive.

The network looks at the road's outlines for traffic lights; it sees a hazard announced by the shadow of a person who is
not in the picture; it looks at the legs of a person. Where it looks is one question, whether its answer hangs on that
another: each observation is tested for both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from statistics import mean

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from caldrive.datatypes import Semantic
from caldrive.explain.activation_maps import upsampled
from caldrive.explain.counterfactuals import FEWEST_CHANGED, Counterfactual, Mask, Seen, Values, interval, score
from caldrive.explain.faithfulness import energy_inside
from caldrive.explain.interventions import (
    AWAY,
    NO_OUTLINES,
    NO_SHADOW,
    ONLY_LEGS,
    ONLY_SHADOW,
    ONLY_TORSO,
)

OUTLINE = 2  # pixels to either side of the road's end
LOWER = 1 / 3  # of a person's height
LEAST = 0.01  # of a probability, or of the attention: what is less is no effect, however sure
Changed = dict[str, Counterfactual]  # by the name of the change
Measure = Callable[[Seen, Changed], float | None]  # positive where a statement holds, None where it cannot be asked


def outlines(semantics: NDArray[np.uint8]) -> Mask:
    """Where in a semantic image (H, W) the road ends at a sidewalk or at the ground."""
    road = np.isin(semantics, (Semantic.ROAD, Semantic.LINE))
    beside = np.isin(semantics, (Semantic.SIDEWALK, Semantic.GROUND))
    result: Mask = binary_dilation(road, iterations=OUTLINE) & binary_dilation(beside, iterations=OUTLINE)
    return result


def lower_part(person: Mask) -> Mask:
    """The lower third of a person."""
    rows = np.flatnonzero(person.any(axis=1))
    first = rows[-1] + 1 - round(LOWER * (rows[-1] + 1 - rows[0]))
    result: Mask = person & (np.arange(len(person))[:, None] >= first)
    return result


def _attention_on(seen: Seen, mask: Mask) -> float:
    """By how much more attention a place has than its share of the picture, in shares of all attention."""
    large = upsampled(seen.attention.now, mask.shape)
    return energy_inside(large, mask) - float(mask.mean())


def _on_outlines(seen: Seen, changed: Changed) -> float | None:
    mask = outlines(seen.studio.semantics(seen.case))
    return _attention_on(seen, mask) if mask.any() else None


def _on_shadow(seen: Seen, changed: Changed) -> float | None:
    return _attention_on(seen, changed[NO_SHADOW].where) if NO_SHADOW in changed else None


def _on_legs(seen: Seen, changed: Changed) -> float | None:
    """By how much more attention the lower third has than its share of the person, in shares of the person's."""
    if AWAY not in changed:
        return None
    semantics = seen.studio.semantics(seen.case)
    person = (semantics == Semantic.PERSON) & (
        seen.studio.semantics(seen.case, changed[AWAY].intervention) != Semantic.PERSON
    )
    if person.sum() < FEWEST_CHANGED:
        return None
    large = upsampled(seen.attention.now, person.shape)
    whole = energy_inside(large, person)
    if whole == 0:
        return None
    legs = lower_part(person)
    return energy_inside(large, legs) / whole - float(legs.sum() / person.sum())


def _with(name: str) -> Measure:
    """By how much what a change takes away speaks for the class."""
    return lambda seen, changed: -changed[name].change if name in changed else None


def _between(name: str, other: str) -> Measure:
    """By how much likelier the class is with a change than with another one."""

    def measure(seen: Seen, changed: Changed) -> float | None:
        if name not in changed or other not in changed:
            return None
        return score(changed[name].after) - score(changed[other].after)

    return measure


@dataclass(frozen=True)
class Statement:
    """What is claimed."""

    text: str
    situation: str
    """By its name."""
    measure: Measure


STATEMENTS = (
    Statement("At a red light the road's outlines draw attention", "red light", _on_outlines),
    Statement("The road's outlines make a red light likelier", "red light", _with(NO_OUTLINES)),
    Statement("The shadow of a person out of view draws attention", "shadow of a person out of view", _on_shadow),
    Statement(
        "The shadow of a person out of view makes a hazard likelier", "shadow of a person out of view", _with(NO_SHADOW)
    ),
    Statement(
        "The shadow of a person in the way, without the body, makes a hazard likelier", "hazard by a person",
        _between(ONLY_SHADOW, AWAY),
    ),
    Statement(
        "Of a person in the way the lower third draws more than its share of attention", "hazard by a person", _on_legs
    ),
    Statement(
        "Legs alone make a hazard likelier than a torso alone", "hazard by a person", _between(ONLY_LEGS, ONLY_TORSO)
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Finding:
    """What became of a statement."""

    statement: str
    cases: int
    episodes: int
    value: float | None
    """Mean; positive speaks for it. A difference of probabilities, or of shares of the attention. None without
    cases."""
    interval: tuple[float, float] | None
    """Of the mean, 95 %."""

    @property
    def verdict(self) -> str:
        """Whether it is true, by the interval alone: which has to lie beyond LEAST, or below it."""
        if self.interval is None:
            return "too few cases"
        low, high = self.interval
        return "true" if low > LEAST else "false" if high < LEAST else "not shown"


def measured(seen: Seen, found: Sequence[Counterfactual]) -> Iterator[tuple[Statement, float]]:
    """What a case says of each statement that it is about. found: the case with each of its changes."""
    changed = {one.intervention.name: one for one in found}
    for statement in STATEMENTS:
        if statement.situation == seen.case.situation.name:
            value = statement.measure(seen, changed)
            if value is not None:
                yield statement, value


def finding(statement: Statement, values: Values, seed: int = 0) -> Finding:
    """The verdict on a statement from what each case says of it."""
    if not values:
        return Finding(statement.text, 0, 0, None, None)
    episodes = len({episode for episode, _ in values})
    return Finding(
        statement.text, len(values), episodes, mean(value for _, value in values), interval(values, seed)
    )  # fmt: skip
