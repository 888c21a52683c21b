"""The verbs of the benchmark: drive a suite, drive one of its episodes again, report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tyro

from caldrive.commands.answer import Answer, Output
from caldrive.progress import Progress


@dataclass(frozen=True, kw_only=True)
class Replay(Output):
    folder: tyro.conf.Positional[Path]
    """A benchmark's folder."""
    episode: tyro.conf.Positional[str]
    """The episode's key, as in results.jsonl: town01-w01-navigation-10."""
    out: Path = Path("out/replay.mp4")
    """The video."""

    def run(self, progress: Progress) -> Answer:
        from caldrive.benchmark.replay import replay
        from caldrive.results import result_values

        found = replay(self.folder, self.episode, self.out, progress)
        broken = ", ".join(f"{one.kind.value} at {one.time:.1f} s" for one in found.result.infractions) or "none"
        said = f"{self.episode} {found.result.outcome.value}; infractions: {broken}; video: {found.video}"
        same = "as before" if found.same else "not as before: other code, another model or no earlier result"
        values = {"video": str(found.video), "same": found.same, "result": result_values(found.result)}
        return Answer(values, f"{said}; {same}", int(not found.same))
