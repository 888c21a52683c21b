"""Trials of a search by several processes: Optuna's studies, in a journal that all of them write."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

JOURNAL = "journal.log"


@dataclass(frozen=True)
class Draw:
    """How a trial's parameters are drawn: by which sampler, from the search's seed and the trial's own number."""

    sampler: Literal["random", "tpe"]
    seed: int
    number: int

    @property
    def own_seed(self) -> int:
        """The first numbers from seeds that lie side by side would not be independent."""
        return int(np.random.SeedSequence((self.seed, self.number)).generate_state(1)[0])


def require_optuna() -> Any:
    """Optuna itself, which keeps quiet. Raises RuntimeError where it is not installed."""
    try:
        import optuna
    except ImportError as error:
        raise RuntimeError("found no Optuna, wanted it for a search: type pip install 'caldrive[search]'") from error
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    return optuna


def mend_journal(out: Path) -> None:
    """Takes back what a killed process left of a line, and its lock. Only for who has the folder alone."""
    journal = out / JOURNAL
    journal.with_name(f"{JOURNAL}.lock").unlink(missing_ok=True)
    if journal.is_file():
        content = journal.read_bytes()
        whole = content.rfind(b"\n") + 1
        if whole < len(content):
            with journal.open("r+b") as file:
                file.truncate(whole)


def open_journal(
    out: Path,
    name: str,
    direction: Literal["minimize", "maximize"],
    draw: Draw,
    pruner: Mapping[str, int] | None = None,
) -> Any:
    """A study in a folder's journal, made if need be. draw: of the trial that it is asked for next; pruner: settings of
    Optuna's MedianPruner, None for none. Raises ValueError where the journal is damaged."""
    optuna, path = require_optuna(), str((out / JOURNAL).absolute())  # a lock is a link to it: it must lead there
    samplers = {"random": optuna.samplers.RandomSampler, "tpe": optuna.samplers.TPESampler}
    try:
        return optuna.create_study(
            storage=optuna.storages.JournalStorage(optuna.storages.journal.JournalFileBackend(path)),
            study_name=name,
            direction=direction,
            sampler=samplers[draw.sampler](seed=draw.own_seed),
            pruner=optuna.pruners.NopPruner() if pruner is None else optuna.pruners.MedianPruner(**pruner),
            load_if_exists=True,
        )
    except (ValueError, KeyError, TypeError, AssertionError) as error:
        raise ValueError(
            f"found that {out / JOURNAL} is damaged ({error}), wanted a search's journal: give another --out"
        ) from error


def abandon(study: Any) -> None:
    """Ends the trials of a study that were killed."""
    optuna = require_optuna()
    for trial in study.get_trials(deepcopy=False, states=(optuna.trial.TrialState.RUNNING,)):
        study.tell(trial.number, state=optuna.trial.TrialState.FAIL)


def finished(study: Any, own_number: str) -> list[Any]:
    """The trials of a study that are whole or pruned, one for each own number; own_number: the attribute with that, as
    Optuna's numbers also count those that were killed."""
    states = require_optuna().trial.TrialState
    trials = study.get_trials(deepcopy=False, states=(states.COMPLETE, states.PRUNED))
    by_number: dict[int, Any] = {}
    for trial in trials:  # a trial whose result got lost with another process is done again
        by_number.setdefault(trial.user_attrs[own_number], trial)
    return list(by_number.values())
