"""The network at the wheel: one image in, six affordances out, each frame through the backbone once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from caldrive.datatypes import Affordances, Image, Observation
from caldrive.interfaces import BadImage
from caldrive.perception.images import normalise, to_float
from caldrive.perception.inference.engines import INTEGERS, blocks_in, driving_precision, features_in
from caldrive.perception.network.checkpoint import CheckpointInfo, load_network
from caldrive.perception.network.network import COMMANDS, Network
from caldrive.perception.targets import decode

DARK, LIT = 3, 0.01  # of a working camera's image at least this share is brighter than that, even by night


class NetworkPerception:
    """Perception by a trained network: keeps the features of the last `span` frames of an episode.

    Before the first frame there is the first frame again, as in training. precision: of the backbone,
    see `driving_precision`; a network that is no file has no ranges. threads: how many it may use, None leaves torch's
    as they are. Raises BadImage, and then forgets nothing.
    """

    def __init__(self, network: Network | Path | str, precision: str = "auto", threads: int | None = None) -> None:
        if isinstance(network, Network):
            network, info = network, CheckpointInfo(network.config)
        else:
            network, info = load_network(network)
        self.network, precision = network.eval(), driving_precision(precision, info)
        if threads is not None:  # torch's own would wait for one another beside those of a backbone in integers
            torch.set_num_threads(1 if precision in INTEGERS else threads)
        self._features = features_in(precision, network, info, threads)
        self._blocks = blocks_in(precision, network, threads)
        self._history: Tensor | None = None  # (1, span, F)

    def reset(self) -> None:
        """An episode begins: forget the last one's frames."""
        self._history = None

    @torch.inference_mode()
    def predict(self, observation: Observation) -> Affordances:
        """The affordances of the newest frame. Raises BadImage where the image is no use."""
        self._check(observation.image)
        feature = self._features(normalise(to_float(observation.image[None])))[:, None]  # (1, 1, F)
        if not bool(feature.isfinite().all()):
            raise BadImage("the image's features are not numbers: brake, and look at the weights")
        if self._history is None:
            self._history = feature.expand(-1, self.network.span, -1)
        else:
            self._history = torch.cat((self._history[:, 1:], feature), dim=1)
        command = torch.tensor([COMMANDS.index(observation.command)])
        return decode(self._blocks(self._history, command))

    def _check(self, image: Image) -> None:
        config = self.network.config
        wanted = (config.image_height, config.image_width, 3)
        if not isinstance(image, np.ndarray):
            raise BadImage(f"the image is {image}, the network takes {wanted} of uint8: brake, and look at the camera")
        if image.shape != wanted or image.dtype != np.uint8:
            raise BadImage(
                f"the image is {image.shape} of {image.dtype}, the network takes {wanted} of uint8: set the camera so"
            )
        if np.count_nonzero(image > DARK) < LIT * image.size:
            raise BadImage("the image is black: brake, and look at the camera")
