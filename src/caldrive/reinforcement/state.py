"""A training under way on disk: all that its next update depends on, as tensors with a JSON header."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
from torch import Tensor

from caldrive.agents.rows import model_path
from caldrive.files import as_type, read_json
from caldrive.perception.network.tensor_file import CheckpointError, read_tensors, write_tensors
from caldrive.perception.training.resume import restore_run, run_tensors
from caldrive.provenance import file_digest
from caldrive.reinforcement.config import ReinforcementConfig
from caldrive.reinforcement.run import LearningRun

KIND = "reinforcement training"
FREE = ("checkpoints", "device", "processes", "perception", "encoder")  # of the settings; files count by their digests


class Header(TypedDict):
    """What a training's state says of itself. training: its settings; files: digests of the networks that it sees by;
    level, recent: of the curriculum; mean, variance, count: of the discounted rewards, by which they are scaled."""

    update: int
    training: dict[str, Any]
    files: dict[str, str]
    level: int
    recent: list[bool]
    mean: float
    variance: float
    count: float


def save_state(path: Path, run: LearningRun) -> None:
    """Write a run as it is at a save point."""
    policy = run.learning_policy
    tensors = run_tensors(policy, policy.optimizer)
    scale = run.env.ret_rms
    header: Header = {
        "update": run.update, "training": plain_settings(run.config), "files": digests(run.config),
        "level": run.curriculum.level, "recent": run.curriculum.recent,
        "mean": float(scale.mean), "variance": float(scale.var), "count": float(scale.count),
    }  # fmt: skip
    write_tensors(path, tensors, {"kind": KIND} | header)


def restore_state(path: Path, run: LearningRun) -> None:
    """Take up in a new run what `save_state` left. Raises CheckpointError where the file is damaged, or belongs to
    another run."""
    tensors, values = read_tensors(path)
    if values.get("kind") != KIND:
        raise CheckpointError(f"found in {path} a {values.get('kind')}, wanted a {KIND}: give another --out")
    try:
        header = as_type({name: values[name] for name in Header.__annotations__}, Header)
        if difference := _difference(run.config, header):
            raise CheckpointError(f"found in {path} a run {difference}")
        _restore(run, tensors, header)
    except CheckpointError:
        raise
    except (KeyError, ValueError, TypeError, RuntimeError) as error:
        raise CheckpointError(
            f"found that {path} is damaged ({error}), wanted a training's state: remove it, and train again"
        ) from error


def plain_settings(config: ReinforcementConfig) -> dict[str, Any]:
    """The settings in JSON's types; of a file its name only, not whose folders."""
    settings = {name: value.name if isinstance(value, Path) else value for name, value in asdict(config).items()}
    return read_json(json.dumps(settings), dict[str, Any])


def digests(config: ReinforcementConfig) -> dict[str, str]:
    """Of the networks that a training sees by, by their setting."""
    files = {}
    if config.sees == "features":
        files["encoder"] = model_path(config.encoder, "mp", "--encoder")
    if config.sees == "affordances" and config.affordances == "predicted":
        files["perception"] = model_path(config.perception, option="--perception")
    return {name: file_digest(path) for name, path in files.items()}


def _difference(config: ReinforcementConfig, header: Header) -> str:
    """How the run of a state differs from this one, and what to type; nothing where it does not."""
    saved, wanted = header["training"], plain_settings(config)
    for name in wanted.keys() - set(FREE):
        if saved.get(name) != wanted[name]:
            return f"with {name} {saved.get(name)}, wanted {wanted[name]}: type the same settings, or another --out"
    if header["files"] != digests(config):
        return "that sees by other networks, wanted the same: give the files that it began with, or another --out"
    return ""


def _restore(run: LearningRun, tensors: dict[str, Tensor], header: Header) -> None:
    if not 0 <= header["update"] <= run.config.updates:
        raise ValueError(f"update {header['update']} of {run.config.updates}")
    if not 0 <= header["level"] < len(run.config.tasks):
        raise ValueError(f"task {header['level']} of {len(run.config.tasks)}")
    policy = run.learning_policy
    restore_run(tensors, policy, policy.optimizer, has_learnt=header["update"] > 0)
    run.update = header["update"]
    run.curriculum.level, run.curriculum.recent = header["level"], header["recent"]
    scale = run.env.ret_rms
    scale.mean, scale.var = np.array(header["mean"]), np.array(header["variance"])
    scale.count = header["count"]
