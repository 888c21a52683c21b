"""What is written for people and for files."""

from __future__ import annotations

import math
import tomllib

from caldrive.formats import markdown_table, toml


def test_a_cell_of_a_table_stays_in_it_whatever_it_holds() -> None:
    assert markdown_table(("a", "b"), [("1|2", "x\ny")]).splitlines() == ["| a | b |", "|---|---|", "| 1\\|2 | x y |"]


def test_toml_says_what_was_written() -> None:
    values = {
        "on": True, "deep": {"deeper": {"speeds": (1.5, math.inf)}, "n": 3}, "word": 'a "quoted" \\ one', "x": 0.1,
    }  # fmt: skip
    expected = values | {"deep": {"deeper": {"speeds": [1.5, math.inf]}, "n": 3}}
    assert tomllib.loads(toml(values)) == expected
