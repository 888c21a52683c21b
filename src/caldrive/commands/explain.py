"""The verbs that explain: whom to blame for a benchmark's failures."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

import tyro

from caldrive.commands.answer import Answer, Output
from caldrive.progress import Progress


@dataclass(frozen=True, kw_only=True)
class Blame(Output):
    """Drive a benchmark's failures again with affordances replaced by the truth: which of them is to blame."""

    folder: tyro.conf.Positional[Path]
    """A benchmark's folder."""
    out: Path | None = None
    """Folder for what is driven; without it `blame` in the benchmark's folder, where caldrive report finds it."""
    workers: int = 2
    """Processes that drive at the same time, here or with --ray local; a cluster uses all its processors."""
    ray: str | None = None
    """Drive with Ray: local, auto for the cluster that this machine belongs to, or a cluster's address."""

    def run(self, progress: Progress) -> Answer:
        """Drives what is missing; answers with how many failures each affordance is to blame for."""
        from caldrive.commands.tables import blame_table
        from caldrive.explain.blame import blame

        found, run = blame(self.folder, self.out or self.folder / "blame", self.workers, self.ray, progress)
        values = asdict(found) | {
            "episodes": len(run.results), "rest": found.rest, "blame": {key: found.of(key) for key in found.failures},
        }  # fmt: skip
        return Answer(values, blame_table(found, run.name, len(run.results)))
