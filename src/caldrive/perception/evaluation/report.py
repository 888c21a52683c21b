"""How well a network sees: figures by command, weather and place beside the paper, confusion, and the worst frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from caldrive.affordances import BY_NAME, SPECS, AffordanceSpec
from caldrive.files import write_figure
from caldrive.perception.dataset.frames import Frames
from caldrive.perception.dataset.sampler import SIZES
from caldrive.perception.evaluation.evaluate import confusion, metrics, outputs_on
from caldrive.perception.inference.engines import Features
from caldrive.perception.network.network import COMMANDS, Network
from caldrive.perception.targets import Outputs, Targets, si_values
from caldrive.progress import Progress, silent

# Supplement, comparison of temporal and non-temporal task blocks: the better of the two.
PAPER = {
    "hazard_stop/iou": 0.8741,
    "red_light/iou": 0.9395,
    "speed_sign/iou": 0.9271,
    "vehicle_distance/mae_scaled": 0.03289,
    "relative_angle/mae_scaled": 0.00207,
    "center_distance/mae_scaled": 0.08465,
}
WORST = 4  # frames shown of each affordance
APART = 30  # moments that lie at least between two of them in an episode
TURNED = (5.0, 10.0)  # degrees; a car looks straight ahead, cameras of a recording up to 15 aside


def published_figures() -> dict[str, float]:
    """The paper's figures, all in SI units."""
    return {
        name.removesuffix("_scaled"): value * (BY_NAME[name.split("/")[0]].scale if name.endswith("_scaled") else 1.0)
        for name, value in PAPER.items()
    }


@dataclass(frozen=True)
class Report:
    """frames: how many. overall: metrics by name. groups: by command, weather, town, place, distance of the car ahead
    and how far the camera is turned, the same for each value.
    confusion: for each discrete affordance how many frames of each true class (rows) were seen as each (columns)."""

    frames: int
    overall: dict[str, float]
    groups: dict[str, dict[str, dict[str, float]]]
    confusion: dict[str, list[list[int]]]


def _part(of: Outputs | Targets, rows: NDArray[np.bool_]) -> dict[str, torch.Tensor]:
    chosen = torch.from_numpy(rows)
    return {name: value[chosen] for name, value in of.items()}


def _ranges(size: NDArray[np.float64], edges: Sequence[float], unit: str, beyond: str) -> NDArray[np.str_]:
    """Between which edges each size (N,) lies, in words that sort by it; beyond: the word for those above the last."""
    names = [f"{low:02.0f} to {high:02.0f} {unit}" for low, high in pairwise((0.0, *edges))] + [beyond]
    found: NDArray[np.str_] = np.array(names)[np.digitize(size, edges)]
    return found


def report(
    network: Network, frames: Frames, features: Features, picture: Path | None = None, progress: Progress = silent
) -> Report:
    """Runs the network over all frames. features: its backbone; picture: where to draw the worst ones (PNG)."""
    outputs, targets = outputs_on(network, frames, features, progress=progress)
    kinds: dict[str, NDArray[Any]] = {
        "command": np.array([command.value for command in COMMANDS])[frames.command],
        "weather": frames.by_episode(str(e.scenario.weather) for e in frames.episodes),
        "town": frames.by_episode(e.scenario.town for e in frames.episodes),
        "place": np.where(frames.column("junction"), "in a junction", "on a street"),
        "car ahead": _ranges(frames.column("vehicle_distance"), SIZES["vehicle_distance"], "m", "none"),
        "camera turned": _ranges(np.degrees(np.abs(frames.column("camera_yaw"))), TURNED, "°", "10 ° and more"),
    }
    groups = {
        kind: {str(v): metrics(_part(outputs, of == v), _part(targets, of == v)) for v in np.unique(of)}
        for kind, of in kinds.items()
    }
    confused = {
        spec.name: confusion(outputs[spec.name].argmax(1), targets[spec.name], spec.outputs).tolist()
        for spec in SPECS
        if spec.discrete
    }
    if picture is not None:
        draw_worst(frames, outputs, targets, picture)
    return Report(len(frames), metrics(outputs, targets), groups, confused)


def errors(spec: AffordanceSpec, outputs: Outputs, targets: Targets) -> NDArray[np.float64]:
    """How wrong each frame is (N,): in SI units, or the share of belief that the true class did not get."""
    output, target = outputs[spec.name], targets[spec.name]
    if spec.discrete:
        return np.asarray(1 - output.softmax(1).gather(1, target[:, None])[:, 0].double())
    return np.asarray((si_values(spec, output) - target * spec.scale).abs().double())


def worst(wrong: NDArray[np.float64], frames: Frames) -> list[int]:
    """The frames with the largest errors (N,), none of them a neighbour of another, seen by whichever camera."""
    chosen: list[int] = []
    for i in np.argsort(-wrong, kind="stable").tolist():
        near = (frames.episode[chosen] == frames.episode[i]) & (abs(frames.moment[chosen] - frames.moment[i]) <= APART)
        if not near.any():
            chosen.append(i)
        if len(chosen) == WORST:
            break
    return chosen


def _said(spec: AffordanceSpec, outputs: Outputs, targets: Targets, row: int) -> str:
    if spec.discrete:
        seen, true = (spec.classes[int(v)] for v in (outputs[spec.name][row].argmax(), targets[spec.name][row]))
        return f"{spec.name.replace('_', ' ')}: {seen}, really {true}"
    value = float(si_values(spec, outputs[spec.name][row : row + 1])[0])
    wanted = float(targets[spec.name][row] * spec.scale)
    return f"{spec.name.replace('_', ' ')}: {value:.2f}, really {wanted:.2f} {spec.unit}"


def draw_worst(frames: Frames, outputs: Outputs, targets: Targets, path: Path) -> None:
    """A page (PNG) with the worst frames of each affordance, what was seen and what was true."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4 * WORST, 2.1 * len(SPECS)), layout="constrained")
    axes = figure.subplots(len(SPECS), WORST, squeeze=False)
    for line, spec in zip(axes, SPECS, strict=True):
        for ax in line:
            ax.set_axis_off()
        for ax, i in zip(line, worst(errors(spec, outputs, targets), frames), strict=False):
            episode, row = frames.source(i)
            ax.imshow(episode.image(row))
            ax.set_title(f"{_said(spec, outputs, targets, i)}\n{episode.id}, row {row}", fontsize=8)
    write_figure(path, figure)
