from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from caldrive.datatypes import Observation
from caldrive.interfaces import BadImage
from caldrive.perception.dataset.frames import Frames
from caldrive.perception.images import normalise, to_float
from caldrive.perception.inference.predictor import NetworkPerception
from caldrive.perception.network.checkpoint import CheckpointInfo, save_network
from caldrive.perception.network.network import Network
from caldrive.perception.targets import decode
from caldrive.perception.training.multitask import MultiTaskModel
from caldrive.recordings.reader import read_episode
from tests.perception.data import HEIGHT, TINY, WIDTH, column_image, record, see, values


@pytest.fixture
def network() -> Network:
    torch.manual_seed(0)
    return Network(TINY).eval()


def test_driving_gives_what_the_whole_episode_gives(network: Network, tmp_path: Path) -> None:
    path = record(tmp_path, n_episodes=1, n_frames=14, n_cameras=1) / "episode0.parquet"
    episode = read_episode(path)
    batch = Frames([episode], (HEIGHT, WIDTH)).batch(np.array([0]), 14, network.span - 1)
    with torch.no_grad():
        whole = MultiTaskModel(network)(normalise(to_float(batch.images)), batch.index, batch.command)
    perception = NetworkPerception(network, "fp32")
    for i, frame in enumerate(episode):
        affordances = perception.predict(Observation(frame.time, frame.image, frame.speed, frame.command))
        expected = decode({name: output[i : i + 1] for name, output in whole.items()})
        assert values(affordances) == pytest.approx(values(expected), abs=1e-4)


def test_each_frame_passes_the_backbone_once(network: Network) -> None:
    calls: list[int] = []
    network.backbone.register_forward_hook(lambda module, args, output: calls.append(len(args[0])))
    perception = NetworkPerception(network, "fp32")
    for index in range(7):
        perception.predict(see(column_image(index / 10), index))
    assert calls == [1] * 7


def test_reset_forgets_the_last_episode(network: Network) -> None:
    perception = NetworkPerception(network, "fp32")
    fresh = perception.predict(see(column_image(0.3)))
    for place in (-0.9, 0.9, 0.0):
        perception.predict(see(column_image(place, red=True)))
    assert values(perception.predict(see(column_image(0.3)))) != values(fresh)
    perception.reset()
    assert values(perception.predict(see(column_image(0.3)))) == values(fresh)


def test_loads_a_network_from_its_file(network: Network, tmp_path: Path) -> None:
    save_network(tmp_path / "model.safetensors", network, CheckpointInfo(TINY))
    loaded = NetworkPerception(tmp_path / "model.safetensors", "fp32").predict(see(column_image(0.2)))
    assert values(loaded) == values(NetworkPerception(network, "fp32").predict(see(column_image(0.2))))


def test_bfloat16_is_close(network: Network) -> None:
    exact = values(NetworkPerception(network, "fp32").predict(see(column_image(0.2))))
    rough = values(NetworkPerception(network, "bf16").predict(see(column_image(0.2))))
    assert rough[0] == pytest.approx(exact[0], abs=0.05)
    assert rough[4:] == pytest.approx(exact[4:], abs=0.1)


@pytest.mark.parametrize(
    ("image", "words"),
    [
        (np.zeros((HEIGHT, WIDTH, 3), np.uint8), "black"),
        (np.pad(np.full((1, 1, 3), 255, np.uint8), ((9, HEIGHT - 10), (9, WIDTH - 10), (0, 0))), "black"),
        (None, "the image is None"),
        (np.full((HEIGHT, WIDTH + 8, 3), 90, np.uint8), "set the camera so"),
        (np.full((HEIGHT, WIDTH, 3), 0.5), "of float64"),
    ],
)
def test_a_bad_image_is_refused_and_does_not_enter_the_history(network: Network, image: Any, words: str) -> None:
    perception, undisturbed = NetworkPerception(network, "fp32"), NetworkPerception(network, "fp32")
    for place in (0.1, 0.4):
        perception.predict(see(column_image(place)))
        undisturbed.predict(see(column_image(place)))
    with pytest.raises(BadImage, match=words):
        perception.predict(see(image))
    assert values(perception.predict(see(column_image(0.5)))) == values(undisturbed.predict(see(column_image(0.5))))


def test_features_that_are_not_numbers_are_refused(network: Network) -> None:
    network.backbone.convolutions()[0].weight.data.fill_(float("nan"))
    with pytest.raises(BadImage, match="not numbers"):
        NetworkPerception(network, "fp32").predict(see(column_image(0.0)))
