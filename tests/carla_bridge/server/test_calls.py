"""From the name of a call to what serves it."""

from __future__ import annotations

from typing import Any

import pytest

from caldrive.carla_bridge.server.calls import call, calls_of, serve
from caldrive.carla_bridge.server.layouts import Vector
from caldrive.carla_bridge.server.wire import Refusal, Request


class Table:
    """Some calls."""

    @call("add")
    def add(self, caller: int, at: Vector, more: float = 1.0) -> float:
        return at.x + more

    @call("quiet")
    def quiet(self, caller: int) -> None:
        raise Refusal("found noise")

    @call("bare", is_bare=True)
    def bare(self, caller: int) -> list[int]:
        return [caller]


def result(method: str, *arguments: Any) -> Any:
    return serve(calls_of(Table()), 9, Request(1, method, list(arguments)))


def test_arguments_come_in_their_types_and_the_last_may_be_left_out() -> None:
    assert result("add", [1, 2, 3]) == ((1, 2.0),)
    assert result("add", [1, 2, 3], 5) == ((1, 6.0),)
    assert result("bare") == [9]


@pytest.mark.parametrize("arguments", [(), ("x",), ([1, 2, "z"],), ([1, 2, 3], 1.0, 2.0), (5,)])
def test_arguments_of_other_types_are_refused_in_a_sentence(arguments: tuple[Any, ...]) -> None:
    ((kind, (text,)),) = result("add", *arguments)
    assert kind == 0
    assert text.startswith("found")


def test_a_refusal_of_a_call_without_a_result_has_the_form_of_one() -> None:
    assert result("quiet") == ((True, ("found noise",)),)


def test_a_call_that_nobody_knows_is_refused() -> None:
    assert result("fly")[0][0] == 0
