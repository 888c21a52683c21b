"""From the name of a call to the function that serves it; its annotations say what arguments it takes."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeVar, get_type_hints

import msgspec

from caldrive.carla_bridge.server.wire import Refusal, Request, refused, served

Function = TypeVar("Function", bound=Callable[..., Any])


class Call(NamedTuple):
    """A call that clients may make."""

    serve: Callable[..., Any]
    arguments: Any
    """Their type, a tuple; None where any will do."""
    least: int
    """How many have to be there."""
    is_void: bool
    is_bare: bool
    """Whether the result goes out as it is."""


def call(name: str, is_bare: bool = False) -> Callable[[Function], Function]:
    """Marks a method that serves a call. It takes the caller's number, then the call's arguments."""

    def marked(function: Function) -> Function:
        function.__dict__.setdefault("calls", []).append((name, is_bare))
        return function

    return marked


def calls_of(table: object) -> dict[str, Call]:
    """All calls that the methods of an object serve."""
    found = {}
    for _, method in inspect.getmembers(table, inspect.ismethod):
        for name, is_bare in getattr(method, "calls", ()):
            parameters = list(inspect.signature(method).parameters.values())[1:]
            least = sum(one.default is inspect.Parameter.empty for one in parameters)
            is_void = get_type_hints(method)["return"] is type(None)
            found[name] = Call(method, arguments_of(method), least, is_void, is_bare)
    return found


def arguments_of(method: Callable[..., Any]) -> Any:
    """What a method takes after its caller's number, as a tuple's type."""
    kinds = tuple(hint for name, hint in get_type_hints(method).items() if name not in ("caller", "return"))
    return tuple[kinds] if kinds else tuple[()]  # type: ignore[valid-type]


def converted(given: Any, kind: Any, what: str) -> Any:
    """Values in their type. Raises Refusal where they are others; what: whose values they are."""
    try:
        return msgspec.convert(given, kind)
    except (msgspec.ValidationError, RecursionError) as error:
        raise Refusal(
            f"found values of {what} that it does not take ({error}), wanted those of CARLA 0.9.16: use its client"
        ) from error


def serve(calls: Mapping[str, Call], caller: int, request: Request) -> Any:
    """What to answer a request with, wrapped; whatever a client asks for, it is served or refused in a sentence."""
    found = calls.get(request.method)
    if found is None:
        return refused(f"found a call {request.method[:80]!r}, wanted one of CARLA 0.9.16 that caldrive serves", False)
    try:
        result = found.serve(caller, *_arguments(found, request))
    except Refusal as refusal:
        return turned_down(str(refusal), found)
    return result if found.is_bare else served(result, found.is_void)


def turned_down(text: str, found: Call) -> Any:
    """What a client raises as RuntimeError with a text; who asks for a list of results finds it as the only one."""
    return [refused(text, False)] if found.is_bare else refused(text, found.is_void)


def _arguments(found: Call, request: Request) -> tuple[Any, ...]:
    """The arguments in their types. Raises Refusal where they are others."""
    given = request.arguments
    if found.arguments is None:
        return tuple(given)
    most = len(found.arguments.__args__)
    if not found.least <= len(given) <= most:
        raise Refusal(
            f"found {len(given)} arguments of {request.method}, wanted {most}: use the client of CARLA 0.9.16"
        )
    kinds = found.arguments if len(given) == most else tuple[found.arguments.__args__[: len(given)]]  # type: ignore[misc]
    values: tuple[Any, ...] = converted(given, kinds, request.method)
    return values
