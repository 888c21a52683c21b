"""VGG16's thirteen convolutions (Simonyan and Zisserman) at any width, and its ImageNet weights."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from pickle import UnpicklingError

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file
from torch import Tensor, nn
from torch.nn.functional import max_pool2d

# Of VGG16's five stages: channels, and convolutions.
CHANNELS = (64, 128, 256, 512, 512)
DEPTHS = (2, 2, 3, 3, 3)

# Where a torchvision VGG16 keeps its convolutions.
IMAGENET_LAYERS = (0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28)


class Backbone(nn.Module):
    """Five stages of 3 x 3 convolutions, each halved by a max-pool: (N, 3, H, W) to (N, F), F = channels * H//32 *
    W//32.

    width: share of VGG16's channels. batch_norm: one after each pool, which a narrow network trained from scratch
    needs. The pool stands before the last ReLU of its stage: the two commute, and on a quarter of the pixels ReLU and
    batch norm cost next to nothing (on two cores that trains twice as fast as a batch norm after every convolution).
    """

    def __init__(self, width: float = 1.0, batch_norm: bool = False) -> None:
        super().__init__()
        self.width = width
        self.channels = channels = [max(1, round(width * c)) for c in CHANNELS]
        self.stages, self.norms = nn.ModuleList(), nn.ModuleList()
        n_in = 3
        for n_out, depth in zip(channels, DEPTHS, strict=True):
            sizes = [n_in] + [n_out] * depth
            self.stages.append(nn.ModuleList(nn.Conv2d(a, b, 3, padding=1) for a, b in pairwise(sizes)))
            self.norms.append(nn.BatchNorm2d(n_out) if batch_norm else nn.Identity())
            n_in = n_out
        for conv in self.convolutions():
            if not conv.weight.is_meta:  # there torch would load its compiler first, which takes seconds
                nn.init.kaiming_normal_(conv.weight, nonlinearity="relu")
            conv.weight.data = conv.weight.data.contiguous(memory_format=torch.channels_last)

    def convolutions(self) -> list[nn.Conv2d]:
        """All thirteen in order."""
        return [module for module in self.stages.modules() if isinstance(module, nn.Conv2d)]

    def n_features(self, height: int, width: int) -> int:
        """F for an image of this size."""
        return self.channels[-1] * (height // 32) * (width // 32)

    def forward(self, images: Tensor) -> Tensor:
        """Images (N, 3, H, W) to features (N, F)."""
        return self.maps(images)[-1].flatten(1)

    def maps(self, images: Tensor) -> list[Tensor]:
        """What each of the five stages makes of images (N, 3, H, W): the first one (N, C, H // 2, W // 2)."""
        x, maps = images, []
        for stage, norm in zip(self.stages, self.norms, strict=True):
            assert isinstance(stage, nn.ModuleList)
            for conv in stage[:-1]:
                x = conv(x).relu_()
            x = norm(max_pool2d(stage[-1](x), 2)).relu_()
            maps.append(x)
        return maps

    def load_imagenet(self, path: Path | str) -> None:
        """Take the convolutions of a torchvision-style VGG16 (features.N.weight, features.N.bias) from a safetensors
        file, or a .pth file as in torch.hub's cache.

        Raises ValueError where the file is missing, damaged or of another network, or where this one is not full width.
        """
        if self.width != 1.0:
            raise ValueError(
                f"found a backbone of width {self.width:g}, wanted VGG16's of width 1 for ImageNet's weights: "
                "type --preset paper, or --imagenet none"
            )
        state = _read_state(Path(path))
        for number, conv in zip(IMAGENET_LAYERS, self.convolutions(), strict=True):
            for kind, parameter in conv.named_parameters():
                name = f"features.{number}.{kind}"
                shape = tuple(state[name].shape) if name in state else None
                if shape != tuple(parameter.shape):
                    wanted = tuple(parameter.shape)
                    raise ValueError(
                        f"found {name} of shape {shape} in {path}, wanted VGG16's of {wanted}: give VGG16's state dict"
                    )
                parameter.data.copy_(state[name])


def _read_state(path: Path) -> dict[str, Tensor]:
    try:
        if path.suffix == ".pth":  # weights_only builds tensors and plain values, and runs nothing
            state: dict[str, Tensor] = torch.load(path, map_location="cpu", weights_only=True)
            return state
        return load_file(path)
    except (OSError, EOFError, SafetensorError, UnpicklingError, RuntimeError) as error:
        raise ValueError(
            f"found that {path} is missing or no state dict of tensors, wanted VGG16's: "
            "give a .safetensors or .pth file"
        ) from error
