"""The names that `from caldrive import ...` offers: there in any order, and known to type checkers."""

from __future__ import annotations

import ast
import pkgutil
import warnings
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

import caldrive

NAMES = [name for name in caldrive.__dict__["__all__"] if name != "__version__"]


def test_every_public_name_is_there() -> None:
    assert all(callable(getattr(caldrive, name)) for name in NAMES)


def test_every_public_name_is_there_whatever_was_imported_before() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what libraries complain of as they are imported
        for part in pkgutil.walk_packages(caldrive.__path__, "caldrive."):
            if "cluster" not in part.name and "__main__" not in part.name:
                import_module(part.name)
    assert [name for name in NAMES if isinstance(getattr(caldrive, name), ModuleType)] == []


def test_another_name_is_refused_with_those_that_are_there() -> None:
    with pytest.raises(AttributeError, match="caldrive has no 'Car'; it has Affordances, "):
        getattr(caldrive, "Car")  # noqa: B009 (mypy knows that it is not there)


def test_type_checkers_are_told_the_same_names_from_the_same_modules() -> None:
    tree = ast.parse(Path(caldrive.__file__).read_text())
    [block] = [node for node in tree.body if isinstance(node, ast.If) and isinstance(node.test, ast.Name)]
    told = {alias.asname: f"{node.module}.{alias.name}" for node in block.body if isinstance(node, ast.ImportFrom)
            for alias in node.names}  # fmt: skip
    assert told == {name: f"{home}.{name}" for home, names in caldrive._HOMES.items() for name in names}
