"""Constants from a file are numbers that the laws can reckon with."""

from __future__ import annotations

from pathlib import Path

import pytest

from caldrive.control.limits import require_constants
from caldrive.control.presets import PRESETS, controller_config


@pytest.mark.parametrize("name", PRESETS)
def test_the_presets_keep_within_the_limits(name: str) -> None:
    require_constants(PRESETS[name], name)


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("cap = 0.0", "cap"),
        ("cap = nan", "cap"),
        ("initial_limit = -5.0", "initial_limit"),
        ("[longitudinal]\nturn_speed = nan", "longitudinal.turn_speed"),
        ("[longitudinal]\nhazard_threshold = 7.0", "longitudinal.hazard_threshold"),
        ("[longitudinal.cruise]\nkp = inf\nki = 0.1", "longitudinal.cruise.kp"),
        ("[lateral]\nleft = [0.5, nan]", "lateral.left"),
        ("[lateral]\nmax_angle = 0.0", "lateral.max_angle"),
        ("[patience]\nred_rolls = -1", "patience.red_rolls"),
    ],
)
def test_a_constant_that_cannot_be_is_refused_by_its_name(text: str, name: str, tmp_path: Path) -> None:
    file = tmp_path / "laws.toml"
    file.write_text(text)
    with pytest.raises(ValueError, match=rf"^found {name} = .* in {file}, wanted .*: change it$"):
        controller_config(str(file), None)


def test_what_may_be_negative_or_infinite_is_taken(tmp_path: Path) -> None:
    file = tmp_path / "laws.toml"
    file.write_text("[longitudinal]\nfollow_d = -0.5\nturn_speed = inf\n")
    assert controller_config(str(file), 20.0).longitudinal.follow_d == -0.5
