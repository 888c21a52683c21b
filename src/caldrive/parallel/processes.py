"""Work spread over several processes of one machine. A worker that dies takes nothing with it: its work is done
again by a new one."""

from __future__ import annotations

import gc
import os
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from multiprocessing import get_context, parent_process
from signal import SIG_DFL, SIGINT, signal
from threading import Thread
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

MAX_DEATHS = 3  # of workers, one after the other, while nothing gets done
GC_THRESHOLDS = (20_000, 10, 10)  # rarer garbage collections save a twenty-fifth of a worker's time


def parallel_map(work: Callable[[Item], Result], items: Sequence[Item], workers: int) -> Iterator[tuple[Item, Result]]:
    """Does the work on all items; yields each with its result as it is done. One worker is this process itself.

    A result may depend on its item only, not on what its process did before. Raises what the work raises, and
    RuntimeError where workers die again and again.
    """
    if workers == 1:
        yield from ((item, work(item)) for item in items)
        return
    missing, deaths = list(range(len(items))), 0
    while missing:
        before = len(missing)
        try:
            with closing(_pool_map(work, {k: items[k] for k in missing}, min(workers, before))) as results:
                for k, result in results:
                    missing.remove(k)
                    yield items[k], result
        except BrokenProcessPool as error:
            deaths = deaths + 1 if len(missing) == before else 0
            if deaths == MAX_DEATHS:
                raise RuntimeError(
                    f"found that workers die, {deaths} times in a row: type --workers 1 to see what happens"
                ) from error


def _pool_map(work: Callable[[Item], Result], items: dict[int, Item], workers: int) -> Generator[tuple[int, Result]]:
    """Numbers and results of the items as they are done by new workers. Raises BrokenProcessPool where one dies."""
    pool = ProcessPoolExecutor(workers, get_context("spawn"), initializer=_start_worker)
    try:
        jobs = {pool.submit(work, item): k for k, item in items.items()}
        yield from ((jobs.pop(job), job.result()) for job in as_completed(list(jobs)))  # results are not kept
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def tune_process() -> None:
    """Makes a worker fast."""
    gc.set_threshold(*GC_THRESHOLDS)


def _start_worker() -> None:
    """What a worker does first."""
    tune_process()
    _end_with_parent()


def _end_with_parent() -> None:
    """A worker whose parent was killed would wait for work for ever, and keep its memory. Ctrl-C ends it without a
    message: that is the parent's."""
    signal(SIGINT, SIG_DFL)
    parent = parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(1)

    Thread(target=watch, daemon=True).start()
