"""What the segmentation network learns from, and that it learns."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from caldrive.agents.modular_pipeline.config import SegmentationConfig
from caldrive.agents.modular_pipeline.scene import SCENE_CLASS, SceneClass
from caldrive.agents.modular_pipeline.segmentation import (
    SegmentationNetwork,
    class_shares,
    junction_labels,
    junction_loss,
    require_semantics,
    segmentation_loss,
)
from caldrive.datatypes import Semantic
from caldrive.perception.dataset.frames import Frames
from caldrive.perception.images import normalise, to_float
from caldrive.recordings.reader import Episode, read_episode
from caldrive.recordings.writer import EpisodeError
from tests.agents.modular_pipeline.test_segmenter import SMALL
from tests.perception.data import HEIGHT, WIDTH, record


@pytest.fixture(scope="module")
def episode(tmp_path_factory: pytest.TempPathFactory) -> Episode:
    folder = record(tmp_path_factory.mktemp("episodes"), n_episodes=1, semantic=True)
    return read_episode(folder / "episode0.parquet", semantic=True)


def test_the_papers_five_classes_hold_all_twelve() -> None:
    names = {kind.name: SceneClass(SCENE_CLASS[kind]).name for kind in Semantic}
    assert names == {
        "SKY": "STATIC", "ROAD": "ROAD", "LINE": "LANE_MARKING", "SIDEWALK": "SIDEWALK", "GROUND": "STATIC",
        "BUILDING": "STATIC", "PLANT": "STATIC", "FURNITURE": "STATIC", "LIGHT": "STATIC", "SIGN": "STATIC",
        "VEHICLE": "DYNAMIC", "PERSON": "DYNAMIC",
    }  # fmt: skip


def test_a_thin_line_is_a_share_of_its_square() -> None:
    semantics = torch.full((1, 4, 4), int(Semantic.ROAD), dtype=torch.uint8)
    semantics[0, :, 1] = Semantic.LINE
    shares = class_shares(semantics)
    assert shares.shape == (1, 5, 2, 2)
    assert shares[0, SceneClass.LANE_MARKING].tolist() == [[0.5, 0.0], [0.5, 0.0]]
    assert (shares.sum(dim=1) == 1).all()


def test_the_network_gives_classes_at_half_the_size_and_a_junction() -> None:
    network = SegmentationNetwork(SMALL)
    classes, junction = network(torch.randn(2, 3, HEIGHT, WIDTH))
    assert classes.shape == (2, 5, *SMALL.class_size)
    assert junction.shape == (2,)


def test_the_network_is_small_enough_to_ship() -> None:
    network = SegmentationNetwork(SegmentationConfig())
    assert sum(value.numel() for value in network.parameters()) * 2 < 10e6


def test_the_right_classes_cost_least() -> None:
    semantics = torch.full((1, 4, 4), int(Semantic.SIDEWALK), dtype=torch.uint8)
    logits = torch.zeros(1, 5, 2, 2)
    even = segmentation_loss(logits, semantics)
    logits[:, SceneClass.SIDEWALK] = 9.0
    assert segmentation_loss(logits, semantics) < 0.01 < even


def test_a_junction_that_nobody_knows_counts_nothing() -> None:
    logits = torch.tensor([3.0, -2.0, 7.0])
    known = junction_loss(logits[:2], torch.tensor([1.0, 0.0]))
    assert junction_loss(logits, torch.tensor([1.0, 0.0, torch.nan])) == known
    assert junction_loss(logits, torch.full((3,), torch.nan)) == 0.0


def test_a_junction_is_near_from_ten_metres_before_it(episode: Episode) -> None:
    """At 5 m/s and ten frames a second a frame is half a metre."""
    n = 60
    inside = np.zeros(n, bool)
    inside[40:45] = True
    columns = {"camera": np.zeros(n, int), "time": np.arange(n) / 10, "speed": np.full(n, 5.0), "junction": inside}
    labels = junction_labels(_with(episode, columns))
    assert not labels[:20].any()
    assert (labels[20:45] == 1).all()
    assert np.isnan(labels[45:]).sum() == 15  # 7 m until the recording ends
    columns["time"] = columns["time"] + np.where(np.arange(n) > 30, 9.0, 0.0)  # a gap, in which nobody looked
    labels = junction_labels(_with(episode, columns))
    assert np.isnan(labels[11:31]).all()
    assert (labels[31:45] == 1).all()


def test_each_camera_has_labels_of_its_own(episode: Episode) -> None:
    both = junction_labels(episode)
    one = junction_labels(_with(episode, {k: v[episode.columns["camera"] == 1] for k, v in episode.columns.items()}))
    assert np.array_equal(both[episode.columns["camera"] == 1], one, equal_nan=True)


def _with(episode: Episode, columns: dict[str, np.ndarray]) -> Episode:
    """Another recording."""
    return replace(episode, columns={"frame": np.arange(len(columns["time"]))} | columns)


def test_a_few_steps_lower_the_losses(episode: Episode) -> None:
    torch.manual_seed(0)
    torch.set_num_threads(1)
    frames, labels = Frames([episode], (HEIGHT, WIDTH)), torch.from_numpy(junction_labels(episode))
    ids = np.arange(16)
    semantics = frames.semantics(ids)
    assert semantics is not None
    images, network = normalise(to_float(frames.images(ids))), SegmentationNetwork(SMALL)
    optimiser, losses = torch.optim.Adam(network.parameters(), 1e-2), []
    for _ in range(15):
        classes, junction = network(images)
        parts = segmentation_loss(classes, torch.from_numpy(semantics)), junction_loss(junction, labels[ids])
        losses.append([part.item() for part in parts])
        optimiser.zero_grad()
        (parts[0] + parts[1]).backward()
        optimiser.step()
    assert losses[-1][0] < 0.95 * losses[0][0]
    assert losses[-1][1] < 0.7 * losses[0][1]


def test_a_recording_without_semantic_images_is_refused(episode: Episode, tmp_path: Path) -> None:
    require_semantics([episode])
    with pytest.raises(EpisodeError, match=r"found no semantic images in .*, wanted them for the agent mp: record"):
        require_semantics([episode, replace(episode, semantics=None)])


def test_settings_that_cannot_be_end_in_a_sentence() -> None:
    with pytest.raises(ValueError, match="found a network of width 0"):
        SegmentationConfig(width=0)
    with pytest.raises(ValueError, match="found a decoder of 0 channels"):
        SegmentationConfig(decoder=0)
