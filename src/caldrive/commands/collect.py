"""The verbs of a recording: record what the oracle drives, check what was recorded, and give it to others."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro
from tyro.conf import arg

from caldrive.collection.config import CollectConfig
from caldrive.commands.answer import Answer, Configurable, Output
from caldrive.driving.settings import WorldSettings
from caldrive.progress import Progress


@dataclass(frozen=True, kw_only=True)
class Collect(WorldSettings, Configurable):
    """Record episodes that the oracle drives; what is there already is kept."""

    recording: Annotated[CollectConfig, arg(name="")] = field(default=CollectConfig(), metadata={"flat": True})
    out: Path = Path("out/recording")
    """Folder for the episodes."""
    workers: int = 2
    """Processes that record at the same time, here or with --ray local; a cluster uses all its processors. In CARLA,
    which has one world, there is always one."""
    ray: str | None = None
    """Record with Ray: local, auto for the cluster that this machine belongs to, or a cluster's address."""

    def run(self, progress: Progress) -> Answer:
        """Records what is missing; answers with the counts of labels."""
        from caldrive.checks import require_writable_folder
        from caldrive.collection.collect import collect
        from caldrive.commands.tables import counts_table
        from caldrive.recordings.folder import class_counts
        from caldrive.recordings.reader import read_episode
        from caldrive.recordings.writer import episode_path

        require_writable_folder(self.out)
        world = WorldSettings(world=self.world, host=self.host, port=self.port)
        for _ in collect(self.recording, self.out, self.workers, progress, self.ray, world):
            pass
        paths = (episode_path(self.out, k) for k in range(self.recording.episodes))
        counts = class_counts([read_episode(path, images=False) for path in paths])
        return Answer({"out": str(self.out), "counts": counts}, counts_table(self.out, counts))


@dataclass(frozen=True, kw_only=True)
class Data(Output):
    """Check every file and image of a recording, count its labels and draw their histograms."""

    picture: Path = Path("out/recording.png")
    """The PNG file for the histograms."""

    folder: tyro.conf.Positional[Path] = Path("out/recording")
    """Folder with the recorded episodes."""

    def run(self, progress: Progress) -> Answer:
        """Checks the recording; answers with what it holds, and 1 where a file is damaged."""
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


@dataclass(frozen=True, kw_only=True)
class Convert(Output):
    """Write a recording in a format that others' code reads; files that are there already are kept."""

    to: Literal["corl2017"] = "corl2017"
    """corl2017: the HDF5 files of the CARLA paper's imitation data, in folders SeqTrain and SeqVal. Images have to be
    200 x 88."""
    out: Path = Path("out/corl2017")
    """Folder for the files."""
    validation_share: float = 0.2
    """Share of the episodes that goes to SeqVal."""
    seed: int = 0
    """Decides which episodes go there."""

    folder: tyro.conf.Positional[Path] = Path("out/recording")
    """Folder with the recorded episodes."""

    def run(self, progress: Progress) -> Answer:
        """Writes what is missing; answers with how much there is."""
        from caldrive.checks import require_writable_folder
        from caldrive.recordings.corl2017_writer import write_corl2017

        require_writable_folder(self.out)
        written = write_corl2017(self.folder, self.out, self.validation_share, self.seed, progress)
        shown = f"{self.out}: {written.frames} frames in {written.files} files; {written.left_out} fill no further file"
        return Answer({"out": str(self.out)} | asdict(written), shown)
