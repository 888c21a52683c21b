"""The verbs of the command line: each holds its options, calls one function and says what that found.

What a verb needs is imported when it runs, so that `caldrive --help` waits for nothing.
"""

from __future__ import annotations

import sys
import time
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Annotated, Any

import tyro
from tyro.conf import subcommand

from caldrive.driving.settings import (
    AgentSpeedSettings,
    BenchmarkSettings,
    CollectSettings,
    DataSettings,
    DeterminismSettings,
    DriveSettings,
    EvaluateSettings,
    Progress,
    TrainSettings,
    WorldSpeedSettings,
)


@dataclass(frozen=True)
class Answer:
    """What a command found: values for --json, something to show to people, and the exit code."""

    values: dict[str, Any]
    shown: Any
    code: int = 0


@dataclass(frozen=True)
class Output:
    json: bool = False
    """Print the result as JSON, and nothing else."""


@dataclass(frozen=True)
class Drive(DriveSettings, Output):
    strict: bool = False
    """End with exit code 1 unless every episode reached its goal."""

    def run(self, progress: Progress) -> Answer:
        from caldrive.driving.drive import drive
        from caldrive.driving.tables import drive_table

        report = drive(self, progress)
        return Answer(report.values(), drive_table(report), int(self.strict and not report.all_reached))


@dataclass(frozen=True)
class Benchmark(BenchmarkSettings, Output):
    def run(self, progress: Progress) -> Answer:
        from caldrive.driving.benchmark import benchmark, read_results
        from caldrive.driving.measures import cells, rates
        from caldrive.driving.tables_benchmark import benchmark_table

        began, driven, good = time.perf_counter(), 0, 0
        for done, of, success in benchmark(self):
            driven, good = driven + 1, good + success
            pace = driven / (time.perf_counter() - began)
            left = (of - done) / pace / 60
            label = (
                f"{done} of {of}, {100 * good / driven:.0f} % reached, {60 * pace:.0f} a minute, {left:.0f} min left"
            )
            progress(label, done / of)
        found = read_results(self)
        values = {
            "out": str(self.out),
            "cells": [asdict(cell) | {"percent": cell.percent, "interval": cell.interval} for cell in cells(found)],
            "infractions": {rate.kind.value: {"count": rate.count, "km": rate.km} for rate in rates(found)},
        }
        return Answer(values, benchmark_table(found, str(self.out)))


@dataclass(frozen=True, kw_only=True)
class Replay(Output):
    folder: tyro.conf.Positional[Path]
    """A benchmark's folder."""
    episode: tyro.conf.Positional[str]
    """The episode's key, as in results.jsonl: town01-w01-navigation-10."""
    out: Path = Path("out/replay.mp4")
    """The video."""

    def run(self, progress: Progress) -> Answer:
        from caldrive.driving.replay import replay
        from caldrive.driving.trace import result_values

        found = replay(self.folder, self.episode, self.out, progress)
        broken = ", ".join(f"{one.kind.value} at {one.time:.1f} s" for one in found.result.infractions) or "none"
        said = f"{self.episode} {found.result.outcome.value}; infractions: {broken}; video: {found.video}"
        same = "as before" if found.same else "not as before: other code, another model or no earlier result"
        values = {"video": str(found.video), "same": found.same, "result": result_values(found.result)}
        return Answer(values, f"{said}; {same}", int(not found.same))


@dataclass(frozen=True, kw_only=True)
class Report(Output):
    folders: tyro.conf.Positional[tuple[Path, ...]]
    """Benchmarks' folders, side by side in the report."""
    out: Path = Path("out/report")
    """Folder for report.md and report.html."""

    def run(self, progress: Progress) -> Answer:
        from caldrive.driving.outputs import require_writable_folder
        from caldrive.driving.report import failures, load_runs, report_text
        from caldrive.driving.report_page import report_page
        from caldrive.files import write_whole

        if not self.folders:
            raise ValueError("found no folder, wanted a benchmark's: type caldrive report out/benchmark")
        runs = load_runs(self.folders)
        require_writable_folder(self.out)
        progress("writing", 0.2)
        write_whole(self.out / "report.md", report_text(runs).encode())
        write_whole(self.out / "report.html", report_page(runs).encode())
        values = {"out": str(self.out), "runs": [run.name for run in runs], "failures": len(failures(runs))}
        return Answer(values, f"report: {self.out / 'report.html'}, {self.out / 'report.md'}")


@dataclass(frozen=True)
class Town(Output):
    town: str = "town01"
    """town01, town02 or an OpenDRIVE file."""
    sheet: Path = Path("out/town.png")
    """The PNG file to write."""
    width: int | None = None
    """Its width in pixels."""

    def run(self, progress: Progress) -> Answer:
        from caldrive.driving.sheet import write_sheet

        progress("drawing", 0.0)
        width, height = write_sheet(self.town, self.sheet, self.width)
        values = {"town": self.town, "sheet": str(self.sheet), "width": width, "height": height}
        return Answer(values, f"{self.town} on one page: {self.sheet} ({width} x {height})")


@dataclass(frozen=True)
class WorldSpeed(WorldSpeedSettings, Output):
    def run(self, progress: Progress) -> Answer:
        from caldrive.driving.speed import measure_world

        speed = measure_world(self, progress)  # times the imports, too: nothing is loaded before it
        from caldrive.driving.tables import world_table

        return Answer(asdict(speed), world_table(speed))


