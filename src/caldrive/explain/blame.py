"""Which affordance is to blame: every episode that went wrong again, with some affordances replaced by the truth.

An episode that goes well once an affordance is told was spoilt by that one. One that goes wrong with all of them told
is the controller's fault, or the world's. The other way round, an episode that goes wrong with a single affordance
seen, and all others told, needs no other mistake.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from caldrive.affordances import BY_NAME, SPECS
from caldrive.benchmark.metrics import is_clean
from caldrive.benchmark.report.runs import BenchmarkRun, Explanation, load_run
from caldrive.benchmark.run_folder import RUN, RunFolder, driver_provenance
from caldrive.benchmark.runner import benchmark
from caldrive.benchmark.settings import BenchmarkSettings
from caldrive.benchmark.suites import Trial, to_json
from caldrive.checks import require_writable_folder
from caldrive.files import write_whole
from caldrive.progress import Progress, silent

ALL = "all"
TOGETHER, ELSEWHERE = "several affordances together", "the controller or the world"
FOLDER, SUITE = "blame", "suite.json"  # in a run's folder, and in the other
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

    def blamed(self, key: str) -> tuple[str, ...]:
        """What an episode's failure comes from: each affordance whose truth rescues it, by its title, or what else."""
        if key in self.rest:
            return (ELSEWHERE,)
        return tuple(spec.title for spec in SPECS if key in self.rescued[spec.name]) or (TOGETHER,)

    def of(self, key: str) -> str:
        """The same in words."""
        blamed = self.blamed(key)
        if blamed == (ELSEWHERE,):
            return f"{ELSEWHERE}: it fails with the truth, too"
        if blamed == (TOGETHER,):
            return TOGETHER
        return f"{' or '.join(blamed)}: the truth of it rescues the episode"


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
    require_same(folder)
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


def require_same(folder: RunFolder) -> None:
    """Raises ValueError where a run's episodes would not come again."""
    now = driver_provenance(folder.driver)
    for name in MUST_AGREE:
        if folder.description.get(name) != now.get(name):
            raise ValueError(
                f"found in {folder.path} results with {name} {folder.description.get(name)}, wanted {now.get(name)}, "
                "as an episode must go as before to be explained: drive the benchmark again"
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
    missing = "all" if not (folder / RUN).is_file() else len(RunFolder(folder).missing())
    if missing:
        raise ValueError(
            f"found {missing} episodes in {folder} that are not driven, wanted none: type caldrive blame as before"
        )
    return {result.trial.key for result in RunFolder(folder).results() if is_clean(result)}


def with_blame(run: BenchmarkRun) -> BenchmarkRun:
    """A run with whom its failures are blamed on, where that is known in its folder; what is wrong with it becomes one
    of the run's problems."""
    if not (run.folder / FOLDER).is_dir():
        return run
    try:
        found = _blame_of(run)
    except ValueError as error:
        return replace(run, problems=(*run.problems, f"blame: {error}"))
    spoilt = {key: tuple(spec.title for spec in SPECS if key in found.spoilt[spec.name]) for key in found.failures}
    explanations = {key: Explanation(found.of(key), found.blamed(key), alone) for key, alone in spoilt.items()}
    return replace(run, explanations=explanations)


def _blame_of(run: BenchmarkRun) -> Blame:
    """What is in a run's folder. Raises ValueError where that is not finished, or of other results."""
    out = run.folder / FOLDER
    found, about = read_blame(out), RunFolder(out / f"told-{ALL}").description
    same = all(about.get(name) == run.description.get(name) for name in MUST_AGREE)
    if not same or set(found.failures) != {failure.result.trial.key for failure in run.failures}:
        raise ValueError(
            f"found {out} of other results, wanted those of now: remove it, and type caldrive blame {run.folder}"
        )
    return found
