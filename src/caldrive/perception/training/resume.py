"""A training under way on disk: all that its next step depends on, as tensors with a JSON header."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, TypedDict

from torch import Tensor

from caldrive.files import as_type
from caldrive.perception.network.checkpoint import CheckpointError, read_tensors, write_tensors
from caldrive.perception.training.run import TrainingRun

KIND = "training"
ADAM = {"step", "exp_avg", "exp_avg_sq"}  # what it knows of a parameter
FREE = ("initial", "evaluate_every", "save_every", "cache_gb", "device")  # may change while a training is under way


class Header(TypedDict):
    """What a training's state says of itself. training, config: settings of the training and of the network; episodes:
    digest of the recording; processes: of the team."""

    step: int
    config: dict[str, Any]
    training: dict[str, Any]
    episodes: str
    processes: int


def _decisive(settings: dict[str, Any]) -> dict[str, Any]:
    """Those of a training's settings on which its weights depend once it has begun."""
    return {name: value for name, value in settings.items() if name not in FREE}


def _under(prefix: str, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    """Those whose names begin with a prefix, without it."""
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}


def save_state(path: Path, run: TrainingRun) -> None:
    """Write a run as it is between two steps."""
    tensors = {f"lessons.{name}": value for name, value in run.lessons.state_dict().items()}
    for number, state in run.optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer.{number}.{name}": value for name, value in state.items()}
    header: Header = {
        "step": run.step, "config": asdict(run.network.config), "training": asdict(run.config),
        "episodes": run.sampler.frames.digest, "processes": run.team.size,
    }  # fmt: skip
    write_tensors(path, tensors, {"kind": KIND} | header)


def restore_state(path: Path, run: TrainingRun) -> None:
    """Take up in a new run what `save_state` left. Raises CheckpointError where the file is damaged, or belongs to
    another run."""
    tensors, header = read_tensors(path)
    if header.get("kind") != KIND:
        raise CheckpointError(f"{path} is no training's state, but a {header.get('kind')}: give another --out")
    try:
        known = as_type(header, Header)
        if wrong := _of_another(run, tensors, known):
            raise CheckpointError(f"{path} belongs to a run {wrong}")
        if not 0 <= known["step"] <= run.config.steps:
            raise ValueError(f"step {known['step']} of {run.config.steps}")
        _take(run, tensors, known)
    except CheckpointError:
        raise
    except (KeyError, ValueError, TypeError, RuntimeError) as error:
        raise CheckpointError(f"{path} is damaged ({error}): remove it and train anew") from error


def _of_another(run: TrainingRun, tensors: dict[str, Tensor], header: Header) -> str:
    """What tells the run of a state from this one, and what to type; nothing where they are one."""
    found = _decisive(header["training"]) | header["config"]
    for name, wanted in (_decisive(asdict(run.config)) | asdict(run.network.config)).items():
        if found.get(name) != wanted:
            return f"with {name} {found.get(name)}, wanted {wanted}: give another --out"
    if _under("lessons.", tensors).keys() != run.lessons.state_dict().keys():
        recording = "with other lessons, as on a recording with or without semantic images"
        return f"{recording}: give the same --data or another --out"
    if header["episodes"] != run.sampler.frames.digest:
        return "on other episodes: give the --data that it began with, or another --out"
    if header["processes"] != run.team.size:
        return f"of {header['processes']} processes, found {run.team.size}: start as many"
    return ""


def _take(run: TrainingRun, tensors: dict[str, Tensor], header: Header) -> None:
    run.lessons.load_state_dict(_under("lessons.", tensors))
    run.config = replace(run.config, initial=header["training"]["initial"])
    states: dict[int, dict[str, Tensor]] = {}
    for path, value in _under("optimizer.", tensors).items():
        number, name = path.split(".")
        states.setdefault(int(number), {})[name] = value
    whole = all(state.keys() == ADAM for state in states.values())
    if not whole or (header["step"] and not states):
        raise ValueError("without all of the optimizer's tensors")
    groups = run.optimizer.state_dict()["param_groups"]
    run.optimizer.load_state_dict({"state": states, "param_groups": groups})
    run.step = header["step"]
