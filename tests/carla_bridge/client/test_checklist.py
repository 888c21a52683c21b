"""What `check-carla` says of a server with which something is wrong."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from caldrive.carla_bridge.client import checklist as module
from caldrive.carla_bridge.client.checklist import Check, checklist


class Server:
    """A connection that answers; its map is none."""

    def __init__(self, *_: Any) -> None:
        self.client = SimpleNamespace(get_server_version=lambda: "0.9.16")
        self.map_name = "Odd"

    def synchronise(self) -> int:
        return 0

    def map_file(self) -> str:
        return "Odd.xodr"

    def close(self) -> None: ...


def rows(monkeypatch: pytest.MonkeyPatch, **parts: Any) -> dict[str, Check]:
    for name, part in {"Connection": Server, "_cleaned_up": lambda *_: "nothing", **parts}.items():
        monkeypatch.setattr(module, name, part)
    return {check.what: check for check in checklist("here", 2000)}


def test_a_map_that_cannot_be_read_is_a_row_and_the_last_one_but_cleaning_up(monkeypatch: pytest.MonkeyPatch) -> None:
    found = rows(monkeypatch)
    assert list(found) == ["version", "map", "cleaning up"]
    assert not found["map"].ok
    assert "Odd.xodr" in found["map"].found


def test_a_fault_of_one_look_is_a_row_and_the_others_are_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_: Any) -> str:
        raise AttributeError("no frame")

    visit = SimpleNamespace(town=SimpleNamespace(roads=SimpleNamespace(driveable=(), posts=(), signs=(), dropped=())))
    looks = {"clock": broken, "pace": lambda _: "quick"}
    found = rows(monkeypatch, Visit=lambda _: visit, LOOKS=looks)
    assert list(found) == ["version", "map", "clock", "pace", "cleaning up"]
    assert [check.ok for check in found.values()] == [True, True, False, True, True]
    assert found["clock"].found.startswith("found a fault (AttributeError: no frame), wanted")
