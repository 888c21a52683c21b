"""Where the network looks while a car drives: a picture for each observation, for recordings and viewers."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from pathlib import Path

from caldrive.agents.rows import model_path
from caldrive.datatypes import CameraConfig, Image, Observation
from caldrive.explain.activation_maps import Question, attend
from caldrive.explain.attention_video import PANEL_WIDTH, require_camera
from caldrive.explain.overlay import explained, scale_of
from caldrive.perception.network.checkpoint import load_network


class LiveAttention:
    """Draws the attention to one affordance while a car drives. Its scale is the largest so far, as what comes is not
    known yet.

    affordance: as `Question.parse` takes it; camera: that of the images; model: the network, None for the one in the
    package. Raises ValueError where the network takes images of another size.
    """

    def __init__(
        self, affordance: str, camera: CameraConfig, model: Path | None = None, method: str = "hirescam"
    ) -> None:
        self.question, self.method = Question.parse(affordance), method
        self.network, _ = load_network(model_path(model))
        require_camera(camera, self.network)
        self._history: deque[Image] = deque(maxlen=self.network.span)
        self._scale, self._time = 0.0, 0.0

    def __call__(self, observation: Observation) -> Image | None:
        """The picture of an observation; None where its image is damaged and of another size."""
        if observation.image.shape[:2] != self.network.config.image_size:
            return None
        if observation.time < self._time:  # another episode
            self._history.clear()
        self._time = observation.time
        self._history.append(observation.image)
        question = replace(self.question, command=observation.command)
        attention = attend(self.network, question, list(self._history), self.method)
        self._scale = max(self._scale, scale_of([attention.now]))
        return explained(observation.image, attention, self._scale, width=PANEL_WIDTH)
