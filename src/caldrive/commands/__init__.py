"""The verbs of the command line: each holds its options, calls one function and says what that found.

What a verb needs is imported when it runs, so that `caldrive --help` waits for nothing.
"""

from __future__ import annotations

from typing import Annotated

from tyro.conf import subcommand

from caldrive.commands.answer import Answer
from caldrive.commands.benchmark import Benchmark
from caldrive.commands.collect import Collect
from caldrive.commands.data import Data
from caldrive.commands.determinism import Determinism
from caldrive.commands.drive import Drive
from caldrive.commands.evaluate import Evaluate
from caldrive.commands.replay import Replay
from caldrive.commands.report import Report
from caldrive.commands.speed import AgentSpeed, WorldSpeed
from caldrive.commands.town import Town
from caldrive.commands.train import Train

__all__ = ["Answer", "Command"]

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
