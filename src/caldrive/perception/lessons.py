"""What a step of the training asks of the network: six affordances and, where it is wanted, what stands where."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.utils.checkpoint import checkpoint

from caldrive.perception.network import Network
from caldrive.perception.segmentation import STAGE, Segmentation


class Lessons(nn.Module):
    """The network and its second lesson as one call, which is what DistributedDataParallel looks after."""

    def __init__(self, network: Network, segmentation: Segmentation | None = None, at_once: int | None = None) -> None:
        super().__init__()
        self.network, self.segmentation, self.at_once = network, segmentation, at_once

    def forward(self, images: Tensor, index: Tensor, command: Tensor) -> dict[str, Tensor]:
        """Normalised images (N, 3, H, W), and where windows find theirs among them (B, T), to outputs (B * S, K); each
        image passes the backbone once. Under `segmentation` are the logits of that lesson."""
        features, maps = self._see(images)
        outputs: dict[str, Tensor] = self.network(features[index], command)
        if self.segmentation is not None:
            outputs["segmentation"] = self.segmentation(maps)
        return outputs

    def _see(self, images: Tensor) -> tuple[Tensor, Tensor]:
        """Features (N, F), and the maps of the stage that the second lesson looks at."""
        if self.at_once is None or len(images) <= self.at_once:
            maps = self.network.backbone.maps(images)
            return maps[-1].flatten(1), maps[STAGE]
        # Of each part only the outcome is kept, and what lies before it computed again for the gradient.
        shares = torch.split(images, self.at_once)
        parts = [checkpoint(self._see, share, use_reentrant=False) for share in shares]
        features, seen = (torch.cat(part) for part in zip(*parts, strict=True))
        return features, seen
