"""The training loop (section 3.1). What a step draws depends on (seed, step) only: a run killed anywhere resumes to the
same weights."""

from __future__ import annotations

import copy
import json
import math
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import torch
from rich.progress import MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from torch import Tensor
from torch.optim import Adam

from caldrive.config import PerceptionConfig, TrainingConfig
from caldrive.files import write_whole
from caldrive.perception.checkpoint import (
    CheckpointError,
    CheckpointInfo,
    read_tensors,
    round_to_half,
    save_network,
    write_tensors,
)
from caldrive.perception.curves import draw_curves
from caldrive.perception.dataset import Frames, Sampler, find_episodes, split, summary
from caldrive.perception.evaluation import autocast, evaluate, outputs_of
from caldrive.perception.images import augment, normalise, to_float
from caldrive.perception.network import Network
from caldrive.perception.specs import ClassWeights, class_weights, loss

Row = dict[str, float]


def learning_rate(step: int, config: TrainingConfig) -> float:
    """Rate of a step: a straight warm-up, then a cosine down to final_rate of the base rate."""
    if step < config.warm_up:
        return config.learning_rate * (step + 1) / config.warm_up
    done = (step - config.warm_up) / max(1, config.steps - config.warm_up)
    share = config.final_rate + (1 - config.final_rate) * (1 + math.cos(math.pi * done)) / 2
    return config.learning_rate * share


@dataclass
class Run:
    """A training run: what changes from step to step, and what is needed to change it."""

    config: TrainingConfig
    network: Network
    optimizer: Adam
    sampler: Sampler
    weights: ClassWeights
    step: int = 0

    def advance(self) -> float:
        """One step; returns its loss."""
        config, device, network = self.config, self.config.device, self.network
        generator = torch.Generator().manual_seed(config.seed * 1_000_003 + self.step)
        torch.manual_seed(config.seed * 1_000_003 + self.step)  # dropout
        batch = self.sampler.frames.batch(self.sampler.draw(self.step, config.batch), config.window, network.span - 1)
        images = to_float(batch.images)
        images = normalise(augment(images, generator, batch.group) if config.augment else images)
        targets = {name: target.to(device) for name, target in batch.targets.items()}
        for group in self.optimizer.param_groups:
            group["lr"] = learning_rate(self.step, config)
        network.train()
        with autocast(config.precision, device):
            outputs = outputs_of(network, batch, images, device)
        total = loss(outputs, targets, self.weights)
        self.optimizer.zero_grad(set_to_none=True)
        total.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(network.parameters(), config.clip)
        self.optimizer.step()
        self.step += 1
        return float(total.detach())

    def save(self, path: Path) -> None:
        """Write all that the next step depends on."""
        tensors = {f"network.{name}": value for name, value in self.network.state_dict().items()}
        for number, state in self.optimizer.state_dict()["state"].items():
            tensors |= {f"optimizer.{number}.{name}": value for name, value in state.items()}
        header = {"step": self.step, "config": asdict(self.network.config), "training": asdict(self.config)}
        write_tensors(path, tensors, {"kind": "training"} | header)

    def restore(self, path: Path) -> None:
        """Take up where `save` left off. Raises CheckpointError where the file belongs to another run."""
        tensors, header = read_tensors(path)
        if (header.get("config"), header.get("training")) != (asdict(self.network.config), asdict(self.config)):
            raise CheckpointError(
                f"{path} belongs to a run with other settings: give another folder or remove this one"
            )
        network = {k.removeprefix("network."): v for k, v in tensors.items() if k.startswith("network.")}
        self.network.load_state_dict(network)
        states: dict[int, dict[str, Tensor]] = {}
        for name, value in tensors.items():
            if name.startswith("optimizer."):
                _, number, part = name.split(".")
                states.setdefault(int(number), {})[part] = value
        groups = self.optimizer.state_dict()["param_groups"]
        self.optimizer.load_state_dict({"state": states, "param_groups": groups})
        self.step = int(header["step"])


