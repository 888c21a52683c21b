"""The task blocks through OpenVINO, in 32 bits: the same values as torch's, in a third of the time."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from caldrive.perception.graphs import compiled, constant, normalised, ops
from caldrive.perception.network import COMMANDS, Network, NodeGroup, TaskBlock

LAYERS = ("dense", "tconv")  # those that have a graph here


def _linear(x: Any, layer: nn.Module) -> Any:
    assert isinstance(layer, nn.Linear)
    return ops.add(ops.matmul(x, constant(layer.weight), False, True), constant(layer.bias, 1, -1))


def _taken(sequence: Any, rows: list[int]) -> Any:
    """These rows of a sequence (T, F)."""
    return ops.gather(sequence, ops.constant(np.array(rows)), ops.constant(0))


def _outputs(sequence: Any, block: TaskBlock, group: NodeGroup, span: int) -> Any:
    """A group of nodes of a block, from the last `span` frames' features (span, F) to its outputs (1, K)."""
    config, steps = block.config, group.steps
    frames = [span - 1 - config.dilation * back for back in range(config.length - 1, -1, -1)]
    under = [_taken(sequence, frames[k : len(frames) - steps + 1 + k]) for k in range(steps)]
    if group.kind == "tconv":  # each feature's values lie side by side
        under = [ops.transpose(one, ops.constant([1, 0])) for one in under]
    rows = ops.concat([ops.reshape(one, ops.constant([1, -1]), False) for one in under], 0)
    hidden = ops.relu(normalised(_linear(rows, group.layer), group.norm, 1, -1))  # (steps, nodes)
    flat = ops.reshape(ops.transpose(hidden, ops.constant([1, 0])), ops.constant([1, -1]), False)
    return _linear(flat, group.output)


class BlockGraphs:
    """The blocks of a trained network at the wheel; for each command a graph with the groups that are active then.

    threads: how many it may use. Raises ValueError for a block that has no graph here, see `LAYERS`.
    """

    def __init__(self, network: Network, threads: int) -> None:
        blocks = network.task_blocks()
        if others := {block.config.layer for block in blocks.values()} - set(LAYERS):
            raise ValueError(f"found task blocks of {', '.join(sorted(others))}, wanted {' or '.join(LAYERS)}")
        self._names = list(blocks)
        self._requests = [self._compiled(network, command, threads) for command in range(len(COMMANDS))]

    @staticmethod
    def _compiled(network: Network, command: int, threads: int) -> Any:
        size = network.config.image_height, network.config.image_width
        sequence = ops.parameter([network.span, network.backbone.n_features(*size)], np.float32)
        blocks = network.task_blocks().values()
        return compiled(
            [_outputs(sequence, block, block.group(command), network.span) for block in blocks], sequence, threads
        )

    def __call__(self, history: Tensor, command: Tensor) -> dict[str, Tensor]:
        """Features (1, span, F) and a command (1,) to outputs (1, K), as the network does."""
        found = self._requests[int(command[0])].infer([history[0].contiguous().numpy()], share_inputs=True)
        return {name: torch.from_numpy(found[k].copy()) for k, name in enumerate(self._names)}
