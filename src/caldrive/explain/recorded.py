"""Attention on a recording: a contact sheet of the situations that matter, and how true it is, in numbers."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import mean

import numpy as np
from PIL import Image as Picture
from PIL import ImageDraw

from caldrive.datatypes import Image
from caldrive.explain.activation_maps import Attention, Map, attend, frames_at, upsampled
from caldrive.explain.faithfulness import (
    Curve,
    about,
    centred_map,
    curve,
    energy_inside,
    points_at,
    random_map,
    randomised,
    score_of,
    similarity,
)
from caldrive.explain.overlay import scale_of, still, true_text
from caldrive.explain.situations import Example
from caldrive.perception.network.network import Network
from caldrive.progress import Progress, silent
from caldrive.visualization.gauges import BACKGROUND, write

Examples = Mapping[str, Sequence[Example]]
CAPTION = 24  # pixels above each row of the sheet
CASCADE = (0, 1, 2, 3, 4, 5)  # stages of the backbone, from the last on, that are randomised beside the block


def contact_sheet(network: Network, examples: Examples, method: str = "hirescam", width: int = 400) -> bytes:
    """A PNG: a row for each situation, a column for each of its examples."""
    rows = {name: _row(network, chosen, method, width) for name, chosen in examples.items() if chosen}
    sheet = Picture.new(
        "RGB",
        (max(row.shape[1] for row in rows.values()), sum(row.shape[0] + CAPTION for row in rows.values())),
        BACKGROUND,
    )
    draw, top = ImageDraw.Draw(sheet), 0
    for name, row in rows.items():
        write(draw, (8, top + CAPTION / 2), name, 15)
        sheet.paste(Picture.fromarray(row), (0, top + CAPTION))
        top += CAPTION + row.shape[0]
    content = io.BytesIO()
    sheet.save(content, "PNG", optimize=True)
    return content.getvalue()


def _row(network: Network, examples: Sequence[Example], method: str, width: int) -> Image:
    """Examples beside each other, each with a scale of its own: they are of different drives."""
    attentions = [attend(network, example.question, example.images, method) for example in examples]
    pictures = [
        still(
            example.images, attention, scale_of(attention.maps), width=width,
            truth=true_text(example.question.spec, example.truth),
        )
        for example, attention in zip(examples, attentions, strict=True)
    ]  # fmt: skip
    return np.concatenate(pictures, axis=1)


@dataclass(frozen=True)
class Figures:
    """How true the attention is in a situation; means over its examples."""

    situation: str
    examples: int
    pointing: float | None
    """Share in which the place of most attention is on the thing, or 6 pixels from it; None without semantic images."""
    energy: float | None
    """Share of the attention that is on it."""
    area: float | None
    """Share of the image that it takes: what the energy of an even map would be."""
    network: Curve
    """Of the maps themselves."""
    random: Curve
    """Of random maps."""
    centred: Curve
    """Of one that always looks at the middle."""
    cascade: tuple[float, ...]
    """Rank correlation with the maps of a network whose block, and then one stage more each time, has new weights."""


def figures(
    network: Network, examples: Examples, method: str = "hirescam", seed: int = 0, progress: Progress = silent
) -> list[Figures]:
    """One for each situation of which there are examples."""
    found = {name: chosen for name, chosen in examples.items() if chosen}
    results = []
    for k, (name, chosen) in enumerate(found.items()):
        progress(f"attention in {name}", k / len(found))
        results.append(_figures(network, name, chosen, method, seed))
    return results


def _figures(network: Network, name: str, examples: Sequence[Example], method: str, seed: int) -> Figures:
    attentions = [attend(network, example.question, example.images, method) for example in examples]
    where = [_where(example, attention) for example, attention in zip(examples, attentions, strict=True)]
    known = [one for one in where if one is not None]
    pointing, energy, area = (mean(values) for values in zip(*known, strict=True)) if known else (None, None, None)
    curves = [_curves(network, *pair, seed) for pair in zip(examples, attentions, strict=True)]
    own, random, centred = (_mean_curve([one[k] for one in curves]) for k in range(3))
    return Figures(
        situation=name, examples=len(examples), pointing=pointing, energy=energy, area=area, network=own, random=random,
        centred=centred, cascade=_cascade(network, examples, attentions, method, seed),
    )  # fmt: skip


def _where(example: Example, attention: Attention) -> tuple[float, float, float] | None:
    """Whether an example's attention points at the thing, its energy there, and how much of the image that is."""
    if example.semantics is None:
        return None
    mask = about(example.situation.affordance, example.semantics)
    if not mask.any():
        return None
    large = upsampled(attention.now, mask.shape)
    return float(points_at(large, mask)), energy_inside(large, mask), float(mask.mean())


def _curves(network: Network, example: Example, attention: Attention, seed: int) -> tuple[Curve, Curve, Curve]:
    """Of the attention, of random maps and of one of the middle, in all frames that the block looks at."""
    size = example.images[-1].shape[:2]
    rng = np.random.default_rng((seed, *example.source.encode()))  # the same maps for all would be a single control
    images = frames_at(example.images, attention.back)
    score = score_of(network, example.question, example.images)

    def on_history(changed: Sequence[Image]) -> float:
        history = list(example.images)
        for back, image in zip(attention.back, changed, strict=True):
            history[len(history) - 1 - back] = image
        return score(history)

    maps: list[list[Map]] = [
        [upsampled(one, size) for one in attention.maps],
        [random_map(one, size, rng) for one in attention.maps],
        [centred_map(size)] * len(images),
    ]
    first, second, third = (curve(images, one, on_history) for one in maps)
    return first, second, third


def _mean_curve(curves: Sequence[Curve]) -> Curve:
    return Curve(mean(one.deletion for one in curves), mean(one.insertion for one in curves))


def _cascade(
    network: Network, examples: Sequence[Example], attentions: Sequence[Attention], method: str, seed: int
) -> tuple[float, ...]:
    """Mean rank correlations with the maps of a network that forgets, from its last layer on."""
    affordance = examples[0].situation.affordance
    correlations = []
    for stages in CASCADE:
        other = randomised(network, affordance, stages, seed)
        again = [attend(other, example.question, example.images, method) for example in examples]
        correlations.append(mean(similarity(*pair) for pair in zip(attentions, again, strict=True)))
    return tuple(correlations)