@dataclass(frozen=True)
class AgentSpeed(AgentSpeedSettings, Output):
    def run(self, progress: Progress) -> Answer:
        from caldrive.driving.speed import measure_agent

        speed = measure_agent(self, progress)
        said = (
            f"from image to control: {speed.median_ms:.1f} ms at the median, {speed.p99_ms:.1f} ms in 99 of 100 cases"
        )
        return Answer(asdict(speed), f"{said} ({speed.width} x {speed.height})")


@dataclass(frozen=True)
class Determinism(DeterminismSettings, Output):
    def run(self, progress: Progress) -> Answer:
        from caldrive.driving.determinism import check_determinism

        found = check_determinism(self, progress)
        said = found.difference or f"equal in all {found.steps} steps, sha256 {found.digest[:16]}"
        return Answer(asdict(found) | {"equal": found.equal}, said, int(not found.equal))


@dataclass(frozen=True)
class Collect(CollectSettings, Output):
    def run(self, progress: Progress) -> Answer:
        from caldrive.config import CollectConfig
        from caldrive.driving.collection import collect
        from caldrive.driving.outputs import require_writable_folder
        from caldrive.driving.tables import counts_table
        from caldrive.perception.dataset import class_counts, find_episodes

        require_writable_folder(self.out)
        asked = {field.name: getattr(self, field.name) for field in fields(CollectConfig) if hasattr(self, field.name)}
        config = CollectConfig(**asked)
        for done, _ in enumerate(collect(config, self.out, self.workers), start=1):
            progress(f"recording, {done} done", done / self.episodes)
        counts = class_counts(find_episodes(self.out))
        return Answer({"out": str(self.out), "counts": counts}, counts_table(self.out, counts))


@dataclass(frozen=True)
class Train(TrainSettings, Output):
    def run(self, progress: Progress) -> Answer:
        from dataclasses import replace

        from caldrive.config import PERCEPTIONS, TRAININGS
        from caldrive.driving.outputs import require_writable_folder
        from caldrive.perception.backbone import imagenet_file
        from caldrive.perception.training import train

        require_writable_folder(self.out)
        if self.preset not in TRAININGS:
            raise ValueError(f"found preset {self.preset!r}, wanted one of {', '.join(TRAININGS)}: type --preset small")
        config = replace(TRAININGS[self.preset], seed=self.seed, device=self.device)
        config = config if self.steps is None else replace(config, steps=self.steps)
        imagenet = self.imagenet or (imagenet_file() if PERCEPTIONS[self.preset].width == 1.0 else None)
        model = train(config, self.data, self.out, PERCEPTIONS[self.preset], imagenet, sys.stderr.isatty())
        return Answer({"model": str(model)}, f"trained: caldrive drive --model {model}")


@dataclass(frozen=True)
class Data(DataSettings, Output):
    folder: tyro.conf.Positional[Path] = Path("out/recording")
    """Folder with the recorded episodes."""

    def run(self, progress: Progress) -> Answer:
        from caldrive.driving.outputs import require_writable_file
        from caldrive.driving.tables_seen import recording_table
        from caldrive.perception.recordings import check_recording, draw_histograms

        require_writable_file(self.picture, "--picture")
        found, episodes = check_recording(self.folder, lambda share: progress("checking", share))
        if episodes:
            draw_histograms(episodes, found.counts, self.picture)
        picture = self.picture if episodes else None
        values = asdict(found) | {"picture": str(picture) if picture else None}
        return Answer(values, recording_table(found, picture), int(bool(found.damaged)))


@dataclass(frozen=True)
class Evaluate(EvaluateSettings, Output):
    def run(self, progress: Progress) -> Answer:
        from caldrive.driving.drivers import model_path
        from caldrive.driving.outputs import require_writable_file
        from caldrive.driving.tables_seen import evaluation_table
        from caldrive.perception.checkpoint import load_network
        from caldrive.perception.dataset import Frames, find_episodes, held_out
        from caldrive.perception.report import PAPER, report

        if self.worst is not None:
            require_writable_file(self.worst, "--worst")
        network, info = load_network(model_path(self.model))
        episodes = find_episodes(self.data)
        if self.held_out:
            episodes = held_out(episodes, info.data)
        frames = Frames(episodes, (network.config.image_height, network.config.image_width))
        found = report(network, frames, self.worst, lambda share: progress("evaluating", share))
        return Answer(asdict(found) | {"paper": PAPER}, evaluation_table(found))


Speed = (
    Annotated[WorldSpeed, subcommand("world", description="Camera steps a second, and where the time goes.")]
    | Annotated[AgentSpeed, subcommand("agent", description="Milliseconds from image to control.")]
)
Command = (
    Annotated[Drive, subcommand("drive", description="Drive, film it, and say how it went.")]
    | Annotated[Benchmark, subcommand("benchmark", description="Drive a whole suite, and count.")]
    | Annotated[Replay, subcommand("replay", description="Drive a benchmark's episode again, and film it.")]
    | Annotated[Report, subcommand("report", description="Tables and a page on one or more benchmarks.")]
    | Annotated[Collect, subcommand("collect", description="Record what the oracle drives, for training.")]
    | Annotated[Train, subcommand("train", description="Train the network on a recording.")]
    | Annotated[Data, subcommand("data", description="Check and describe a recording.")]
    | Annotated[Evaluate, subcommand("evaluate", description="How well a network sees recorded frames.")]
    | Annotated[Town, subcommand("town", description="Draw a town on one page.")]
    | Annotated[Speed, subcommand("speed", description="Measure how fast the world or the agent is.")]
    | Annotated[
        Determinism, subcommand("determinism", description="Drive the same episode twice and compare all bytes.")
    ]
)
