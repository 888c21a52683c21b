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
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

from caldrive.driving.drivers import model_path
from caldrive.driving.settings import BenchmarkSettings, DriverSettings
from caldrive.driving.suites import SUITES
from caldrive.driving.trace import json_line, result_from_values
from caldrive.files import write_whole

PACKAGE = Path(__file__).parents[1]
RESULTS, RUN = "results.jsonl", "run.json"
SAID = {
    "suite": str, "suite_content": str | None, "agent": str, "cap": float | None, "preset": str, "time_limit": str,
    "seed": int, "code": str, "model": str | None, "precision": str | None, "model_file": str | None, "began": str,
    "machine": str,
}  # fmt: skip


@lru_cache(maxsize=1)
def code_version() -> str:
    """Tells this code from any other: a digest of all sources and data of the package, its models left aside."""
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*")):
        if path.is_file() and path.suffix not in (".pyc", ".safetensors"):
            digest.update(str(path.relative_to(PACKAGE)).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def _digest(path: Path | None) -> str | None:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16] if path else None


def makings(driver: DriverSettings) -> dict[str, Any]:
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


def _identity(settings: BenchmarkSettings) -> dict[str, Any]:
    """What a folder's results depend on."""
    own = Path(settings.suite) if settings.suite not in SUITES else None
    return {
        "suite": str(own.resolve()) if own else settings.suite, "suite_content": _digest(own), "agent": settings.agent,
        "cap": settings.pace, "preset": settings.preset,
        "time_limit": settings.time_limit, "seed": settings.seed,
        **makings(DriverSettings(agent=settings.agent, model=settings.model)),
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


def claim(settings: BenchmarkSettings) -> None:
    """Writes down whose results a folder holds. Raises ValueError where they are another's."""
    path, wanted = settings.out / RUN, _identity(settings)
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
        found = dict(json.loads(path.read_text()))
        wrong = [name for name, kind in SAID.items() if not isinstance(found[name], kind)]
    except (ValueError, TypeError, KeyError) as error:
        wrong = [str(error)]
    if wrong:
        raise ValueError(
            f"found that {path} is damaged ({', '.join(wrong)}), wanted a run's description: "
            "type caldrive benchmark --out ANOTHER"
        )
    return found


def read_lines(path: Path) -> dict[str, dict[str, Any]]:
    """The lines of a results file by trial. One that was being written when the run was killed is no line."""
    lines = path.read_bytes().split(b"\n")[:-1] if path.is_file() else []
    try:
        return {one["key"]: one for one in map(_line, lines)}
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"found a damaged line in {path} ({error}), wanted results: give another --out") from error


def _line(text: bytes) -> dict[str, Any]:
    """One line, which holds what results hold."""
    found = dict(json.loads(text, parse_constant=_refuse))
    result_from_values(found["result"])
    return found | {"key": str(found["key"]), "figures": dict(found["figures"])}


def _refuse(constant: str) -> None:
    raise ValueError(f"{constant} is no number")


def append(path: Path, values: dict[str, Any]) -> None:
    """One more line, on the disk when this returns. Cuts off the rest of a line that was broken off."""
    with path.open("ab+") as file:
        file.seek(0)
        file.truncate(file.read().rfind(b"\n") + 1)
        file.write(json_line(values))
        file.flush()
        os.fsync(file.fileno())
