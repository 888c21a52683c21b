"""What a task block may be built from: the ranges of the supplement's table of hyperparameters."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from caldrive.perception.network.config import NETWORKS, BlockConfig

LAYERS = ("dense", "gru", "lstm", "tconv")
# From and to, both included.
NODES = (10, 200)
DROPOUT = (0.25, 0.75)
LENGTH = (1, 20)
DILATION = (1, 3)
LONGEST_SPAN = (LENGTH[1] - 1) * DILATION[1] + 1  # frames from the oldest one that a block may see to the newest

PUBLISHED = NETWORKS["paper"]  # has the supplement's best task blocks
# Supplement, comparison of temporal and non-temporal task blocks: mean IoU of the discrete, mean absolute error in
# units of the scale of the continuous affordances, without and with history.
PUBLISHED_TEMPORAL = {
    "hazard_stop": (0.8496, 0.8741),
    "red_light": (0.9241, 0.9395),
    "speed_sign": (0.9195, 0.9271),
    "vehicle_distance": (0.04497, 0.03289),
    "relative_angle": (0.00797, 0.00207),
    "center_distance": (0.09642, 0.08465),
}


def suggest_block(trial: Any, like: BlockConfig) -> BlockConfig:
    """The block of an Optuna trial. A dense layer sees one frame, as in the supplement; only what sees several has a
    dilation. like: the rest of the block."""
    layer, length, dilation = trial.suggest_categorical("layer", LAYERS), 1, 1
    nodes, dropout = trial.suggest_int("nodes", *NODES), trial.suggest_float("dropout", *DROPOUT)
    if layer != "dense":
        length = trial.suggest_int("length", *LENGTH)
        if length > 1:
            dilation = trial.suggest_int("dilation", *DILATION)
    return replace(like, layer=layer, nodes=nodes, dropout=dropout, length=length, dilation=dilation)


def block_of(parameters: dict[str, Any], like: BlockConfig) -> BlockConfig:
    """The block of a finished trial's parameters."""
    return replace(like, **{"length": 1, "dilation": 1} | parameters)
