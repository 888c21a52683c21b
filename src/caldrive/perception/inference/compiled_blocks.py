"""The task blocks of a finished network when driving, as one compiled loop over their weights.

A frame passes 1.2 million weights and each of them once to three times, so that the time goes into fetching them: in
bfloat16 they are half as many bytes as in 32 bits, and nearly half of the time is saved (one frame of the network that
ships, weights not in the cache: 0.6 ms, through OpenVINO 1.0 ms, on an AMD EPYC with AVX2).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from torch import nn

from caldrive.compiled import Floats, Integers, compiled, f32, inlined
from caldrive.perception.network.network import COMMANDS, Network, NodeGroup, TaskBlock

LAYERS = ("dense", "tconv")  # those that pass here
ROWS = 4  # features whose weights are added in one go


class Group(NamedTuple):
    """A group of nodes. Batch norm is part of its weights."""

    frames: Integers
    """The frame of the history that each tap sees at each step (steps, taps)."""
    weights: NDArray[np.uint16]
    """The upper half of floats of 32 bits (taps, features, nodes); the features are filled up to whole ROWS."""
    bias: Floats
    """(nodes,)"""
    gain: Floats
    """Of layer norm (nodes,)."""
    shift: Floats
    """Of layer norm (nodes,)."""
    epsilon: np.float32
    """Of layer norm; negative where there is none."""
    output: Floats
    """The output nodes' weights (outputs, nodes, steps)."""
    output_bias: Floats
    """(outputs,)"""


class CompiledBlocks:
    """The task blocks of a trained network when driving. Raises ValueError for a block that does not pass here, see
    `passes`."""

    def __init__(self, network: Network) -> None:
        blocks = network.task_blocks()
        if unknown := {block.config.layer for block in blocks.values()} - set(LAYERS):
            layers = ", ".join(sorted(unknown))
            raise ValueError(f"found task blocks of {layers}, wanted {' or '.join(LAYERS)}: type --precision fp32")
        if not all(map(passes, blocks.values())):
            raise ValueError("found task blocks without groups for the commands, wanted groups: type --precision fp32")
        self._groups = [
            {name: _group(block, block.group(command), network.span) for name, block in blocks.items()}
            for command in range(len(COMMANDS))
        ]

    def __call__(self, history: Floats, command: int) -> dict[str, Floats]:
        """Features (span, F) and a command's number to outputs (1, K), as the network gives them."""
        outputs = {}
        for name, group in self._groups[command].items():
            hidden = np.empty((len(group.frames), len(group.bias)), np.float32)
            outputs[name] = np.empty((1, len(group.output)), np.float32)
            _pass(history, group, hidden, outputs[name][0])
        return outputs


def passes(block: TaskBlock) -> bool:
    """Whether the compiled loop has what a block is built from."""
    return block.config.layer in LAYERS and block.conditioning in ("groups", None)


def _group(block: TaskBlock, group: NodeGroup, span: int) -> Group:
    config, steps = block.config, group.steps
    taps, nodes = config.length - steps + 1, config.nodes
    seen = span - 1 - config.dilation * np.arange(config.length - 1, -1, -1)
    assert isinstance(group.layer, nn.Linear)
    weights, bias = _values(group.layer)
    if group.kind == "tconv":  # a feature's taps lie side by side
        weights = weights.reshape(nodes, -1, taps).transpose(2, 1, 0)
    else:
        weights = weights.reshape(nodes, taps, -1).transpose(1, 2, 0)
    gain, shift, epsilon = np.ones(nodes, np.float32), np.zeros(nodes, np.float32), -1.0
    if isinstance(group.norm, nn.BatchNorm1d):
        scale, offset = _batch_norm(group.norm)
        weights, bias = weights * scale, bias * scale + offset
    elif isinstance(group.norm, nn.LayerNorm):
        (gain, shift), epsilon = _values(group.norm), group.norm.eps
    output, output_bias = _values(group.output)
    return Group(
        frames=np.array([seen[step : step + taps] for step in range(steps)], np.int32),
        weights=_upper_halves(np.pad(weights, ((0, 0), (0, -weights.shape[1] % ROWS), (0, 0)))),
        bias=bias,
        gain=gain,
        shift=shift,
        epsilon=f32(epsilon),
        output=output.reshape(-1, nodes, steps),
        output_bias=output_bias,
    )


def _batch_norm(norm: nn.BatchNorm1d) -> tuple[Floats, Floats]:
    """What it multiplies by, and what it adds then, by its running statistics."""
    assert norm.running_mean is not None
    assert norm.running_var is not None
    gain = norm.weight / (norm.running_var + norm.eps).sqrt()
    return gain.detach().numpy(), (norm.bias - norm.running_mean * gain).detach().numpy()


def _values(layer: nn.Module) -> tuple[Floats, Floats]:
    """Weight and bias."""
    weight, bias = (value.detach().float().numpy() for value in (layer.weight, layer.bias))  # type: ignore[operator]
    return weight, bias


def _upper_halves(values: Floats) -> NDArray[np.uint16]:
    """Floats rounded to bfloat16, ties to even."""
    bits = np.ascontiguousarray(values, np.float32).view(np.uint32)
    return ((bits + 0x7FFF + (bits >> 16 & 1)) >> 16).astype(np.uint16)


@compiled
def _pass(history: Floats, group: Group, hidden: Floats, outputs: Floats) -> None:
    """A group's outputs (K,) for features (span, F). hidden: room for the nodes' values (steps, nodes)."""
    hidden[...] = f32(0)
    for tap in range(group.weights.shape[0]):
        for step in range(hidden.shape[0]):
            _add_products(history[group.frames[step, tap]], group.weights[tap], hidden[step])
    for step in range(hidden.shape[0]):
        for node in range(hidden.shape[1]):
            hidden[step, node] += group.bias[node]
        if group.epsilon >= f32(0):
            _normalise(hidden[step], group.gain, group.shift, group.epsilon)
    for k in range(len(outputs)):
        total = group.output_bias[k]
        for step in range(hidden.shape[0]):
            for node in range(hidden.shape[1]):
                total += max(hidden[step, node], f32(0)) * group.output[k, node, step]
        outputs[k] = total


@compiled
def _add_products(x: Floats, weights: NDArray[np.uint16], hidden: Floats) -> None:
    """Add the products of features (F,) and weights (features, nodes) to hidden (nodes,)."""
    last = len(x) - 1
    for i in range(0, weights.shape[0], ROWS):
        a, b, c, d = x[i], x[min(i + 1, last)], x[min(i + 2, last)], x[min(i + 3, last)]
        for node in range(len(hidden)):
            e = _widened(weights[i, node])
            f = _widened(weights[i + 1, node])
            g = _widened(weights[i + 2, node])
            h = _widened(weights[i + 3, node])
            hidden[node] += (a * e + b * f) + (c * g + d * h)


@inlined
def _widened(half: np.uint16) -> np.float32:
    """A bfloat16 in 32 bits."""
    return np.uint32(np.uint32(half) << np.uint32(16)).view(np.float32)


@compiled
def _normalise(values: Floats, gain: Floats, shift: Floats, epsilon: np.float32) -> None:
    """Layer norm of nodes' values, in place."""
    mean = variance = f32(0)
    for value in values:
        mean += value / f32(len(values))
    for value in values:
        variance += (value - mean) * (value - mean) / f32(len(values))
    scale = f32(1) / np.sqrt(variance + epsilon)
    for node in range(len(values)):
        values[node] = (values[node] - mean) * scale * gain[node] + shift[node]
