"""A world whose pictures are the truth in colours, and a segmenter that reads them: the planner without a network."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from caldrive.agents.modular_pipeline.agent import ModularPipelineAgent, auxiliary_camera
from caldrive.agents.modular_pipeline.scene import JUNCTION_AHEAD, SCENE_CLASS, Scene, SceneClass
from caldrive.datatypes import DT, CameraConfig, Image
from caldrive.world.embedded import EmbeddedWorld

CAMERA = CameraConfig()
ONE_HOT = np.eye(len(SceneClass), dtype=np.float32)


class SemanticWorld(EmbeddedWorld):
    """Its red channel is the class of a pixel, its green one whether the car is at a junction."""

    def __init__(self, *, auxiliary: bool = False) -> None:
        super().__init__(CAMERA, auxiliary=auxiliary_camera(CAMERA) if auxiliary else None)

    def images(self, mounts: Sequence[CameraConfig]) -> list[Image]:
        done = self.truth().route_done
        near = any(turn.start - JUNCTION_AHEAD <= done <= turn.end for turn in self.route.turns)
        return [
            np.stack((SCENE_CLASS[classes], np.full_like(classes, near), np.zeros_like(classes)), axis=-1)
            for classes in self.semantic_images(mounts)
        ]


class TrueSegmenter:
    """Reads such pictures, at half their size as the network's."""

    def segment(self, image: Image) -> Scene:
        height, width = image.shape[0] // 2, image.shape[1] // 2
        classes = ONE_HOT[image[..., 0]].reshape(height, 2, width, 2, -1).mean(axis=(1, 3))
        return Scene(classes, float(image[0, 0, 1]))


def true_agent(*, auxiliary: bool = False) -> ModularPipelineAgent:
    """The agent with eyes that do not err."""
    size = CAMERA.height // 2, CAMERA.width // 2
    return ModularPipelineAgent(TrueSegmenter(), CAMERA, size, DT, auxiliary=auxiliary)
