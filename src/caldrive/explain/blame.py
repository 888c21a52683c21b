"""Which affordance is to blame: every episode that went wrong again, with some affordances replaced by the truth.

An episode that goes well once an affordance is told was spoilt by that one. One that goes wrong with all of them told
is the controller's fault, or the world's. The other way round, an episode that goes wrong with a single affordance
seen, and all others told, needs no other mistake. For control each is also driven again as it was: where one goes well
then, nobody knows what made it so.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

from caldrive.affordances import BY_NAME, SPECS
from caldrive.agents.senses import has_perception
from caldrive.benchmark.metrics import is_clean
from caldrive.benchmark.report.runs import BenchmarkRun, Explanation, load_run
from caldrive.benchmark.result_lines import has_lines
from caldrive.benchmark.run_folder import RUN, RunFolder, driver_provenance
from caldrive.benchmark.runner import benchmark
from caldrive.benchmark.settings import BenchmarkSettings
from caldrive.benchmark.suites import Trial, to_json
from caldrive.checks import require_writable_folder
from caldrive.driving.settings import DriverSettings
from caldrive.driving.setup import set_up
from caldrive.files import write_whole
from caldrive.plugins import short_name
from caldrive.progress import Progress, silent

ALL, CONTROL = "all", "as-before"
ONE_OF, TOGETHER = "one of several affordances", "several affordances together"
ELSEWHERE, CHANCE = "the controller or the world", "chance"
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
    """None told, each affordance told, all of them, and all but each."""
    told = [Telling(f"told-{name}", (name,)) for name in BY_NAME]
    seen = [Telling(f"seen-{name}", tuple(other for other in BY_NAME if other != name)) for name in BY_NAME]
    return [Telling(CONTROL, ()), *told, Telling(f"told-{ALL}", tuple(BY_NAME)), *seen]


@dataclass(frozen=True)
class Blame:
    """What the failures of a run come from, by the keys of their episodes."""

    failures: tuple[str, ...]
    """Those that missed their goal or broke a rule of their own fault."""
    rescued: Mapping[str, tuple[str, ...]]
    """Those that go well once an affordance is told, by its name; `all` for all of them."""
    spoilt: Mapping[str, tuple[str, ...]]
    """Those that go wrong where an affordance alone is seen."""
    unlike: tuple[str, ...] = ()
    """Those that do not go as in the run although nothing is told."""
    by_chance: tuple[str, ...] = ()
    """Those among them that go well."""

    @property
    def rest(self) -> tuple[str, ...]:
        """Those of the controller and of the world: they go wrong with all affordances told."""
        return tuple(key for key in self.failures if self.blamed(key) == (ELSEWHERE,))

    def shares(self) -> dict[str, int]:
        """How many failures come from what, each counted once: an affordance by its title where its truth alone rescues
        an episode."""
        names = [*(spec.title for spec in SPECS), ONE_OF, TOGETHER, ELSEWHERE, CHANCE]
        counts = Counter(share_of(self.blamed(key)) for key in self.failures)
        return {name: counts[name] for name in names}

    def blamed(self, key: str) -> tuple[str, ...]:
        """What an episode's failure comes from: each affordance whose truth rescues it, by its title, or what else."""
        if key in self.by_chance:
            return (CHANCE,)
        if key not in self.rescued[ALL]:
            return (ELSEWHERE,)
        return tuple(spec.title for spec in SPECS if key in self.rescued[spec.name]) or (TOGETHER,)

    def of(self, key: str) -> str:
        """The same in words."""
        blamed = self.blamed(key)
        if blamed == (CHANCE,):
            return f"{CHANCE}: driven again with nothing told, it goes well"
        if blamed == (ELSEWHERE,):
            return f"{ELSEWHERE}: it fails with the truth, too"
        if blamed == (TOGETHER,):
            return TOGETHER
        return f"{' or '.join(blamed)}: the truth of it rescues the episode"


def share_of(blamed: Sequence[str]) -> str:
    """The one name under which a failure is counted; blamed: by `Blame.blamed`."""
    return blamed[0] if len(blamed) == 1 else ONE_OF


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
    _require_perception(folder.driver)
    _claim(out, to_json(failed).encode())
    ways = tellings()
    for number, way in enumerate(ways):
        settings = _settings(folder, way, out, workers=workers, ray=ray)
        for state in benchmark(settings):
            done = (number + state.done / state.total) / len(ways)
            progress(f"{way.name.replace('-', ' ')}: {state.done} of {state.total}", done)
    return read_blame(out, whole), whole


def _require_perception(driver: DriverSettings) -> None:
    """Raises ValueError where a driver has no affordances that could be told."""
    world, agent = set_up(driver)
    with closing(world):
        if not has_perception(agent):
            raise ValueError(
                f"found that the agent {short_name(driver.agent)} gives no affordances, wanted one that does, as blame "
                "replaces them by the truth: drive the benchmark with --agent cal, or give yours a perception"
            )


def _claim(out: Path, content: bytes) -> None:
    """Writes the failures as a suite. Raises ValueError where a folder has what was driven of others, which would then
    be of no use."""
    suite = out / SUITE
    if suite.is_file() and suite.read_bytes() == content:
        return
    if any(has_lines(out / way.name) for way in tellings()):
        raise ValueError(
            f"found in {out} what was driven of other failures, wanted those of now: give another --out, or remove it"
        )
    write_whole(suite, content)


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


def read_blame(out: Path, run: BenchmarkRun) -> Blame:
    """What `blame` found in the failures of a run. Raises ValueError where it is not finished."""
    went_well = {way.name: _clean(out / way.name) for way in tellings()}
    failures = tuple(trial.key for trial in _trials(out))
    before = {result.trial.key: result.episode for result in run.results}
    again = {result.trial.key: result.episode for result in RunFolder(out / CONTROL).results()}
    return Blame(
        failures=failures,
        rescued={name: tuple(filter(went_well[f"told-{name}"].__contains__, failures)) for name in (*BY_NAME, ALL)},
        spoilt={name: tuple(key for key in failures if key not in went_well[f"seen-{name}"]) for name in BY_NAME},
        unlike=tuple(key for key in failures if again[key] != before.get(key)),
        by_chance=tuple(filter(went_well[CONTROL].__contains__, failures)),
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
    explanations = {
        key: Explanation(found.of(key), share_of(found.blamed(key)), found.blamed(key), alone)
        for key, alone in spoilt.items()
    }
    if not found.unlike:
        return replace(run, explanations=explanations)
    note = f"driven again with nothing told, failures that did not go as before: {len(found.unlike)}"
    return replace(run, explanations=explanations, problems=(*run.problems, f"blame: {note}"))


def _blame_of(run: BenchmarkRun) -> Blame:
    """What is in a run's folder. Raises ValueError where that is not finished, or of other results."""
    out = run.folder / FOLDER
    found, about = read_blame(out, run), RunFolder(out / f"told-{ALL}").description
    same = all(about.get(name) == run.description.get(name) for name in MUST_AGREE)
    if not same or set(found.failures) != {failure.result.trial.key for failure in run.failures}:
        raise ValueError(
            f"found {out} of other results, wanted those of now: remove it, and type caldrive blame {run.folder}"
        )
    return found
