"""A benchmark's folder: what drove it (run.json), and a line for each episode that is done (results.jsonl).

Lines are appended and never changed, so a run that was killed holds all that it had finished. A folder takes results of
one agent, model, code and precision only.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import platform
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypedDict

from caldrive.driving.drivers import model_path
from caldrive.driving.settings import BenchmarkSettings, DriverSettings
from caldrive.driving.suites import SUITES, from_json
from caldrive.driving.trace import json_line, result_from_values
from caldrive.files import write_whole
from caldrive.provenance import code_version
from caldrive.typed import read_json
from caldrive.world.towns import TOWNS

RESULTS, RUN = "results.jsonl", "run.json"


class About(TypedDict):
    """What run.json says. model_file: the path of the network, where it is not the package's."""

    suite: str
    suite_content: str | None
    agent: str
    cap: float | None
    preset: str
    time_limit: str
    seed: int
    code: str
    model: str | None
    precision: str | None
    model_file: str | None
    began: str
    machine: str
    workers: int


class Line(TypedDict):
    """What a line of results.jsonl says of an episode."""

    key: str
    result: dict[str, Any]
    figures: dict[str, int | float | None]


def _digest(path: Path | None) -> str | None:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16] if path else None


def suite_content(path: Path) -> str:
    """Tells a suite of one's own from any other: a digest of its file and of the maps that it drives in."""
    maps = sorted({trial.scenario.town for trial in from_json(path)} - set(TOWNS))
    content = b"".join(one.read_bytes() for one in (path, *map(Path, maps)))
    return hashlib.sha256(content).hexdigest()[:16]


def provenance(driver: DriverSettings) -> dict[str, Any]:
    """What results depend on in the process that drives: code, network, and the precision in which it computes."""
    if driver.agent != "cal":
        return {"code": code_version(), "model": None, "precision": None}
    from caldrive.perception.checkpoint import load_network  # with torch, which the oracle does without
    from caldrive.perception.precision import driving_precision

    path = model_path(driver.model)
    precision = driving_precision("auto", load_network(path)[1])
    return {"code": code_version(), "model": _digest(path), "precision": precision}


def _machine() -> str:
    """The processor in words, and how many cores it has."""
    info = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").is_file() else ""
    names = [line.partition(":")[2].strip() for line in info.splitlines() if line.startswith("model name")]
    return f"{names[0] if names else platform.processor() or platform.machine()}, {os.cpu_count()} cores"


def _identity(settings: BenchmarkSettings, ours: dict[str, Any]) -> dict[str, Any]:
    """What a folder's results depend on. ours: this process' `provenance`."""
    own = Path(settings.suite) if settings.suite not in SUITES else None
    return {
        "suite": str(own.resolve()) if own else settings.suite, "suite_content": suite_content(own) if own else None,
        "agent": settings.agent, "cap": settings.pace, "preset": settings.preset,
        "time_limit": settings.time_limit, "seed": settings.seed,
        **ours,
    }  # fmt: skip


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """Keeps a folder for this process; two that write at once would lose lines. Raises ValueError where it is kept."""
    folder.mkdir(parents=True, exist_ok=True)
    file = os.open(folder, os.O_RDONLY)
    try:
        _lock(file, folder)
        yield
    finally:
        os.close(file)


def _lock(file: int, folder: Path) -> None:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise ValueError(
            f"found another benchmark at work in {folder}, wanted it alone: wait for it, or give another --out"
        ) from error


def claim(settings: BenchmarkSettings, ours: dict[str, Any]) -> None:
    """Writes down whose results a folder holds. ours: `provenance`. Raises ValueError where they are another's."""
    path, wanted = settings.out / RUN, _identity(settings, ours)
    if not path.is_file():
        if (settings.out / RESULTS).is_file():
            raise ValueError(f"found results in {settings.out}, but no {RUN} that says whose: give another --out")
        file = {
            "model_file": str(settings.model.resolve()) if settings.model else None,
            "began": datetime.now(UTC).isoformat(timespec="seconds"),
            "machine": _machine(), "workers": settings.workers,
        }  # fmt: skip
        write_whole(path, (json.dumps(wanted | file, indent=2) + "\n").encode())
        return
    found = read_run(settings.out)
    for name, value in wanted.items():
        if found.get(name) != value:
            raise ValueError(
                f"found in {settings.out} results with {name} {found.get(name)}, wanted {value}: give another --out"
            )


def read_run(folder: Path) -> dict[str, Any]:
    """What drove the results in a folder. Raises ValueError where there are none."""
    path = folder / RUN
    if not path.is_file():
        raise ValueError(f"found no {RUN} in {folder}, wanted a benchmark's folder: type caldrive benchmark --out DIR")
    try:
        return dict(read_json(path.read_bytes(), About))
    except ValueError as error:
        raise ValueError(
            f"found that {path} is damaged ({error}), wanted a run's description: type caldrive benchmark --out ANOTHER"
        ) from error


def require_same_suite(about: dict[str, Any]) -> None:
    """Raises ValueError where the file of a run's own suite is not what it was. about: the run's description."""
    if about["suite_content"] is None:
        return
    try:
        found = suite_content(Path(about["suite"]))
    except (ValueError, OSError) as error:
        found = str(error)
    if found != about["suite_content"]:
        raise ValueError(
            f"found that {about['suite']} or a map in it is not what was driven ({found}), wanted "
            f"{about['suite_content']}: put it back, or type caldrive benchmark --out ANOTHER"
        )


def read_lines(path: Path) -> dict[str, dict[str, Any]]:
    """The lines of a results file by trial. One that was being written when the run was killed is no line."""
    lines = path.read_bytes().split(b"\n")[:-1] if path.is_file() else []
    try:
        found = [_line(text) for text in lines]
        if twice := [key for key, n in Counter(one["key"] for one in found).items() if n > 1]:
            raise ValueError(f"{twice[0]} is there twice")
        return {one["key"]: one for one in found}
    except ValueError as error:
        raise ValueError(f"found a damaged line in {path} ({error}), wanted results: give another --out") from error


def _line(text: bytes) -> dict[str, Any]:
    """One line, which holds what results hold."""
    found = read_json(text, Line)
    result_from_values(found["result"])
    for name, value in found["figures"].items():
        if value is None and "/" not in name:  # of affordances nothing is known where nothing was seen
            raise ValueError(f"{name} is no number")
    return dict(found)


def append(path: Path, values: dict[str, Any]) -> None:
    """One more line, on the disk when this returns. Cuts off the rest of a line that was broken off."""
    with path.open("ab+") as file:
        file.seek(0)
        file.truncate(file.read().rfind(b"\n") + 1)
        file.write(json_line(values))
        file.flush()
        os.fsync(file.fileno())
