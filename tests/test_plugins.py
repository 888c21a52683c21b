"""Other people's classes: found by file, module or entry point, and named where they are no use."""

from __future__ import annotations

import sys
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path

import pytest

from caldrive import plugins
from caldrive.plugins import find_plugin, full_name, load_plugin, short_name

CODE = """
from dataclasses import dataclass

@dataclass
class Driver:
    cap: float = 1.0

class Broken:
    def __init__(self):
        raise KeyError("engine")
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "own.py").write_text(CODE)
    return tmp_path / "own.py"


def test_a_class_in_a_file_is_made_with_what_it_takes(file: Path) -> None:
    plugin = load_plugin(f"{file}:Driver", "--agent")
    assert plugin.build(cap=3.0, dt=0.1).cap == 3.0
    assert plugin.takes("cap")
    assert not plugin.takes("dt")


def test_a_file_is_loaded_once_and_leaves_the_path_as_it_was(file: Path) -> None:
    before = list(sys.path)
    first, second = (load_plugin(f"{file}:Driver", "--agent") for _ in range(2))
    assert first.make is second.make
    assert sys.path == before


def test_a_files_neighbours_can_be_imported(file: Path) -> None:
    (file.parent / "neighbour_of_own.py").write_text("CAP = 7.0")
    (file.parent / "other.py").write_text("from neighbour_of_own import CAP\nclass Driver:\n    cap = CAP\n")
    assert load_plugin(f"{file.parent / 'other.py'}:Driver", "--agent").build().cap == 7.0


def test_a_class_of_a_module_is_found() -> None:
    assert load_plugin("fractions:Fraction", "--agent").build() == 0


@pytest.mark.parametrize(("kind", "known"), [("agent", "cal"), ("controller", "default"), ("world", "embedded")])
def test_an_offer_is_found_and_another_name_is_refused_with_all_that_there_are(
    kind: str, known: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    entries = EntryPoints([EntryPoint("half", "fractions:Fraction", f"caldrive.{kind}s")])
    monkeypatch.setattr(plugins, "entry_points", entries.select)
    assert find_plugin("half", kind, (known,)).name == "Fraction"
    with pytest.raises(
        ValueError, match=rf"found {kind} 'third', wanted one of {known}, half, .*type --{kind} {known}"
    ):
        find_plugin("third", kind, (known,))


def test_another_text_of_the_file_is_another_source(file: Path) -> None:
    first = load_plugin(f"{file}:Driver", "--agent").source
    assert load_plugin(f"{file}:Broken", "--agent").source == first
    file.write_text(CODE.replace("1.0", "2.0"))
    changed = load_plugin(f"{file}:Driver", "--agent")
    assert changed.source != first
    assert changed.build().cap == 2.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{file}:Nobody", r"found no class 'Nobody' in .*own\.py, wanted one of .*Driver.*type --agent"),
        ("{file}/none.py:Driver", "found no file .*type --agent FILE.py:CLASS"),
        ("no_such_module_here:Driver", "found no module 'no_such_module_here'"),
    ],
)
def test_what_is_not_there_is_named(text: str, message: str, file: Path) -> None:
    with pytest.raises(ValueError, match=message):
        load_plugin(text.format(file=file), "--agent")


def test_code_that_fails_is_named_with_its_line(file: Path) -> None:
    with pytest.raises(ValueError, match=r"Broken cannot be made \(KeyError: 'engine', own\.py line \d+\)"):
        load_plugin(f"{file}:Broken", "--agent").build()
    (file.parent / "bad.py").write_text("x = 1\ny = x +\n")
    with pytest.raises(ValueError, match=r"bad\.py cannot be loaded \(SyntaxError"):
        load_plugin(f"{file.parent / 'bad.py'}:Driver", "--agent")


def test_code_that_ends_the_program_is_named_with_its_line(file: Path) -> None:
    (file.parent / "leaving.py").write_text("import sys\nsys.exit(0)\n")
    with pytest.raises(ValueError, match=r"leaving\.py cannot be loaded \(SystemExit: 0, leaving\.py line 2\)"):
        load_plugin(f"{file.parent / 'leaving.py'}:Driver", "--agent")
    (file.parent / "late.py").write_text("class Driver:\n    def __init__(self):\n        raise SystemExit\n")
    with pytest.raises(ValueError, match=r"Driver cannot be made \(SystemExit"):
        load_plugin(f"{file.parent / 'late.py'}:Driver", "--agent").build()


FAULTS = {
    "syntax": (b"x = 1\ny = x +\n", r"SyntaxError: .*, fault\.py line 2\)"),
    "an import that is not there": (b"\nimport nosuch", r"No module named 'nosuch', fault\.py line 2\)"),
    "recursion without end": (b"def f():\n    f()\nf()", r"RecursionError: .*, fault\.py line 2\)"),
    "another encoding": (b"x = 1\ny = '\xe4'", r"SyntaxError: .*utf-8.*, fault\.py line \d\)"),
    "an unknown encoding": (b"# -*- coding: klingon -*-", r"unknown encoding: klingon, fault\.py line 0\)"),
    "null bytes": (b"x = 1\0", r"fault\.py cannot be loaded \(SyntaxError: .*null bytes"),
    "depth": (b"(" * 3000 + b")" * 3000, r"SyntaxError: too many nested parentheses, fault\.py line 1\)"),
    "an error of its own kind": (b"class E(BaseException): pass\nraise E", r"\(E: , fault\.py line 2\)"),
    "an error without words": (b"class E(Exception):\n  def __str__(s): 1/0\nraise E", r"\(E, fault\.py line 3\)"),
    "names that raise": (b"def __getattr__(name): raise OSError(name)", r"gives no 'Driver' \(OSError: Driver, fault"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_file_with_a_fault_is_named_with_its_line(fault: str, tmp_path: Path) -> None:
    code, message = FAULTS[fault]
    (tmp_path / "fault.py").write_bytes(code)
    with pytest.raises(ValueError, match=message):
        load_plugin(f"{tmp_path / 'fault.py'}:Driver", "--agent")


def test_a_file_too_large_for_code_is_refused_unread(tmp_path: Path) -> None:
    with (tmp_path / "huge.py").open("wb") as file:
        file.truncate(10**12)  # it takes no room on the disk
    with pytest.raises(ValueError, match=r"found 1000000 MB in .*huge\.py, wanted Python code of 10 MB"):
        load_plugin(f"{tmp_path / 'huge.py'}:Driver", "--agent")


@pytest.mark.parametrize("name", ["loop.py", "a" * 5000 + ".py", "nul\0.py"], ids=["circle", "long", "null byte"])
def test_a_name_that_no_file_can_have_is_no_file(name: str, tmp_path: Path) -> None:
    (tmp_path / "loop.py").symlink_to("loop.py")
    if "\0" not in name:
        assert full_name(f"{tmp_path / name}:Driver").endswith(f"{name}:Driver")
    with pytest.raises(ValueError, match=r"found no file .*wanted Python code"):
        load_plugin(f"{tmp_path / name}:Driver", "--agent")


def test_names_are_the_same_in_every_folder_and_short_in_tables(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(file.parent)
    assert full_name("own.py:Driver") == f"{file}:Driver"
    assert full_name("laws.toml") == str(file.parent / "laws.toml")
    assert [full_name(name) for name in ("oracle", "package.module:Class")] == ["oracle", "package.module:Class"]
    assert [short_name(name) for name in ("oracle", f"{file}:Driver", "/a/laws.toml")] == [
        "oracle", "Driver", "laws.toml"
    ]  # fmt: skip
