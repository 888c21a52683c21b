"""How blocks learn from stored features, alone or together, and how well they do: mean IoU, or mean absolute error."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

import torch
from torch import Tensor, nn
from torch.optim import Adam

from caldrive.affordances import BY_NAME
from caldrive.checks import MOST_SEED
from caldrive.perception.dataset.frames import Ids
from caldrive.perception.dataset.sampler import Sampler
from caldrive.perception.evaluation.evaluate import mean_iou
from caldrive.perception.network.calibration import prior
from caldrive.perception.network.config import BlockConfig
from caldrive.perception.network.network import TaskBlock
from caldrive.perception.targets import class_weights, multitask_loss, si_error
from caldrive.perception.training.config import TrainingConfig
from caldrive.perception.training.loop import finite
from caldrive.perception.training.run import SEED_STRIDE, gradient_step, learning_rate
from caldrive.search.config import SearchConfig
from caldrive.search.examples import Examples

FRAMES_A_PASS = 512
WARM_UP = 0.05  # share of the steps in which the rate rises
SEARCH_STRIDE = 1_000_003  # more than a search has trainings, so that those of two searches have different seeds


def training_seed(seed: int, number: int) -> int:
    """The seed of a search's training by its number; seed: the search's."""
    return (seed * SEARCH_STRIDE + number) % (MOST_SEED + 1)


def training_config(config: SearchConfig, seed: int, steps: int | None = None) -> TrainingConfig:
    """How blocks learn: as `caldrive train` lets them, but for what a search says. seed: of this training."""
    steps = steps or config.steps
    return TrainingConfig(
        steps=steps, batch=config.batch, learning_rate=config.learning_rate, warm_up=round(WARM_UP * steps),
        history_steps=0, seed=seed,
    )  # fmt: skip


def learn(
    blocks: Mapping[str, TaskBlock], examples: Examples, config: TrainingConfig, starts: Ids | None = None
) -> Iterator[float]:
    """Trains blocks by their affordance; yields each step's loss, their losses' sum. starts: the frames that they learn
    from; without it all of them."""
    sampler = Sampler(examples.frames, 1, config.balance, config.seed, starts)
    weights, together = class_weights(sampler.class_counts()), nn.ModuleDict(dict(blocks))
    optimizer = Adam(together.parameters(), config.learning_rate, config.betas)
    for step in range(config.steps):
        together.train()
        torch.manual_seed(config.seed * SEED_STRIDE + step)  # dropout
        ids = sampler.draw(step, config.batch)
        alternatives = sampler.alternatives(step, config.batch, config.alternative_share)
        command, targets = examples.frames.commands_and_targets(ids[:, None], alternatives)
        outputs = {
            name: block.decide(examples.sequences(ids, block.config), command[:, 0]) for name, block in blocks.items()
        }
        loss = multitask_loss(outputs, targets, weights)
        gradient_step(optimizer, loss, learning_rate(step, config.steps, config), config.clip)
        yield float(loss.detach())


def measured_training(
    task: str, block: BlockConfig, examples: tuple[Examples, Examples], ids: Ids, config: SearchConfig, seed: int
) -> Iterator[tuple[int, float]]:
    """Trains one block; yields steps, and its score after them on some frames (N,) of those that validate. examples:
    those that train, and those that validate; seed: of this training."""
    training, validation = examples
    torch.manual_seed(seed)
    learner = TaskBlock(block, BY_NAME[task], training.features.shape[1])
    target = validation.frames.targets[task][torch.from_numpy(ids)]
    counts = class_counts(task, training, training.targets)
    when = {evaluation_step(config, k + 1) for k in range(config.evaluations)}
    losses = learn({task: learner}, training, training_config(config, seed), training.targets)
    for step, loss in enumerate(losses, start=1):
        finite(loss, step)
        if step in when:
            value = score(task, outputs_of(learner, validation, ids), target, counts)
            assert value is not None, "make_features has looked at the frames"
            yield step, value


def evaluation_step(config: SearchConfig, k: int) -> int:
    """After how many steps a trial is measured the k-th time."""
    return round(config.steps * k / config.evaluations)


@torch.no_grad()
def outputs_of(block: TaskBlock, examples: Examples, ids: Ids) -> Tensor:
    """A block's outputs (N, K) at frames (N,), under the command that was driven."""
    block.eval()
    parts = (ids[k : k + FRAMES_A_PASS] for k in range(0, len(ids), FRAMES_A_PASS))
    commands = examples.frames.command
    return torch.cat([
        block.decide(examples.sequences(part, block.config), torch.from_numpy(commands[part])) for part in parts
    ])  # fmt: skip


def class_counts(task: str, examples: Examples, ids: Ids) -> list[int]:
    """Frames of each class (K,) of a discrete affordance among some (N,); none for a continuous one."""
    spec = BY_NAME[task]
    if not spec.discrete:
        return []
    counts: list[int] = torch.bincount(
        examples.frames.targets[task][torch.from_numpy(ids)], minlength=spec.outputs
    ).tolist()
    return counts


def score(task: str, output: Tensor, target: Tensor, counts: Sequence[int] = ()) -> float | None:
    """How well outputs (N, K) fit targets (N,): mean IoU of a discrete affordance, mean absolute error of a continuous
    one in units of its scale, as the supplement has them. counts: frames of each class that trained, for outputs that
    are not calibrated yet; classes weigh alike in the loss. None where the frames show nothing."""
    spec = BY_NAME[task]
    if not spec.discrete:
        return float(si_error(spec, output, target).mean()) / spec.scale
    logits = output + prior(counts) if counts else output
    return mean_iou(logits.argmax(1), target, spec.outputs)


@contextmanager
def one_thread() -> Iterator[None]:
    """torch computes in one thread: several processes share the processor out, and sums do not depend on how many."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
