"""Which affordance is to blame: every episode that went wrong again, with some affordances replaced by the truth.

An episode that goes well once an affordance is told was spoilt by that one. One that goes wrong with all of them told
is the controller's fault, or the world's. The other way round, an episode that goes wrong with a single affordance
seen, and all others told, needs no other mistake.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from caldrive.affordances import BY_NAME
from caldrive.benchmark.metrics import is_clean
from caldrive.benchmark.report.runs import BenchmarkRun, load_run
from caldrive.benchmark.run_folder import RunFolder, driver_provenance
from caldrive.benchmark.runner import benchmark
from caldrive.benchmark.settings import BenchmarkSettings
from caldrive.benchmark.suites import Trial, to_json
from caldrive.checks import require_writable_folder
from caldrive.files import write_whole
from caldrive.progress import Progress, silent

ALL = "all"
SUITE = "suite.json"
MUST_AGREE = ("code", "model", "precision", "agent_source", "controller_source")  # for an episode to come again


@dataclass(frozen=True)
class Telling:
    """A way to drive an episode again."""

    name: str
    """Of its folder."""
    truth: tuple[str, ...]
    """The affordances that are told."""


def tellings() -> list[Telling]:
    """Each affordance told, all of them, and all but each."""
    told = [Telling(f"told-{name}", (name,)) for name in BY_NAME]
    seen = [Telling(f"seen-{name}", tuple(other for other in BY_NAME if other != name)) for name in BY_NAME]
    return [*told, Telling(f"told-{ALL}", tuple(BY_NAME)), *seen]


@dataclass(frozen=True)
class Blame:
    """What the failures of a run come from, by the keys of their episodes."""

    failures: tuple[str, ...]
    """Those that missed their goal or broke a rule of their own fault."""
    rescued: Mapping[str, tuple[str, ...]]
    """Those that go well once an affordance is told, by its name; `all` for all of them."""
    spoilt: Mapping[str, tuple[str, ...]]
    """Those that go wrong where an affordance alone is seen."""

    @property
    def rest(self) -> tuple[str, ...]:
        """Those of the controller and of the world: they go wrong with all affordances told."""
        return tuple(key for key in self.failures if key not in self.rescued[ALL])

    def of(self, key: str) -> str:
        """What an episode's failure comes from, in words."""
        if key in self.rest:
            return "the controller or the world: it fails with the truth, too"
        names = [BY_NAME[name].title for name in BY_NAME if key in self.rescued[name]]
        if not names:
            return "several affordances together"
        return f"{' or '.join(names)}: the truth of it rescues the episode"


def blame(
    run: Path, out: Path, workers: int = 2, ray: str | None = None, progress: Progress = silent
) -> tuple[Blame, BenchmarkRun]:
    """Drives every failure of a run again in each of the ways of `tellings`; what `out` holds already is kept.

    run: a benchmark's folder. Raises ValueError where that was driven by other code or another network than would drive
    now, and where its agent has no affordances.
    """
    folder, whole = RunFolder(run), load_run(run)
    failed = [failure.result.trial for failure in whole.failures]
    if not failed:
        return Blame((), dict.fromkeys((*BY_NAME, ALL), ()), dict.fromkeys(BY_NAME, ())), whole
    _require_same(folder)
    require_writable_folder(out)
    suite, content = out / SUITE, to_json(failed).encode()
    if not (suite.is_file() and suite.read_bytes() == content):
        write_whole(suite, content)
    ways = tellings()
    for number, way in enumerate(ways):
        settings = _settings(folder, way, out, workers=workers, ray=ray)
        for state in benchmark(settings):
            done = (number + state.done / state.total) / len(ways)
            progress(f"{way.name.replace('-', ' ')}: {state.done} of {state.total}", done)
    return read_blame(out), whole


def _require_same(folder: RunFolder) -> None:
    """Raises ValueError where a run's episodes would not come again."""
    now = driver_provenance(folder.driver)
    for name in MUST_AGREE:
        if folder.description.get(name) != now.get(name):
            raise ValueError(
                f"found in {folder.path} results with {name} {folder.description.get(name)}, wanted {now.get(name)}, "
                "as an episode must go as before to be blamed on something: drive the benchmark again"
            )


def _settings(folder: RunFolder, way: Telling, out: Path, *, workers: int, ray: str | None) -> BenchmarkSettings:
    """How the failures are driven in one way. Who was blind to an affordance sees it once it is told."""
    driver = folder.driver
    truth = tuple(dict.fromkeys((*driver.truth, *way.truth)))
    senses = {"truth": truth, "blind": tuple(name for name in driver.blind if name not in truth)}
    return BenchmarkSettings(
        **vars(driver) | senses, signs=driver.cap is None, suite=str(out / SUITE), out=out / way.name, workers=workers,
        ray=ray,
    )  # fmt: skip


def read_blame(out: Path) -> Blame:
    """What `blame` found. Raises ValueError where it is not finished."""
    went_well = {way.name: _clean(out / way.name) for way in tellings()}
    failures = tuple(trial.key for trial in _trials(out))
    return Blame(
        failures=failures,
        rescued={name: tuple(filter(went_well[f"told-{name}"].__contains__, failures)) for name in (*BY_NAME, ALL)},
        spoilt={name: tuple(key for key in failures if key not in went_well[f"seen-{name}"]) for name in BY_NAME},
    )


def _trials(out: Path) -> Sequence[Trial]:
    return RunFolder(out / f"told-{ALL}").trials


def _clean(folder: Path) -> set[str]:
    """The keys of a folder's episodes that went well. Raises ValueError where some are not driven yet."""
    run = RunFolder(folder)
    if missing := run.missing():
        raise ValueError(
            f"found {len(missing)} episodes in {folder} that are not driven, wanted all: type caldrive blame as before"
        )
    return {result.trial.key for result in run.results() if is_clean(result)}
