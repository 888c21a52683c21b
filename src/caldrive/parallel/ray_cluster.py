"""Work spread over one machine or many through Ray (the extra `ray`). A worker that dies is replaced.

Results wait in the memory of Ray's object store until they are taken. So no more jobs are under way at a time than keep
every processor busy: where whoever takes the results is slow, the workers wait for it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from typing import Any, TypeVar

from caldrive.parallel.processes import MAX_DEATHS, tune_process

Item = TypeVar("Item")
Result = TypeVar("Result")

LOCAL = "local"  # in the place of an address: Ray on this machine alone
JOBS_PER_PROCESSOR = 2  # under way: one that is done, and one that follows it at once


def cluster_map(
    work: Callable[[Item], Result], items: Sequence[Item], workers: int, address: str
) -> Iterator[tuple[Item, Result]]:
    """Does what `processes.parallel_map` does with Ray's workers.

    address: of a cluster, `auto` for the one that this machine belongs to, or `local` for so many workers on this
    machine alone. Raises RuntimeError where Ray is missing or workers die again and again, ValueError where there is no
    cluster.
    """
    ray = require_ray()
    _connect(ray, address, workers)
    try:
        remote = ray.remote(max_retries=MAX_DEATHS, num_cpus=1)(_call)
        waiting, jobs = iter(items), dict[Any, Item]()
        while True:
            jobs |= {remote.remote(work, item): item for item in islice(waiting, _most_jobs(ray) - len(jobs))}
            if not jobs:
                break
            done, _ = ray.wait(list(jobs), num_returns=1)
            yield jobs.pop(done[0]), ray.get(done[0])
    except ray.exceptions.RayTaskError as error:
        raise error.cause from None  # the work's own error, as without Ray
    except ray.exceptions.RayError as error:
        raise RuntimeError(
            f"found that Ray's workers fail ({type(error).__name__}): type --workers 1 without --ray to see why"
        ) from error
    finally:
        ray.shutdown()


def require_ray() -> Any:
    """Ray itself. Raises RuntimeError where it is not installed."""
    try:
        import ray
    except ImportError as error:
        raise RuntimeError("found no Ray, wanted it for --ray: type pip install 'caldrive[ray]'") from error
    return ray


def _most_jobs(ray: Any) -> int:
    """How many jobs may be under way. Asked each time, because machines may join a cluster, or leave it."""
    return max(1, int(JOBS_PER_PROCESSOR * ray.cluster_resources().get("CPU", 1)))


def _call(work: Callable[[Item], Result], item: Item) -> Result:
    """What one of Ray's workers does."""
    tune_process()
    return work(item)


def _connect(ray: Any, address: str, workers: int) -> None:
    """Starts Ray on this machine, or joins a cluster. Raises ValueError where there is none at the address."""
    quiet = {"log_to_driver": False, "logging_level": "ERROR"}
    if address == LOCAL:
        ray.init(address=LOCAL, num_cpus=workers, include_dashboard=False, **quiet)
        return
    try:
        ray.init(address=address, **quiet)
    except (ConnectionError, RuntimeError) as error:
        raise ValueError(
            f"found no Ray cluster at {address} ({error}), wanted one: type ray start --head there, or --ray {LOCAL}"
        ) from error
