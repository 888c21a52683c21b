from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from caldrive.affordances import CONDITIONAL, CONTINUOUS, DISCRETE, SPECS
from caldrive.datatypes import Affordances
from caldrive.perception.evaluation.evaluate import class_ious, confusion, mean_iou, metrics
from caldrive.perception.targets import class_weights, decode, encode, multitask_loss, task_losses
from caldrive.perception.training.config import LossWeights
from caldrive.perception.training.multitask import SEGMENTATION

affordances = st.builds(
    Affordances,
    hazard_stop=st.sampled_from([0.0, 1.0]),
    red_light=st.sampled_from([0.0, 1.0]),
    speed_sign=st.sampled_from([None, 30, 60, 90]),
    vehicle_distance=st.floats(0, 50),
    relative_angle=st.floats(-math.pi, math.pi),
    center_distance=st.floats(-2, 2),
)


def encoded(label: Affordances) -> dict[str, Tensor]:
    """One frame's targets."""
    return {spec.name: encode(spec, np.array([getattr(label, spec.name) or 0.0])) for spec in SPECS}


def perfect_outputs(targets: dict[str, Tensor]) -> dict[str, Tensor]:
    return {
        s.name: torch.nn.functional.one_hot(targets[s.name], s.outputs) * 40.0
        if s.discrete
        else targets[s.name][:, None]
        for s in SPECS
    }


@given(affordances)
def test_decoding_undoes_encoding(label: Affordances) -> None:
    decoded = decode(perfect_outputs(encoded(label)))
    assert decoded.speed_sign == label.speed_sign
    for name in {spec.name for spec in SPECS} - {"speed_sign"}:
        assert getattr(decoded, name) == pytest.approx(getattr(label, name), abs=1e-5)


def test_decoded_values_stay_in_their_ranges() -> None:
    outputs = perfect_outputs(encoded(Affordances()))
    outputs |= {spec.name: torch.tensor([[9.0]]) for spec in CONTINUOUS}
    decoded = decode(outputs)
    assert (decoded.vehicle_distance, decoded.center_distance) == (50.0, 2.0)
    assert decoded.relative_angle == pytest.approx(math.pi)


def test_only_angle_and_center_distance_hang_on_the_command() -> None:
    assert [spec.name for spec in CONDITIONAL] == ["relative_angle", "center_distance"]


def test_class_weights_are_inverse_to_the_counts_with_mean_one_over_the_samples() -> None:
    counts = np.array([90.0, 10.0, 0.0])
    weight = class_weights({"x": counts})["x"].numpy()
    assert weight[1] == pytest.approx(9 * weight[0])
    assert weight[2] == 0.0
    assert (weight * counts).sum() / counts.sum() == pytest.approx(1.0)


def test_the_loss_adds_all_six_in_scaled_units() -> None:
    targets = encoded(Affordances())
    outputs = perfect_outputs(targets)
    assert float(multitask_loss(outputs, targets)) == pytest.approx(0.0, abs=1e-6)
    outputs["center_distance"] = outputs["center_distance"] + 0.5
    outputs["vehicle_distance"] = outputs["vehicle_distance"] - 0.25
    assert float(multitask_loss(outputs, targets)) == pytest.approx(0.75, abs=1e-6)


def test_the_relative_angle_may_count_more_than_the_others() -> None:
    targets = encoded(Affordances())
    outputs = perfect_outputs(targets)
    outputs["relative_angle"] = outputs["relative_angle"] + 0.5
    outputs["center_distance"] = outputs["center_distance"] + 0.25
    weights = vars(LossWeights(relative_angle=5.0))
    assert float(multitask_loss(outputs, targets, task_weights=weights)) == pytest.approx(2.75, abs=1e-6)


@pytest.mark.parametrize(
    ("name", "limit"),
    [("vehicle_distance", 50.0), ("center_distance", 2.0), ("center_distance", -2.0), ("relative_angle", -math.pi)],
)
def test_an_output_beyond_a_limit_is_right_where_the_truth_is_at_it(name: str, limit: float) -> None:
    whole, half = dict[str, Any]({name: limit}), dict[str, Any]({name: limit / 2})
    at_limit, within = encoded(Affordances(**whole)), encoded(Affordances(**half))
    for targets, wrong_by in ((at_limit, 0.0), (within, 0.3)):
        beyond = task_losses({name: perfect_outputs(targets)[name] + math.copysign(0.3, limit)}, targets)[name]
        assert float(beyond) == pytest.approx(wrong_by, abs=1e-6)
    short = task_losses({name: perfect_outputs(at_limit)[name] - math.copysign(0.3, limit)}, at_limit)[name]
    assert float(short) == pytest.approx(0.3, abs=1e-6)


def test_a_rare_class_pulls_harder() -> None:
    targets = encoded(Affordances(hazard_stop=1.0))
    outputs = perfect_outputs(encoded(Affordances(hazard_stop=0.0)))
    weights = class_weights({s.name: np.array([99.0] + [1.0] * (s.outputs - 1)) for s in DISCRETE})
    unweighted = task_losses(outputs, targets)["hazard_stop"]
    assert task_losses(outputs, targets, weights)["hazard_stop"] > 10 * unweighted


def test_there_is_a_weight_for_the_loss_of_each_affordance_and_of_the_segmentation() -> None:
    assert vars(LossWeights()).keys() == {spec.name for spec in SPECS} | {SEGMENTATION}


def test_mean_iou_counts_each_class_alike() -> None:
    target, always_first = torch.tensor([0, 0, 0, 1]), torch.tensor([0, 0, 0, 0])
    assert mean_iou(always_first, target, 4) == pytest.approx((3 / 4 + 0) / 2)
    assert mean_iou(target, target, 4) == 1.0


def test_metrics_are_in_si_units_and_scaled() -> None:
    targets = encoded(Affordances(vehicle_distance=20.0))
    outputs = perfect_outputs(encoded(Affordances(vehicle_distance=25.0)))
    figures = metrics(outputs, targets)
    assert figures["vehicle_distance/mae"] == pytest.approx(5.0, abs=1e-4)
    assert figures["vehicle_distance/mae_scaled"] == pytest.approx(0.1, abs=1e-6)
    assert figures["speed_sign/iou"] is None  # of one frame


def test_what_never_occurred_has_no_iou() -> None:
    none, once = torch.zeros(4, dtype=torch.long), torch.tensor([0, 0, 0, 2])
    assert class_ious(confusion(none, once, 4)) == [0.75, None, 0.0, None]
    assert mean_iou(none, none, 4) is None
    assert mean_iou(once, once, 4) == 1.0