def _start(config: TrainingConfig, perception: PerceptionConfig, frames: Frames, imagenet: Path | None) -> Run:
    torch.manual_seed(config.seed)
    network = Network(perception)
    if imagenet is not None:
        network.backbone.load_imagenet(imagenet)
    network = network.to(config.device)
    sampler = Sampler(frames, config.window, config.balance, config.seed)
    weights = {name: weight.to(config.device) for name, weight in class_weights(sampler.class_counts()).items()}
    return Run(config, network, Adam(network.parameters(), config.learning_rate), sampler, weights)


def calibrated(run: Run) -> Network:
    """A copy of the network whose probabilities are those of the recording.

    Weighted and balanced, training sees rare classes as often as the others, and so the network expects them. Moving
    each class's last bias by the logarithm of (its share of the frames / its share of the loss) takes that back; about,
    as frames are drawn by the rarest of their labels, not by each.
    """
    network = copy.deepcopy(run.network)
    drawn = run.sampler.class_counts()
    for name, weight in run.weights.items():
        count = torch.bincount(run.sampler.frames.targets[name], minlength=len(weight)).double()
        weighted = weight.cpu().double() * torch.from_numpy(drawn[name])
        shift = (count / weighted).nan_to_num(0.0).clamp(min=1e-9).log()  # what never occurs is not expected
        bias = network.get_parameter(f"blocks.{name}.groups.0.output.bias")
        bias.data += (shift - shift[0]).to(run.config.device)
    return network


def _validate(run: Run, held: Frames, model: Path) -> Row:
    """Write the network as it is, in 16 bits, with its validation metrics, and return them as `validation/<name>`."""
    network = calibrated(run)
    round_to_half(network)
    found = evaluate(network, held, run.config.precision, run.config.device)
    data = summary(run.sampler.frames, held)
    save_network(
        model, network, CheckpointInfo(network.config, data, found, asdict(run.config), run.config.seed), half=True
    )
    return {f"validation/{name}": value for name, value in found.items()}


def _kept_rows(path: Path, step: int) -> list[Row]:
    """Rows of the metrics that a resumed run will not write again."""
    rows = [json.loads(line) for line in path.read_text().splitlines()] if path.is_file() else []
    return [row for row in rows if row["step"] <= step]


def train(
    config: TrainingConfig,
    data: Path | str,
    out: Path | str,
    perception: PerceptionConfig | None = None,
    imagenet: Path | None = None,
    progress: bool = True,
    stop: Callable[[int], bool] = lambda step: False,
) -> Path:
    """Train a network on the episodes in `data`, and return the finished one's path, `out`/model.safetensors.

    In `out` lie also state.safetensors, from which the same call resumes, and metrics.jsonl: a row a step with its
    loss, and validation metrics every `evaluate_every` steps and at the end; curves.png draws them. `stop` may end the
    run early after a step.
    """
    out, perception = Path(out), perception or PerceptionConfig()
    size = (perception.image_height, perception.image_width)
    train_episodes, held_episodes = split(find_episodes(data), config.validation_share, config.seed)
    frames, held = Frames(train_episodes, size, config.cache_gb), Frames(held_episodes, size)
    run = _start(config, perception, frames, imagenet)
    model, state, log = out / "model.safetensors", out / "state.safetensors", out / "metrics.jsonl"
    if state.is_file():
        run.restore(state)
    rows = _kept_rows(log, run.step)
    columns = (MofNCompleteColumn(), TimeRemainingColumn(), TextColumn("{task.fields[note]}"))
    with Progress(*columns, disable=not progress) as bar:
        task = bar.add_task("training", total=config.steps, completed=run.step, note="")
        while run.step < config.steps and not stop(run.step):
            began = time.perf_counter()
            row: Row = {"step": run.step + 1, "rate": learning_rate(run.step, config), "loss": run.advance()}
            row["windows_per_s"] = config.batch / (time.perf_counter() - began)
            last = run.step == config.steps
            if last or run.step % config.evaluate_every == 0:
                row |= _validate(run, held, model)
                draw_curves([*rows, row], out / "curves.png")
            rows.append(row)
            if last or run.step % config.save_every == 0:
                write_whole(log, "".join(json.dumps(r) + "\n" for r in rows).encode())
                run.save(state)
            bar.update(task, completed=run.step, note=f"loss {row['loss']:.3f}")
    return model
