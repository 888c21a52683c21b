"""The verbs of the command line: each holds its options, calls one function and says what that found.

What a verb needs is imported when it runs, so that `caldrive --help` waits for nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import or_
from typing import Annotated, Any

from tyro.conf import subcommand

from caldrive.commands.answer import Answer
from caldrive.commands.baselines import Baselines
from caldrive.commands.benchmark import Benchmark, Replay, Report
from caldrive.commands.check_carla import CheckCarla
from caldrive.commands.collect import Collect, Convert, Data
from caldrive.commands.drive import Determinism, Drive
from caldrive.commands.explain import Blame, ExplainCounterfactuals, ExplainDrive, ExplainPictures, ExplainRecording
from caldrive.commands.search import Search
from caldrive.commands.see import See
from caldrive.commands.serve_carla import ServeCarla
from caldrive.commands.speed import AgentSpeed, EnvSpeed, WorldSpeed
from caldrive.commands.town import Town
from caldrive.commands.train import Evaluate, Train
from caldrive.commands.tune import Tune

__all__ = ["GROUPS", "VERBS", "Answer", "command_type", "verb_kind", "verb_words"]


@dataclass(frozen=True)
class Verb:
    """A row of the command line: the class that holds the options, and a sentence for --help."""

    kind: type[Any]
    description: str


VERBS: Mapping[str, Verb] = {
    "drive": Verb(Drive, "Drive, film it, and say how it went."),
    "benchmark": Verb(Benchmark, "Drive a whole suite, and count."),
    "replay": Verb(Replay, "Drive a benchmark's episode again, and film it."),
    "report": Verb(Report, "Tables and a page on one or more benchmarks."),
    "blame": Verb(Blame, "Say which affordance is to blame for a benchmark's failures."),
    "explain drive": Verb(ExplainDrive, "Film where the network looks in a drive."),
    "explain pictures": Verb(ExplainPictures, "Film where it looks in your own video or pictures."),
    "explain recording": Verb(ExplainRecording, "Draw where it looks in recorded frames, and measure it."),
    "explain counterfactuals": Verb(ExplainCounterfactuals, "Change one thing in its pictures, and ask it again."),
    "collect": Verb(Collect, "Record what the oracle drives, for training."),
    "data": Verb(Data, "Check and describe a recording."),
    "convert": Verb(Convert, "Write a recording in a format that others' code reads."),
    "train": Verb(Train, "Train an agent's network on a recording."),
    "baselines": Verb(Baselines, "Train the paper's other three systems, every variant and seed."),
    "evaluate": Verb(Evaluate, "How well a network sees recorded frames."),
    "search": Verb(Search, "Search for better task blocks of the network."),
    "tune": Verb(Tune, "Tune the controller: on a page with live signals, or by a search."),
    "see": Verb(See, "Run the network on your own video or pictures; it knows only the embedded towns."),
    "serve-carla": Verb(ServeCarla, "Let CARLA's client drive in the embedded world."),
    "check-carla": Verb(CheckCarla, "Check whether a CARLA server is as caldrive needs it."),
    "town": Verb(Town, "Draw a town on one page, or its plan."),
    "speed world": Verb(WorldSpeed, "Camera steps a second, and where the time goes."),
    "speed agent": Verb(AgentSpeed, "Milliseconds from image to control."),
    "speed env": Verb(EnvSpeed, "Steps a second of the gymnasium environment."),
    "determinism": Verb(Determinism, "Drive the same episode twice and compare all bytes."),
}
GROUPS = {
    "explain": "Show where the network looks.",
    "speed": "Measure how fast the world, the agent or the gymnasium environment is.",
}  # first words of verbs of two words


def verb_words(arguments: Sequence[str]) -> str:
    """The verb at the beginning of a command line: one word, or two."""
    return " ".join(arguments[: 2 if arguments and arguments[0] in GROUPS else 1])


def verb_kind(verb: str, agent: str | None) -> type[Any]:
    """The class of a verb; where it is another one for each agent, that of the agent asked for. Raises ValueError where
    there is none for it."""
    kind = VERBS[verb].kind
    kinds: Mapping[str, type[Any]] = getattr(kind, "BY_AGENT", {})
    if agent is None or not kinds:
        return kind
    if agent not in kinds:
        raise ValueError(
            f"found agent {agent!r}, wanted one of {', '.join(kinds)} for caldrive {verb}: type --agent {min(kinds)}"
        )
    return kinds[agent]


def command_type(kinds: Mapping[str, type[Any]], defaults: Mapping[str, Any]) -> Any:
    """All verbs as one type for the parser. kinds: a verb's class, where it is not that of its row; defaults: its
    options, where they are not the usual ones."""
    choices = [_choice(name, kinds, defaults) for name in VERBS if " " not in name]
    for group, description in GROUPS.items():
        inside = [_choice(name, kinds, defaults) for name in VERBS if name.startswith(f"{group} ")]
        choices.append(Annotated[reduce(or_, inside), subcommand(group, description=description)])
    return reduce(or_, choices)


def _choice(name: str, kinds: Mapping[str, type[Any]], defaults: Mapping[str, Any]) -> Any:
    verb, more = VERBS[name], dict[str, Any]()
    if defaults.get(name) is not None:
        more["default"] = defaults[name]
    about = subcommand(name.rpartition(" ")[2], description=verb.description, **more)
    return Annotated[kinds.get(name, verb.kind), about]
