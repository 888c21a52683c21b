"""The network when driving: one image in, the affordances out, each frame through the backbone once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

from caldrive.compiled import Floats
from caldrive.datatypes import Affordances, Observation
from caldrive.interfaces import BadImage
from caldrive.perception.images import check_image
from caldrive.perception.inference.engines import INTEGERS, blocks_engine, eyes_engine
from caldrive.perception.inference.precision import driving_precision
from caldrive.perception.inference.watchdog import Watchdog
from caldrive.perception.network.camera_check import CameraCheck, load_camera_check
from caldrive.perception.network.checkpoint import CheckpointInfo, load_network
from caldrive.perception.network.network import COMMANDS, Network
from caldrive.perception.targets import decode


class NetworkPerception:
    """Perception by a trained network: keeps the features of the last `span` frames of an episode.

    Before the first frame there is the first frame again, as in training. precision: of the backbone,
    see `driving_precision`; a network that is no file has no ranges. threads: how many it may use, None leaves torch's
    as they are. watchdog: whether to notice a camera that fails while the car drives; pictures from elsewhere are no
    drive. Raises BadImage, and then forgets nothing.
    """

    def __init__(
        self,
        network: Network | Path | str,
        precision: str = "auto",
        threads: int | None = None,
        *,
        watchdog: bool = True,
    ) -> None:
        check: CameraCheck | None = None
        thresholds: tuple[float, ...] = ()
        if isinstance(network, Network):
            info = CheckpointInfo(network.config)
        else:
            if watchdog and (known := load_camera_check(network)) is not None:
                check, thresholds = known
            network, info = load_network(network)
        self._watchdog = Watchdog(thresholds) if watchdog else None
        self.network, precision = network.eval(), driving_precision(precision, info.ranges)
        if threads is not None:  # torch's own would wait for one another beside those of a backbone in integers
            torch.set_num_threads(1 if precision in INTEGERS else threads)
        self._eyes = eyes_engine(precision, network, info.ranges, check, threads)
        self._blocks = blocks_engine(precision, network)
        self._history: Floats | None = None  # (span, F)

    def reset(self) -> None:
        """An episode begins: forget the last one's frames."""
        self._history = None
        if self._watchdog is not None:
            self._watchdog.reset()

    def predict(self, observation: Observation) -> Affordances:
        """The affordances of the newest frame. Raises BadImage where the image is no use."""
        check_image(observation.image, self.network.config.image_size)
        features, checked = self._eyes(observation.image)  # (1, F)
        if self._watchdog is not None:
            self._watchdog.look(observation, checked)
        if not np.isfinite(features).all():
            raise BadImage("the image's features are not numbers: brake, and look at the weights")
        if self._history is None:
            self._history = features.repeat(self.network.span, axis=0)
        else:
            self._history = np.concatenate((self._history[1:], features))
        return decode(self._blocks(self._history, COMMANDS.index(observation.command)))
