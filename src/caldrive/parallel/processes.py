"""Work for several processes on one machine. A worker that dies takes nothing with it: its work is done again."""

from __future__ import annotations

import gc
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context, parent_process
from signal import SIG_DFL, SIGINT, signal
from threading import Thread
from typing import TypeVar

T = TypeVar("T")

R = TypeVar("R")

MOST_DEATHS = 3  # of workers, one after the other, while nothing gets done


def _begin() -> None:
    """What a worker does first. Its core is its own: the threads with which llvmpipe draws would only take turns with
    it (a tenth of the time), and rubbish may lie for longer (a twenty-fifth)."""
    os.environ.setdefault("LP_NUM_THREADS", "0")
    gc.set_threshold(20_000, 10, 10)
    _end_with_parent()


def _end_with_parent() -> None:
    """A worker whose parent was killed would wait for work forever, and keep its memory. Ctrl-C ends it without a
    word: the parent has them."""
    signal(SIGINT, SIG_DFL)
    parent = parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(1)

    Thread(target=watch, daemon=True).start()


def spread(work: Callable[[T], R], items: Sequence[T], workers: int) -> Iterator[tuple[T, R]]:
    """Does the work on all items; yields each with its result as it is done. One worker is this process itself.

    What a work returns may depend on its item only, not on what its process did before. Raises RuntimeError where
    workers die again and again.
    """
    if workers == 1:
        yield from ((item, work(item)) for item in items)
        return
    left, deaths = list(range(len(items))), 0
    while left:
        before = len(left)
        try:
            count = min(workers, len(left))
            pool = ProcessPoolExecutor(count, get_context("spawn"), initializer=_begin)
            try:
                jobs = {pool.submit(work, items[k]): k for k in left}
                for job in as_completed(jobs):
                    result = job.result()
                    left.remove(jobs[job])
                    yield items[jobs[job]], result
            finally:
                pool.shutdown(wait=True, cancel_futures=True)
        except BrokenProcessPool as error:
            deaths = deaths + 1 if len(left) == before else 0
            if deaths == MOST_DEATHS:
                raise RuntimeError(
                    f"found that workers die, {deaths} times in a row: type --workers 1 to see what happens"
                ) from error
