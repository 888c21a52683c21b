"""Compiled code: it is kept for the next run, and made again when any of the sources changed."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from caldrive import compiled

PROGRAM = """
import numpy as np
from caldrive.geometry import boxes_of
from caldrive.world.traffic.gap_acceptance import Cars, may_walk
print(may_walk(np.zeros(2), (0.0, 1.0), 1.0, Cars(boxes_of([])), False))
"""


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Where the user's cache is; its last resort lies beside it."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    compiled.code_folder.cache_clear()
    yield tmp_path / "home"
    compiled.code_folder.cache_clear()


def run(home: Path) -> str:
    environment = os.environ | {"XDG_CACHE_HOME": str(home)}
    done = subprocess.run([sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "True\n"
    return done.stderr


def test_only_the_first_run_compiles_and_says_so(home: Path) -> None:
    assert "once" in run(home)
    (folder,) = (home / "caldrive").iterdir()
    assert len(list(folder.rglob("*.nbc"))) == 1
    assert run(home) == ""


RASTERISED = """
import hashlib
import numpy as np
from caldrive.world.rendering.rasteriser import POLYGON, rasterise
corners = np.random.default_rng(0).normal(size=(400, 3, 3)).astype(np.float32)
corners[..., 2] = 1 + abs(corners[..., 2])
depths, shown = np.empty((88, 200), np.float32), np.empty((88, 200), np.int32)
rasterise(corners, len(corners), depths, shown, np.empty((POLYGON, 4), np.float32))
assert len(np.unique(shown)) > 20
print(hashlib.sha256(depths.tobytes() + shown.tobytes()).hexdigest())
"""


def test_the_same_bytes_come_out_of_code_for_another_processor(tmp_path: Path) -> None:
    said = []
    for processor in ({}, {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "XDG_CACHE_HOME": str(tmp_path)}):
        done = subprocess.run(
            [sys.executable, "-c", RASTERISED], env=os.environ | processor, capture_output=True, text=True, check=True
        )
        said.append(done.stdout)
    assert said[0] == said[1]


def test_a_disk_without_room_for_the_code_is_no_obstacle(home: Path) -> None:
    resource_limit = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))\n"
    environment = os.environ | {"XDG_CACHE_HOME": str(home)}
    done = subprocess.run(
        [sys.executable, "-c", resource_limit + PROGRAM], env=environment, stdout=subprocess.PIPE, check=True
    )
    assert done.stdout == b"True\n"
    assert not list(home.rglob("*.nbc"))


def test_other_sources_have_another_folder_and_old_ones_are_removed(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folders = []
    for k in range(compiled.KEPT + 1):
        monkeypatch.setattr(compiled, "_state_of_sources", lambda k=k: f"{k}")
        compiled.code_folder.cache_clear()
        folder = compiled.code_folder()
        assert folder is not None
        os.utime(folder, (k, k))
        folders.append(folder)
    assert [folder.exists() for folder in folders] == [False] + [True] * compiled.KEPT


def test_a_change_of_any_source_is_another_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = tmp_path / "world" / "inlined.py"
    source.parent.mkdir()
    for path in (source, tmp_path / "compiled.py", tmp_path / "datatypes.py"):
        path.touch()
    monkeypatch.setattr(compiled, "__file__", str(tmp_path / "compiled.py"))
    before = compiled._state_of_sources()
    assert compiled._state_of_sources() == before
    source.write_text("WIDTH = 2")
    assert compiled._state_of_sources() != before


def test_without_a_folder_to_write_to_nothing_is_kept(home: Path) -> None:
    home.touch()
    (home.parent / "temporary" / f"caldrive-{os.getuid()}").touch()
    assert compiled.code_folder() is None
