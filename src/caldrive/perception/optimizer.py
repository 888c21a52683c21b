"""What a step does to the weights: Muon for the backbone's convolutions where that is wanted, Adam for all the rest.

Muon (Jordan and others, 2024) steps along the nearest orthogonal matrix of a layer's averaged gradient: all that a
layer can learn is learnt at one rate, not only what its largest gradients point to.
"""

from __future__ import annotations

from torch import Tensor, nn
from torch.optim import Adam, Muon

from caldrive.perception.config import TrainingConfig

# A share of Muon's rate: without it the kernels grow, and each step turns them less than the one before.
DECAY = 0.1


def _rows(kernel: Tensor) -> Tensor:
    """A convolution's weight or gradient (O, I, h, w) as a matrix (O, h * w * I); a view in channels-last memory."""
    return kernel.permute(0, 2, 3, 1).flatten(1)


class Optimizer:
    """Changes the parameters of a module in place. convolutions: those whose kernels Muon may have; config.muon says
    whether it has them."""

    def __init__(self, module: nn.Module, convolutions: list[nn.Conv2d], config: TrainingConfig) -> None:
        self.ratio = config.muon
        self.kernels = [conv.weight for conv in convolutions] if config.muon else []
        self.matrices = [nn.Parameter(_rows(kernel.data)) for kernel in self.kernels]
        for kernel, matrix in zip(self.kernels, self.matrices, strict=True):
            if kernel.data_ptr() != matrix.data_ptr():
                raise ValueError(
                    "found a kernel in another order of memory, wanted channels-last: "
                    "type .contiguous(memory_format=torch.channels_last)"
                )
        mine = {id(kernel) for kernel in self.kernels}
        self.parts: dict[str, Adam | Muon] = {"adam": Adam([p for p in module.parameters() if id(p) not in mine])}
        if self.matrices:
            self.parts["muon"] = Muon(self.matrices, weight_decay=DECAY)

    def step(self, rate: float) -> None:
        """One step of Adam's at this rate and of Muon's at `config.muon` times it; then the gradients are gone."""
        for kernel, matrix in zip(self.kernels, self.matrices, strict=True):
            matrix.grad = None if kernel.grad is None else _rows(kernel.grad)
            kernel.grad = None
        rates = {"adam": rate, "muon": rate * self.ratio}
        for name, part in self.parts.items():
            for group in part.param_groups:
                group["lr"] = rates[name]
            part.step()
            part.zero_grad(set_to_none=True)

    def state(self) -> dict[str, Tensor]:
        """All that the next step depends on, by `<part>.<number of the parameter>.<name>`."""
        return {
            f"{name}.{number}.{key}": value
            for name, part in self.parts.items()
            for number, state in part.state_dict()["state"].items()
            for key, value in state.items()
        }

    def restore(self, tensors: dict[str, Tensor]) -> None:
        """Take up what `state` gave."""
        for name, part in self.parts.items():
            states: dict[int, dict[str, Tensor]] = {}
            for path, value in tensors.items():
                owner, number, key = path.split(".")
                if owner == name:
                    states.setdefault(int(number), {})[key] = value
            part.load_state_dict({"state": states, "param_groups": part.state_dict()["param_groups"]})
