"""Behaviour has a version: numbers that change without it are found here."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from caldrive.provenance import BEHAVIOUR_VERSION, code_version
from tests.situations import KEPT, fixed, measured

KEPT_SITUATIONS: dict[str, Any] = json.loads(KEPT.read_text())
RAISE = "behaviour changed: raise BEHAVIOUR_VERSION in provenance.py, then type python -m tests.situations"
# Pictures: a grey level of a block; pixels of a class: an edge; network: what a grey level changes. The rest: 4 digits.
TOLERANCES = {"brightness": 1.5, "semantic": 40.0, "network": 0.02}


@pytest.fixture(scope="module")
def today() -> dict[str, list[float]]:
    return measured()


def tolerance(name: str) -> float:
    return next((value for begin, value in TOLERANCES.items() if name.startswith(begin)), 2e-3)


def test_the_kept_situations_are_of_this_version() -> None:
    assert KEPT_SITUATIONS["version"] == BEHAVIOUR_VERSION, "type python -m tests.situations"
    assert str(BEHAVIOUR_VERSION) in code_version()


def test_suites_routes_and_networks_are_those_of_this_version() -> None:
    assert fixed() == KEPT_SITUATIONS["fixed"], RAISE


def test_every_kept_situation_is_looked_at(today: dict[str, list[float]]) -> None:
    assert set(today) == set(KEPT_SITUATIONS["numbers"])


@pytest.mark.parametrize("name", sorted(KEPT_SITUATIONS["numbers"]))
def test_the_same_situation_gives_the_same_numbers(name: str, today: dict[str, list[float]]) -> None:
    kept = KEPT_SITUATIONS["numbers"][name]
    assert len(today[name]) == len(kept), RAISE
    assert np.abs(np.subtract(today[name], kept)).max() <= tolerance(name), RAISE
