"""Attention: a network that looks at one thing is seen to look there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import nn

from caldrive.datatypes import Command, Image
from caldrive.explain import activation_maps
from caldrive.explain.activation_maps import Question, ask, attend, frames_back, upsampled
from caldrive.perception.inference.predictor import NetworkPerception
from caldrive.perception.network.config import BlockConfig, NetworkConfig
from caldrive.perception.network.network import Network
from tests.perception.data import see

CONFIG = NetworkConfig(
    width=1 / 8, batch_norm=False, hazard_stop=BlockConfig("gru", 8, 0.0, length=3, dilation=2),
    relative_angle=BlockConfig("dense", 8, 0.0), center_distance=BlockConfig("tconv", 8, 0.0, length=4),
)  # fmt: skip
SIZE = CONFIG.image_size


@pytest.fixture(scope="module")
def network() -> Network:
    torch.manual_seed(1)
    return Network(CONFIG).eval()


def pictures(n: int, seed: int = 0) -> list[Image]:
    return list(np.random.default_rng(seed).integers(0, 255, (n, *SIZE, 3), dtype=np.uint8))


def test_every_frame_of_the_history_has_a_map(network: Network) -> None:
    attention = attend(network, Question("hazard_stop"), pictures(5))
    assert attention.back == frames_back(network, "hazard_stop") == (4, 2, 0)
    assert [one.shape for one in attention.maps] == [(11, 25)] * 3
    assert len({one.tobytes() for one in attention.maps}) == 3
    assert sum(attention.shares) == pytest.approx(1.0)
    of_the_paper = attend(network, Question("red_light"), pictures(1), method="gradcam")
    assert [one.shape for one in of_the_paper.maps] == [(5, 12)]


def test_what_was_long_ago_counts_for_nothing_where_the_block_sees_one_frame(network: Network) -> None:
    one, other = pictures(4), pictures(4, seed=1)
    same_last = [*other[:3], one[3]]
    question = Question("relative_angle", Command.LEFT)
    np.testing.assert_array_equal(attend(network, question, one).now, attend(network, question, same_last).now)
    assert (attend(network, question, one).now != attend(network, question, other).now).any()


def test_the_reply_is_what_the_driver_would_be_told(network: Network) -> None:
    images, perception = pictures(6), NetworkPerception(network, precision="fp32", watchdog=False)
    for image in images:
        seen = perception.predict(replace(see(image), command=Command.RIGHT))
    assert ask(network, Question("hazard_stop"), images).probability == pytest.approx(seen.hazard_stop, abs=1e-5)
    angle = ask(network, Question("relative_angle", Command.RIGHT), images)
    assert angle.value == pytest.approx(seen.relative_angle, abs=1e-4)
    assert angle.probability is None
    sign = ask(network, Question("speed_sign"), images)
    assert int(sign.value) == (seen.speed_sign or 0)
    assert sum(
        ask(network, Question("speed_sign", label=label), images).probability or 0 for label in (0, 30, 60, 90)
    ) == pytest.approx(1.0, abs=1e-5)


def test_classes_have_no_negative_attention_and_values_have_both_signs(network: Network) -> None:
    assert attend(network, Question("red_light"), pictures(1)).now.min() >= 0
    signed = attend(network, Question("center_distance"), pictures(4)).now
    assert signed.min() < 0 < signed.max()


def test_attention_is_where_there_is_something_to_see() -> None:
    torch.manual_seed(0)
    network = Network(CONFIG).eval()
    for convolution in network.backbone.convolutions():
        assert convolution.bias is not None
        torch.nn.init.zeros_(convolution.bias)
    image = np.full((*SIZE, 3), (124, 116, 104), np.uint8)  # the mean, of which nothing is left
    image[20:30, 150:160] = 255
    large = upsampled(np.abs(attend(network, Question("relative_angle"), [image]).now), SIZE)
    assert large[:64, 100:].sum() > 0.7 * large.sum() > 0  # of a place a quarter of whose image is there


def test_attention_needs_every_convolution_once(network: Network, monkeypatch: pytest.MonkeyPatch) -> None:
    passed: list[int] = []
    convolution = network.backbone.convolutions()[0]
    hook = convolution.register_forward_hook(lambda module, inputs, output: passed.append(len(inputs[0])))
    attend(network, Question("hazard_stop"), pictures(5))
    hook.remove()
    assert set(passed) == {3}  # all frames together, never one by one


@pytest.mark.parametrize(
    ("question", "sentence"),
    [
        (("lights", None), "found affordance 'lights', wanted one of hazard_stop"),
        (("speed_sign", 50), r"found class 50 of speed sign, wanted one of its classes \(0, 30, 60, 90\)"),
        (("relative_angle", 1), "none, as it is a number"),
    ],
)
def test_questions_that_cannot_be_end_in_a_sentence(question: tuple[str, int | None], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        Question(question[0], label=question[1])


def test_a_question_is_typed_with_its_class() -> None:
    assert Question.parse("speed_sign=60") == Question("speed_sign", label=60)
    assert Question.parse("red_light=0") == Question("red_light", label=0)
    assert Question.parse("relative_angle") == Question("relative_angle")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("speed_sign=", "found class  of speed sign, wanted"),
        ("speed_sign=fast", r"found class fast of .*\(0, 30, 60, 90\): type speed_sign=90"),
        ("relative_angle=1", r"\(none, as it is a number\): type relative_angle"),
        ("lights=1", "found affordance 'lights', wanted one of hazard_stop"),
    ],
)
def test_a_class_that_is_none_ends_in_a_sentence(text: str, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        Question.parse(text)


def test_the_class_that_is_asked_for_is_named_with_the_map(network: Network) -> None:
    for label, said in ((0, "no speed sign"), (60, "speed sign 60"), (90, "speed sign 90")):
        assert attend(network, Question("speed_sign", label=label), pictures(1)).reply.label == said


@pytest.mark.parametrize("method", activation_maps.METHODS)
def test_what_speaks_for_a_class_speaks_against_the_other(network: Network, method: str) -> None:
    for_red, for_none = (
        attend(network, Question("red_light", label=label), pictures(1), method).now for label in (1, 0)
    )
    assert for_red.any()
    assert for_none.any()
    assert not ((for_red > 0) & (for_none > 0)).any()


def test_a_map_of_hirescam_sums_to_the_change_along_its_activations(network: Network) -> None:
    """By Euler: the sum of activation times gradient is how fast the value changes as all of them grow by a share."""
    share, layer = 1e-3, network.backbone.stages[activation_maps.METHODS["hirescam"]]
    assert isinstance(layer, nn.ModuleList)
    question, images = Question("relative_angle"), pictures(1)
    expected = float(attend(network, question, images).now.sum()) * question.spec.scale
    values = []
    for factor in (1 - share, 1 + share):
        hook = layer[-1].register_forward_pre_hook(lambda module, given, factor=factor: (given[0] * factor,))
        values.append(ask(network, question, images).value)
        hook.remove()
    assert expected == pytest.approx((values[1] - values[0]) / (2 * share), rel=0.05, abs=1e-5)


def test_unknown_methods_and_a_missing_library_are_named(network: Network, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueError, match="found method 'first', wanted one of hirescam, gradcam"):
        attend(network, Question("red_light"), pictures(1), method="first")
    monkeypatch.setitem(__import__("sys").modules, "captum.attr", None)
    with pytest.raises(RuntimeError, match=r"found no Captum, wanted it .*pip install 'caldrive\[explain\]'"):
        attend(network, Question("red_light"), pictures(1))


def test_the_newest_of_few_images_comes_last(network: Network) -> None:
    images: Sequence[Image] = pictures(1)
    question = Question("hazard_stop")
    assert ask(network, question, images) == ask(network, question, [images[0]] * 5)
    assert activation_maps.METHODS["gradcam"] == len(network.backbone.stages) - 1


def test_images_of_another_size_end_in_a_sentence(network: Network) -> None:
    image = np.zeros((144, 320, 3), np.uint8)
    with pytest.raises(ValueError, match=r"found images of 320 x 144, wanted 200 x 88 .*: give --model"):
        attend(network, Question("red_light"), [image])
