"""The constants by name, their sliders, and the file that `--controller` reads back."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from caldrive.control.controller import ControlConfig
from caldrive.control.limits import require_constants
from caldrive.control.presets import DEFAULT, PAPER, controller_config
from caldrive.tune.config import SEARCHED
from caldrive.tune.constants import constants, controller_toml, values_of, with_values, write_controller

BY_NAME = {constant.name: constant for constant in constants()}
CHANGED = {
    "longitudinal.cruise.kp": 0.123, "longitudinal.turn_speed": math.inf, "lateral.left.damping": 0.2, "cap": 20.0,
    "patience.red_rolls": 5, "patience.enabled": False,
}  # fmt: skip


@pytest.mark.parametrize(
    "config", [DEFAULT, PAPER, with_values(DEFAULT, CHANGED), with_values(PAPER, {"initial_limit": 20.0})],
    ids=["default", "paper", "changed", "near the paper's"],
)  # fmt: skip
def test_a_controllers_file_is_read_back_as_it_was(config: ControlConfig, tmp_path: Path) -> None:
    write_controller(tmp_path / "own.toml", config)
    assert controller_config(str(tmp_path / "own.toml"), None) == config


def test_a_file_says_only_what_differs() -> None:
    assert controller_toml(replace(PAPER, initial_limit=20.0)) == 'preset = "paper"\ninitial_limit = 20.0\n'


def test_constants_change_by_name() -> None:
    assert values_of(with_values(DEFAULT, CHANGED)) == values_of(DEFAULT) | CHANGED
    assert with_values(DEFAULT, {}) == DEFAULT


def test_what_a_search_changes_has_sliders() -> None:
    assert set(SEARCHED) <= set(BY_NAME)


@pytest.mark.parametrize("name", BY_NAME)
def test_every_place_of_a_slider_can_be_driven_with(name: str) -> None:
    constant = BY_NAME[name]
    assert constant.about
    for position in (constant.low, constant.high):
        require_constants(with_values(DEFAULT, {name: constant.value_at(position)}), "a slider")


@pytest.mark.parametrize("config", [DEFAULT, PAPER], ids=["default", "paper"])
def test_a_slider_stands_at_its_constant(config: ControlConfig) -> None:
    present = values_of(config)
    for constant in constants(config):
        position = constant.position_of(present[constant.name])
        assert constant.low <= position <= constant.high
        assert constant.value_at(position) == present[constant.name]


def test_a_slider_reaches_as_far_as_the_controller_that_it_begins_with() -> None:
    [slider] = [one for one in constants(with_values(DEFAULT, {"initial_limit": 120.0})) if one.name == "initial_limit"]
    assert slider.low == 1.0
    assert slider.high == 200.0  # no limit may be higher


def test_the_right_end_of_a_cap_is_none() -> None:
    assert BY_NAME["cap"].value_at(BY_NAME["cap"].high) is None
    assert BY_NAME["longitudinal.turn_speed"].value_at(1e9) == math.inf
    assert BY_NAME["cap"].value_at(50) == 50.0
