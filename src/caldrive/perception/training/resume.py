"""A training under way on disk: all that its next step depends on, as tensors with a JSON header."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, TypedDict

from torch import Tensor, nn
from torch.optim import Optimizer

from caldrive.files import as_type
from caldrive.perception.network.tensor_file import CheckpointError, read_tensors, write_tensors
from caldrive.perception.training.run import TrainingRun

KIND = "training"
MODEL, OPTIMIZER = "model.", "optimizer."  # what the tensors' names begin with
ADAM = {"step", "exp_avg", "exp_avg_sq"}  # what it keeps of a parameter
# Settings that may change while a training is under way: its weights no longer depend on them.
FREE = ("initial", "imagenet", "evaluate_every", "save_every", "cache_gb", "device")


class Header(TypedDict):
    """What a training's state says of itself. training, network: its settings; episodes: digest of what it learns from;
    processes: how many share the work."""

    step: int
    network: dict[str, Any]
    training: dict[str, Any]
    episodes: str
    processes: int


def save_state(path: Path, run: TrainingRun) -> None:
    """Write a run as it is between two steps."""
    tensors = run_tensors(run.learner.model, run.optimizer)
    header: Header = {
        "step": run.step, "network": dict(run.learner.network_settings), "training": asdict(run.config),
        "episodes": run.learner.data_digest, "processes": run.group.size,
    }  # fmt: skip
    write_tensors(path, tensors, {"kind": KIND} | header)


def restore_state(path: Path, run: TrainingRun) -> None:
    """Take up in a new run what `save_state` left. Raises CheckpointError where the file is damaged, or belongs to
    another run."""
    tensors, values = read_tensors(path)
    if values.get("kind") != KIND:
        raise CheckpointError(f"found in {path} a {values.get('kind')}, wanted a training's state: give another --out")
    try:
        header = as_type(values, Header)
        if difference := _difference(run, tensors, header):
            raise CheckpointError(f"found in {path} a run {difference}")
        if not 0 <= header["step"] <= run.learner.steps:
            raise ValueError(f"step {header['step']} of {run.learner.steps}")
        _restore(run, tensors, header)
    except CheckpointError:
        raise
    except (KeyError, ValueError, TypeError, RuntimeError) as error:
        raise CheckpointError(
            f"found that {path} is damaged ({error}), wanted a training's state: remove it, and train again"
        ) from error


def _difference(run: TrainingRun, tensors: dict[str, Tensor], header: Header) -> str:
    """How the run of a state differs from this one, and what to type; nothing where it does not."""
    saved = _decisive(header["training"], header["network"])
    for name, wanted in _decisive(_plain(asdict(run.config)), _plain(run.learner.network_settings)).items():
        if saved.get(name) != wanted:
            return f"with {name} {saved.get(name)}, wanted {wanted}: type the same settings, or another --out"
    if _without_prefix(MODEL, tensors).keys() != run.learner.model.state_dict().keys():
        return (
            "with other tasks, wanted the same, with or without semantic images: type the --data that it began with, "
            "or another --out"
        )
    if header["episodes"] != run.learner.data_digest:
        return "on other episodes, wanted the same: type the --data that it began with, or another --out"
    if header["processes"] != run.group.size:
        return f"of {header['processes']} processes, wanted {run.group.size}: start as many"
    return ""


def _decisive(training: dict[str, Any], network: dict[str, Any]) -> dict[str, Any]:
    """The settings on which a run's weights depend once it has begun, nested ones by names as on the command line."""
    return _flat({name: value for name, value in training.items() if name not in FREE} | {"network": network})


def _plain(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings as they come back from JSON, where a tuple is a list."""
    plain: dict[str, Any] = json.loads(json.dumps(dict(settings)))
    return plain


def _flat(settings: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested settings side by side: {"a": {"b": 1}} as {"a.b": 1}."""
    flat: dict[str, Any] = {}
    for name, value in settings.items():
        flat |= _flat(value, f"{prefix}{name}.") if isinstance(value, dict) else {prefix + name: value}
    return flat


def run_tensors(model: nn.Module, optimizer: Optimizer) -> dict[str, Tensor]:
    """The tensors of a model and of its optimizer, by names that `restore_run` knows."""
    tensors = {f"{MODEL}{name}": value for name, value in model.state_dict().items()}
    for number, moments in optimizer.state_dict()["state"].items():
        tensors |= {f"{OPTIMIZER}{number}.{name}": value for name, value in moments.items()}
    return tensors


def restore_run(tensors: dict[str, Tensor], model: nn.Module, optimizer: Optimizer, *, has_learnt: bool) -> None:
    """The inverse of `run_tensors`. has_learnt: whether a step was done. Raises ValueError where Adam's moments are not
    whole, RuntimeError where the tensors are another model's."""
    model.load_state_dict(_without_prefix(MODEL, tensors))
    moments: dict[int, dict[str, Tensor]] = {}  # of each parameter
    for path, value in _without_prefix(OPTIMIZER, tensors).items():
        number, name = path.split(".")
        moments.setdefault(int(number), {})[name] = value
    whole = all(values.keys() == ADAM for values in moments.values())
    if not whole or (has_learnt and not moments):
        raise ValueError("without all of the optimizer's tensors")
    groups = optimizer.state_dict()["param_groups"]
    optimizer.load_state_dict({"state": moments, "param_groups": groups})


def _without_prefix(prefix: str, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    """Those whose names begin with a prefix, without it."""
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}


def _restore(run: TrainingRun, tensors: dict[str, Tensor], header: Header) -> None:
    restore_run(tensors, run.learner.model, run.optimizer, has_learnt=header["step"] > 0)
    began = {name: header["training"][name] for name in ("initial", "imagenet") if name in header["training"]}
    run.learner.config = replace(run.learner.config, **began)  # with what it really began
    run.step = header["step"]
