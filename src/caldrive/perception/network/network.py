"""The network (section 3.1): one shared backbone, and a task block for each affordance."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from caldrive.affordances import SPECS, AffordanceSpec
from caldrive.datatypes import Command
from caldrive.perception.network.backbone import Backbone
from caldrive.perception.network.config import BlockConfig, NetworkConfig

COMMANDS = tuple(Command)  # a command's number is its place here
KERNEL = 3  # frames that a temporal convolution sees at once


class _SafeBatchNorm(nn.BatchNorm1d):
    """Batch norm that uses its running statistics where a batch holds one sample only: one value has no deviation."""

    def forward(self, x: Tensor) -> Tensor:
        if self.training and x.shape[0] == 1:
            return nn.functional.batch_norm(
                x, self.running_mean, self.running_var, self.weight, self.bias, False, 0.0, self.eps
            )
        return super().forward(x)


class _LayerNorm(nn.LayerNorm):
    """Norm over the nodes of (N, nodes) or (N, nodes, steps)."""

    def forward(self, x: Tensor) -> Tensor:
        return super().forward(x.movedim(1, -1)).movedim(-1, 1)


RECURRENT: dict[str, type[nn.GRU] | type[nn.LSTM]] = {"gru": nn.GRU, "lstm": nn.LSTM}
NORMS: dict[str, type[nn.Module]] = {"batch": _SafeBatchNorm, "layer": _LayerNorm, "none": nn.Identity}


class NodeGroup(nn.Module):
    """Task layer, norm, dropout and output nodes: (N, length, F) to (N, outputs)."""

    def __init__(self, config: BlockConfig, n_features: int, n_outputs: int) -> None:
        super().__init__()
        self.kind = config.layer
        self.steps = 1  # places of a temporal convolution's kernel in the sequence
        self.layer: nn.Module
        if config.layer == "dense":
            self.layer = nn.Linear(n_features * config.length, config.nodes)
        elif config.layer == "tconv":
            kernel = min(KERNEL, config.length)
            self.steps = config.length - kernel + 1
            # One product over the frames that lie under the kernel: on a CPU much faster than a convolution this long.
            self.layer = nn.Linear(n_features * kernel, config.nodes)
        else:
            self.layer = RECURRENT[config.layer](n_features, config.nodes, batch_first=True)
        self.norm = NORMS[config.norm](config.nodes)
        self.dropout = nn.Dropout(config.dropout)
        self.output = nn.Linear(config.nodes * self.steps, n_outputs)

    def forward(self, sequence: Tensor) -> Tensor:
        """Features (N, length, F) to outputs (N, outputs)."""
        if self.kind in RECURRENT:
            hidden = self.norm(self.layer(sequence)[0][:, -1])  # (N, nodes)
        elif self.kind == "tconv":
            under = sequence.unfold(1, sequence.shape[1] - self.steps + 1, 1)  # (N, steps, F, kernel)
            hidden = self.norm(self.layer(under.flatten(2)).transpose(1, 2)).relu()  # (N, nodes, steps)
        else:
            hidden = self.norm(self.layer(sequence.flatten(1))).relu()  # (N, nodes)
        result: Tensor = self.output(self.dropout(hidden).flatten(1))
        return result


class TaskBlock(nn.Module):
    """One affordance from the features. A conditional block has a group of nodes for each command; a sample passes the
    group of its command only, and so only that one receives its gradient. `BlockConfig.conditioning` has the other
    ways to tell it the command: as an input, or by choosing among the values of all commands, where only the one that
    is chosen receives a gradient."""

    def __init__(self, config: BlockConfig, spec: AffordanceSpec, n_features: int) -> None:
        super().__init__()
        self.config = config
        self.n_outputs = spec.outputs
        self.conditioning = config.conditioning if spec.conditional else None
        n_groups = len(COMMANDS) if self.conditioning == "groups" else 1
        n_inputs = n_features + (len(COMMANDS) if self.conditioning == "input" else 0)
        n_outputs = spec.outputs * (len(COMMANDS) if self.conditioning == "all" else 1)
        self.groups = nn.ModuleList(NodeGroup(config, n_inputs, n_outputs) for _ in range(n_groups))

    def group(self, command: int) -> NodeGroup:
        """The nodes that a command, by its number, activates."""
        chosen = self.groups[command if len(self.groups) > 1 else 0]
        assert isinstance(chosen, NodeGroup)
        return chosen

    def forward(self, features: Tensor, command: Tensor) -> Tensor:
        """Features (B, T, F) and the commands (B, S) of the last S frames to outputs (B * S, outputs)."""
        return self.decide(self._sequences(features, command.shape[1]), command.flatten())

    def decide(self, sequence: Tensor, command: Tensor) -> Tensor:
        """The frames that the block sees (N, length, F) and their commands (N,) to outputs (N, outputs)."""
        if self.conditioning == "input":
            one_hot = nn.functional.one_hot(command, len(COMMANDS)).to(sequence.dtype)
            sequence = torch.cat((sequence, one_hot[:, None].expand(-1, sequence.shape[1], -1)), dim=2)
        if len(self.groups) == 1 or len(command) == 1:  # when driving there is one frame and one command
            result: Tensor = self.group(int(command[0]))(sequence)
            return self._of_command(result, command) if self.conditioning == "all" else result
        return self._by_group(sequence, command)

    def _of_command(self, outputs: Tensor, command: Tensor) -> Tensor:
        """Of the outputs for all commands (N, commands * outputs) those of each sample's own (N, outputs)."""
        samples = torch.arange(len(outputs), device=outputs.device)
        return outputs.view(len(outputs), len(COMMANDS), -1)[samples, command]

    def _by_group(self, sequence: Tensor, command: Tensor) -> Tensor:
        """Each sample through the group of its command."""
        outputs = sequence.new_zeros(len(sequence), self.n_outputs)
        for number, group in enumerate(self.groups):
            active = (command == number).nonzero()[:, 0]
            if len(active):
                output = group(sequence[active])
                outputs = outputs.to(output.dtype).index_copy(0, active, output)
        return outputs

    def _sequences(self, features: Tensor, n_last: int) -> Tensor:
        """The frames that each of the last n_last frames is seen with: (B, T, F) to (B * n_last, length, F)."""
        T = features.shape[1]
        if self.config.length == 1:
            return features[:, T - n_last :].flatten(0, 1)[:, None]
        back = torch.arange(self.config.length - 1, -1, -1, device=features.device) * self.config.dilation
        now = torch.arange(T - n_last, T, device=features.device)
        # Before the first frame there is the first frame again: the same rule in training and when driving.
        return features[:, (now[:, None] - back).clamp(min=0)].flatten(0, 1)


