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

from caldrive.affordances import BY_NAME, DISCRETE, SPECS, AffordanceSpec
from caldrive.files import write_figure
from caldrive.perception.dataset.frames import Frames
from caldrive.perception.dataset.sampler import SIZE_EDGES
from caldrive.perception.evaluation.evaluate import class_ious, confusion, metrics, outputs_on
from caldrive.perception.inference.engines import BackboneEngine
from caldrive.perception.network.network import COMMANDS, Network
from caldrive.perception.targets import Outputs, Targets, si_error, si_values
from caldrive.progress import Progress, silent

# Supplement, comparison of temporal and non-temporal task blocks, the better of the two: mean IoU of the discrete, mean
# absolute error in units of the scale of the continuous affordances.
PUBLISHED = {
    "hazard_stop": 0.8741,
    "red_light": 0.9395,
    "speed_sign": 0.9271,
    "vehicle_distance": 0.03289,
    "relative_angle": 0.00207,
    "center_distance": 0.08465,
}
WORST = 4  # frames shown of each affordance
APART = 30  # time steps that lie at least between two of them in an episode
YAW_EDGES = (5.0, 10.0)  # degrees; a car looks straight ahead, cameras of a recording up to 15 aside


def published_metrics() -> dict[str, float]:
    """The paper's figures as it prints them, by the names that `metrics` gives them."""
    specs = (BY_NAME[name] for name in PUBLISHED)
    return {spec.metric if spec.discrete else f"{spec.metric}_scaled": PUBLISHED[spec.name] for spec in specs}


def published_figures() -> dict[str, float]:
    """The paper's figures, all in SI units."""
    return {BY_NAME[name].metric: value * BY_NAME[name].scale for name, value in PUBLISHED.items()}


@dataclass(frozen=True)
class Report:
    """frames: how many. overall: metrics by name, None where the frames show none. groups: by command, weather, town,
    place, distance of the car ahead and how far the camera is turned, the same for each value. confusion: for each
    discrete affordance how many frames of each true class (rows) were seen as each (columns). class_iou: intersection
    over union of each class, None for one that never occurred, neither true nor seen."""

    frames: int
    overall: dict[str, float | None]
    groups: dict[str, dict[str, dict[str, float | None]]]
    confusion: dict[str, list[list[int]]]
    class_iou: dict[str, list[float | None]]


def report(
    network: Network, frames: Frames, backbone: BackboneEngine, picture: Path | None = None, progress: Progress = silent
) -> Report:
    """Runs the network over all frames. backbone: its own, in some precision; picture: where to draw the worst ones
    (PNG)."""
    outputs, targets = outputs_on(network, frames, backbone, progress=progress)
    groups = {}
    for name, labels in _group_labels(frames).items():
        rows = {str(label): labels == label for label in np.unique(labels)}
        groups[name] = {label: metrics(_part(outputs, row), _part(targets, row)) for label, row in rows.items()}
    confusions = {
        spec.name: confusion(outputs[spec.name].argmax(1), targets[spec.name], spec.outputs) for spec in DISCRETE
    }
    if picture is not None:
        draw_worst(frames, outputs, targets, picture)
    return Report(
        frames=len(frames),
        overall=metrics(outputs, targets),
        groups=groups,
        confusion={name: counts.tolist() for name, counts in confusions.items()},
        class_iou={name: class_ious(counts) for name, counts in confusions.items()},
    )


def _group_labels(frames: Frames) -> dict[str, NDArray[Any]]:
    """For each way to group frames the label of each frame (N,)."""
    yaw, distance = np.degrees(np.abs(frames.column("camera_yaw"))), frames.column("vehicle_distance")
    return {
        "command": np.array([command.value for command in COMMANDS])[frames.command],
        "weather": frames.by_episode(str(episode.scenario.weather) for episode in frames.episodes),
        "town": frames.by_episode(episode.scenario.town for episode in frames.episodes),
        "place": np.where(frames.column("junction"), "in a junction", "on a street"),
        "car ahead": _ranges(distance, SIZE_EDGES["vehicle_distance"], unit="m", beyond="none"),
        "camera turned": _ranges(yaw, YAW_EDGES, unit="°", beyond="10 ° and more"),
    }


def _ranges(size: NDArray[np.float64], edges: Sequence[float], unit: str, beyond: str) -> NDArray[np.str_]:
    """Between which edges each size (N,) lies, in words that sort by it; beyond: the word for those above the last."""
    words = [f"{low:02.0f} to {high:02.0f} {unit}" for low, high in pairwise((0.0, *edges))] + [beyond]
    labels: NDArray[np.str_] = np.array(words)[np.digitize(size, edges)]
    return labels


def _part(by_name: Outputs | Targets, rows: NDArray[np.bool_]) -> dict[str, torch.Tensor]:
    mask = torch.from_numpy(rows)
    return {name: values[mask] for name, values in by_name.items()}


def errors(spec: AffordanceSpec, outputs: Outputs, targets: Targets) -> NDArray[np.float64]:
    """How wrong each frame is (N,): in SI units, or the share of belief that the true class did not get."""
    output, target = outputs[spec.name], targets[spec.name]
    if spec.discrete:
        return np.asarray(1 - output.softmax(1).gather(1, target[:, None])[:, 0].double())
    return np.asarray(si_error(spec, output, target).double())


def worst(error: NDArray[np.float64], frames: Frames) -> list[int]:
    """The frames with the largest errors (N,), none of them a neighbour of another, seen by whichever camera."""
    chosen: list[int] = []
    for i in np.argsort(-error, kind="stable").tolist():
        same_episode = frames.episode[chosen] == frames.episode[i]
        if not (same_episode & (abs(frames.time_step[chosen] - frames.time_step[i]) <= APART)).any():
            chosen.append(i)
        if len(chosen) == WORST:
            break
    return chosen


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
            ax.set_title(f"{_seen_and_true(spec, outputs, targets, i)}\n{episode.id}, row {row}", fontsize=8)
    write_figure(path, figure)


def _seen_and_true(spec: AffordanceSpec, outputs: Outputs, targets: Targets, row: int) -> str:
    if spec.discrete:
        seen, true = (spec.classes[int(v)] for v in (outputs[spec.name][row].argmax(), targets[spec.name][row]))
        return f"{spec.title}: {seen}, really {true}"
    value = float(si_values(spec, outputs[spec.name][row : row + 1])[0])
    label = float(targets[spec.name][row] * spec.scale)
    return f"{spec.title}: {value:.2f}, really {label:.2f} {spec.unit}"
