"""`caldrive collect`: records what the oracle drives."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from caldrive.collection.config import CollectConfig
from caldrive.commands.answer import Answer, Output
from caldrive.progress import Progress


@dataclass(frozen=True, kw_only=True)
class Collect(Output):
    """Record episodes that the oracle drives; what is there already is kept."""

    recording: Annotated[CollectConfig, arg(name="")] = CollectConfig()
    out: Path = Path("out/recording")
    """Folder for the episodes."""
    workers: int = 2
    """Processes that record at the same time."""

    def run(self, progress: Progress) -> Answer:
        from caldrive.checks import require_writable_folder
        from caldrive.collection.collect import collect
        from caldrive.commands.tables import counts_table
        from caldrive.recordings.folder import class_counts
        from caldrive.recordings.reader import read_episode
        from caldrive.recordings.writer import episode_path

        require_writable_folder(self.out)
        for _ in collect(self.recording, self.out, self.workers, progress):
            pass
        counts = class_counts([read_episode(episode_path(self.out, k)) for k in range(self.recording.episodes)])
        return Answer({"out": str(self.out), "counts": counts}, counts_table(self.out, counts))
