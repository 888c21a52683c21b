"""Work spread by Ray, where it is installed."""

from __future__ import annotations

import gc
import sys
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import pytest

from caldrive.parallel.processes import GC_THRESHOLDS
from caldrive.parallel.ray_cluster import _call, cluster_map
from tests.parallel.work import dies_at_first, fails, square

needs_ray = pytest.mark.skipif(find_spec("ray") is None, reason="Ray is not installed")


@needs_ray
def test_all_work_is_done_once_though_a_worker_dies(tmp_path: Path) -> None:
    results = sorted(cluster_map(partial(dies_at_first, tmp_path), range(4), 2, "local"))
    assert results == [(k, k * k) for k in range(4)]
    assert [path.name for path in tmp_path.iterdir()] == ["died-1"]


@needs_ray
def test_an_error_in_the_work_is_the_works_own() -> None:
    with pytest.raises(ValueError, match=r"^found 0$"):
        list(cluster_map(fails, [0], 2, "local"))


@needs_ray
def test_a_cluster_that_is_not_there_is_named() -> None:
    with pytest.raises(ValueError, match="found no Ray cluster at auto"):
        list(cluster_map(square, range(2), 2, "auto"))


def test_without_ray_the_message_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(RuntimeError, match=r"pip install 'caldrive\[ray\]'"):
        next(cluster_map(square, range(2), 2, "local"))


def test_rays_workers_are_tuned_as_others_are() -> None:
    usual = gc.get_threshold()
    try:
        assert _call(lambda _: gc.get_threshold(), None) == GC_THRESHOLDS
    finally:
        gc.set_threshold(*usual)
