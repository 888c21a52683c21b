"""The numbers beside attention: known maps have known figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import nn

from caldrive.affordances import BY_NAME
from caldrive.datatypes import Image, Semantic
from caldrive.explain.activation_maps import Attention, Map, Question, Reply
from caldrive.explain.faithfulness import (
    ABOUT,
    about,
    centred_map,
    curve,
    energy_inside,
    points_at,
    random_map,
    randomised,
    score_of,
    similarity,
)
from caldrive.perception.network.config import BlockConfig
from caldrive.perception.network.network import Network
from tests.explain.test_activation_maps import CONFIG, pictures

SIZE = (44, 100)


def spot(row: int, column: int) -> Map:
    one = np.zeros(SIZE, np.float32)
    one[row, column] = 1.0
    return one


def box() -> np.ndarray:
    mask = np.zeros(SIZE, bool)
    mask[10:20, 40:50] = True
    return mask


@pytest.mark.parametrize(("place", "hit"), [((15, 45), True), ((15, 52), True), ((15, 54), False), ((40, 90), False)])
def test_the_pointing_game_is_won_on_the_thing_and_three_pixels_of_a_hundred_around_it(
    place: tuple[int, int], hit: bool
) -> None:
    assert points_at(spot(*place), box()) is hit
    assert points_at(-spot(*place), box()) is hit  # what makes a value smaller is attention, too


def test_energy_is_the_share_inside() -> None:
    one = spot(15, 45) - 3 * spot(40, 90)
    assert energy_inside(one, box()) == pytest.approx(0.25)
    assert energy_inside(np.ones(SIZE, np.float32), box()) == pytest.approx(100 / (44 * 100))


def test_every_affordance_is_about_something() -> None:
    assert ABOUT.keys() == BY_NAME.keys()
    semantics = np.full((2, 2), Semantic.LIGHT, np.uint8)
    assert about("red_light", semantics).all()
    assert not about("speed_sign", semantics).any()


def test_who_looks_at_what_counts_deletes_it_at_once_and_inserts_it_first() -> None:
    image = np.zeros((*SIZE, 3), np.uint8)
    image[10:20, 40:50] = 255

    def brightness(changed: Sequence[Image]) -> float:
        return float(changed[0][12:18, 42:48].mean()) / 255

    right = curve([image], [box().astype(np.float32)], brightness)
    wrong = curve([image], [1 - box().astype(np.float32)], brightness)
    unknowing = curve([image], [random_map(np.zeros((11, 25), np.float32), SIZE, np.random.default_rng(0))], brightness)
    assert right.deletion < unknowing.deletion < wrong.deletion
    assert right.insertion > unknowing.insertion > wrong.insertion
    assert right.insertion == pytest.approx(1.0, abs=0.05)


def test_a_random_map_has_as_many_places_as_the_one_beside_it() -> None:
    for places in ((5, 12), (11, 25)):
        one = random_map(np.zeros(places, np.float32), places, np.random.default_rng(0))
        assert len(np.unique(one)) == places[0] * places[1]
    enlarged = random_map(np.zeros((2, 2), np.float32), SIZE, np.random.default_rng(0))
    assert enlarged.shape == SIZE


def test_the_control_that_looks_at_the_middle_does() -> None:
    assert np.unravel_index(centred_map(SIZE).argmax(), SIZE) in [(y, x) for y in (21, 22) for x in (49, 50)]


@pytest.mark.parametrize("name", ["red_light", "speed_sign", "relative_angle"])
def test_scores_begin_at_what_the_network_says(name: str) -> None:
    torch.manual_seed(1)
    network, images = Network(CONFIG).eval(), pictures(1)
    score = score_of(network, Question(name), images)
    blank = np.zeros_like(images[0])
    if name == "relative_angle":
        assert score(images) == pytest.approx(1.0)
    assert 0 <= score([blank]) <= 1
    assert score([blank]) != score(images)


def first_convolutions(network: Network) -> list[torch.nn.Conv2d]:
    """Of each stage of the backbone."""
    stages = [stage[0] for stage in network.backbone.stages if isinstance(stage, torch.nn.ModuleList)]
    return [conv for conv in stages if isinstance(conv, torch.nn.Conv2d)]


def test_new_weights_come_from_the_last_layer_on() -> None:
    torch.manual_seed(1)
    network = Network(CONFIG).eval()
    for stages in (0, 2):
        other = randomised(network, "red_light", stages, seed=5)
        pairs = zip(first_convolutions(network), first_convolutions(other), strict=True)
        changed = [not torch.equal(old.weight, new.weight) for old, new in pairs]
        assert changed == [False] * (5 - stages) + [True] * stages
        outputs = [one.task_blocks()["red_light"].group(0).output.weight for one in (network, other)]
        assert not torch.equal(*outputs)


def test_norms_forget_what_they_learnt_with_their_stage_and_their_block() -> None:
    torch.manual_seed(1)
    network = Network(replace(CONFIG, batch_norm=True, red_light=BlockConfig("dense", 8, 0.0, norm="batch"))).eval()
    for layer in network.modules():
        if isinstance(layer, nn.BatchNorm1d | nn.BatchNorm2d):
            layer.load_state_dict({name: torch.full_like(value, 7.0) for name, value in layer.state_dict().items()})
    other = randomised(network, "red_light", 2, seed=5)
    states = [norm.state_dict() for norm in other.backbone.norms]
    states += [layer.state_dict() for layer in other.blocks["red_light"].modules() if isinstance(layer, nn.BatchNorm1d)]
    kept = dict.fromkeys(states[0], 7.0)
    fresh = {"weight": 1.0, "bias": 0.0, "running_mean": 0.0, "running_var": 1.0, "num_batches_tracked": 0.0}
    firsts = [{name: float(value.ravel()[0]) for name, value in state.items()} for state in states]
    assert firsts == [kept] * 3 + [fresh] * 3


def test_maps_of_the_same_order_are_alike() -> None:
    def of(one: Map) -> Attention:
        return Attention(Reply("red light", 1.0, 1.0, 1), (one,), (0,))

    one = np.arange(12, dtype=np.float32).reshape(3, 4)
    assert similarity(of(one), of(one**2)) == pytest.approx(1.0)
    assert similarity(of(one), of(-one)) == pytest.approx(-1.0)
    assert similarity(of(one), of(np.zeros_like(one))) == 0.0