class Network(nn.Module):
    """The backbone and a task block for each affordance.

    `features` passes images (N, 3, H, W) through the backbone, `forward` passes features through the task blocks, so
    that no frame needs the backbone twice.
    """

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.config = config
        self.backbone = Backbone(config.width, config.batch_norm)
        n_features = self.backbone.n_features(*config.image_size)
        self.blocks = nn.ModuleDict({s.name: TaskBlock(getattr(config, s.name), s, n_features) for s in SPECS})

    @property
    def span(self) -> int:
        """Frames of history that the longest task block looks at, the present one included."""
        return max(block.config.span for block in self.task_blocks().values())

    def features(self, images: Tensor) -> Tensor:
        """Normalised images (N, 3, H, W) to features (N, F)."""
        result: Tensor = self.backbone(images)
        return result

    def task_blocks(self) -> dict[str, TaskBlock]:
        """The blocks by their affordance."""
        return {name: block for name, block in self.blocks.items() if isinstance(block, TaskBlock)}

    def forward(self, features: Tensor, command: Tensor) -> dict[str, Tensor]:
        """Features (B, T, F) and commands (B,) of the last frame, or (B, S) of the last S frames, to outputs (B * S,
        K)."""
        if command.dim() == 1:
            command = command[:, None]
        return {name: block(features, command) for name, block in self.blocks.items()}
