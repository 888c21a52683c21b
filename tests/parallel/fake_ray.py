"""Ray, as far as it is used, in this process: work and results travel as bytes, as between machines."""

from __future__ import annotations

import pickle
import sys
from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import pytest


class RayError(Exception):
    """What Ray raises where a worker fails."""


class RayTaskError(RayError):
    """What Ray raises where the work fails; cause: what the work raised."""

    def __init__(self, cause: Exception) -> None:
        self.cause = cause


class Job:
    """A job that is under way, or done, and whose result nobody took yet."""

    def __init__(self, content: bytes) -> None:
        self.content = content


class FakeRay:
    """A cluster of some processors. begun: jobs until now; most: that were under way at a time."""

    exceptions = SimpleNamespace(RayError=RayError, RayTaskError=RayTaskError)

    def __init__(self, processors: int) -> None:
        self.processors, self.begun, self.under_way, self.most = processors, 0, 0, 0
        self.address, self.is_running = "", False

    def init(self, address: str, **_: Any) -> None:
        self.address, self.is_running = address, True

    def shutdown(self) -> None:
        self.is_running = False

    def cluster_resources(self) -> dict[str, float]:
        return {"CPU": float(self.processors)}

    def remote(self, **_: Any) -> Callable[[Callable[..., Any]], Any]:
        return lambda function: SimpleNamespace(remote=lambda *values: self._begin(function, values))

    def _begin(self, function: Callable[..., Any], values: tuple[Any, ...]) -> Job:
        self.begun += 1
        self.under_way += 1
        self.most = max(self.most, self.under_way)
        return Job(pickle.dumps((function, values)))

    def wait(self, jobs: Sequence[Job], num_returns: int) -> tuple[list[Job], list[Job]]:
        return [jobs[-1]], list(jobs[:-1])  # the newest is the first that is done

    def get(self, job: Job) -> Any:
        self.under_way -= 1
        function, values = pickle.loads(job.content)
        try:
            return pickle.loads(pickle.dumps(function(*values)))
        except Exception as error:
            raise RayTaskError(error) from error


def install(monkeypatch: pytest.MonkeyPatch, processors: int = 2) -> FakeRay:
    """Puts it in Ray's place."""
    ray = FakeRay(processors)
    monkeypatch.setitem(sys.modules, "ray", ray)
    return ray
