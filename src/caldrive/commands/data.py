"""The verb `data`."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

import tyro

from caldrive.commands.answer import Answer, Output
from caldrive.progress import Progress


@dataclass(frozen=True, kw_only=True)
class Data(Output):
    """Check every file and image of a recording, count its labels and draw their histograms."""

    picture: Path = Path("out/recording.png")
    """The PNG file for the histograms."""

    folder: tyro.conf.Positional[Path] = Path("out/recording")
    """Folder with the recorded episodes."""

    def run(self, progress: Progress) -> Answer:
        from caldrive.checks import require_writable_file
        from caldrive.commands.tables import recording_table
        from caldrive.recordings.check import check_recording, draw_histograms

        require_writable_file(self.picture, "--picture", ".png")
        found, episodes = check_recording(self.folder, progress)
        if episodes:
            draw_histograms(episodes, found.counts, self.picture)
        picture = self.picture if episodes else None
        values = asdict(found) | {"picture": str(picture) if picture else None}
        return Answer(values, recording_table(found, picture), int(bool(found.damaged)))
