"""Work spread by Ray: by itself where it is installed, and by one that stands in for it."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import pytest

from caldrive.parallel.processes import GC_THRESHOLDS
from caldrive.parallel.ray_cluster import _call, cluster_map
from tests.parallel import fake_ray
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


@pytest.fixture
def usual_gc() -> Iterator[None]:
    """What stands in for Ray works in this process, and tunes it."""
    usual = gc.get_threshold()
    yield
    gc.set_threshold(*usual)


@pytest.mark.usefixtures("usual_gc")
def test_no_more_jobs_are_under_way_than_keep_the_processors_busy(monkeypatch: pytest.MonkeyPatch) -> None:
    ray = fake_ray.install(monkeypatch, processors=3)
    results = sorted(cluster_map(square, range(100), 1, "auto"))
    assert results == [(k, k * k) for k in range(100)]
    assert ray.most == 6
    assert (ray.address, ray.is_running) == ("auto", False)


@pytest.mark.usefixtures("usual_gc")
def test_jobs_are_begun_only_as_results_are_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    ray = fake_ray.install(monkeypatch, processors=1)
    work = cluster_map(square, range(10), 1, "local")
    next(work)
    assert ray.begun == 2
    next(work)
    assert ray.begun == 3
    work.close()  # type: ignore[attr-defined]
    assert not ray.is_running


@pytest.mark.usefixtures("usual_gc")
def test_the_error_of_a_worker_is_the_works_own(monkeypatch: pytest.MonkeyPatch) -> None:
    ray = fake_ray.install(monkeypatch)
    with pytest.raises(ValueError, match=r"^found 0$"):
        list(cluster_map(fails, [0], 2, "local"))
    assert not ray.is_running


def test_rays_workers_are_tuned_as_others_are() -> None:
    usual = gc.get_threshold()
    try:
        assert _call(lambda _: gc.get_threshold(), None) == GC_THRESHOLDS
    finally:
        gc.set_threshold(*usual)
