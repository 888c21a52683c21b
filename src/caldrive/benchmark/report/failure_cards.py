"""The page's failures: a card for each with its pictures and whom it is blamed on, and menus that filter the cards."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

from caldrive.benchmark.artifacts import read_still, still_paths
from caldrive.benchmark.metrics import succeeded
from caldrive.benchmark.report.runs import BenchmarkRun, Failure, FailureMoment, failures

ATTENTION = (
    "The second picture of a moment shows what the network looks at (HiResCAM), each on a scale of its own. Of a "
    "class, green to red says how likely the network finds it; of a number, orange makes it larger and blue smaller."
)


def failures_section(runs: Sequence[BenchmarkRun], room: int) -> str:
    """The section with all failures of some runs. room: bytes of HTML that their pictures may take."""
    failed, folders = failures(runs), {run.name: run.folder for run in runs}
    pictures = _chosen_pictures(failed, folders, room)
    cards = [_card(failure, pictures.get(k, "")) for k, failure in enumerate(failed)]
    text = (
        f'<p><span id="shown">{len(failed)}</span> of {len(failed)} episodes that missed their goal or broke a rule.'
        f" Pictures of {len(pictures)}, first of those that broke a rule; the folder of a run has all stills.</p>"
    )
    attention = any(moment.attention for failure in failed for moment in failure.explanation.moments)
    text += f"<p>{ATTENTION}</p>" if attention else ""
    menus = f'<p class="menus">{_filters(failed)}</p>'
    return f'<section id="failures"><h2>Failures</h2>{text}{menus}{"".join(cards)}</section>'


def by_importance(failed: Sequence[Failure]) -> list[int]:
    """The numbers of failures, who broke a rule before who only took too long."""
    return sorted(range(len(failed)), key=lambda k: not failed[k].result.episode.infractions)


def _chosen_pictures(failed: Sequence[Failure], folders: Mapping[str, Path], room: int) -> dict[int, str]:
    """The pictures of as many failures as fit into so many bytes, by the failures' numbers; one whose pictures are too
    large leaves its place to the next."""
    chosen, left = dict[int, str](), room
    for k in by_importance(failed):
        html = _pictures(failed[k], folders[failed[k].run]) if left > 0 else ""
        size = len(html.encode())
        if 0 < size <= left:
            chosen[k] = html
            left -= size
    return chosen


def _pictures(failure: Failure, folder: Path) -> str:
    """A failure's moments, or else the stills of its benchmark; empty where it has none."""
    moments = failure.explanation.moments or [
        FailureMoment("", "", read_still(path)) for path in still_paths(folder, failure.result.trial.key)
    ]
    return f'<div class="moments">{"".join(map(_moment, moments))}</div>' if moments else ""


def _moment(moment: FailureMoment) -> str:
    images = _image(moment.still, "still") + (_image(moment.attention, "attention") if moment.attention else "")
    caption = f"<b>{escape(moment.title)}</b> {escape(moment.text)}" if moment.title else ""
    return f"<figure>{images}<figcaption>{caption}</figcaption></figure>"


def _image(jpeg: bytes, name: str) -> str:
    """A JPEG inside the page."""
    return f'<img alt="{name}" src="data:image/jpeg;base64,{base64.b64encode(jpeg).decode()}">'


def _filters(failed: Sequence[Failure]) -> str:
    """A menu for each property by which failures are filtered."""
    choices = {
        "run": list(dict.fromkeys(failure.run for failure in failed)),
        "condition": list(dict.fromkeys(failure.result.trial.condition for failure in failed)),
        "task": list(dict.fromkeys(failure.result.trial.scenario.task for failure in failed)),
        "kind": [*sorted({kind for failure in failed for kind in _infraction_kinds(failure)}), "goal missed"],
        "blame": sorted({name for failure in failed for name in failure.explanation.blamed}),
    }
    return "".join(
        f'<label>{name} <select data-filter="{name}"><option value="">all</option>'
        + "".join(f"<option>{escape(value)}</option>" for value in values)
        + "</select></label>"
        for name, values in choices.items()
        if values
    )


def _infraction_kinds(failure: Failure) -> set[str]:
    return {infraction.kind.value for infraction in failure.result.episode.infractions}


def _card(failure: Failure, pictures: str) -> str:
    """What is shown of one failure."""
    trial, episode, why = failure.result.trial, failure.result.episode, failure.explanation
    infractions = [
        f"<li>{escape(infraction.kind.value)} at {infraction.time:.1f} s{'' if infraction.at_fault else ', by others'}"
        f"<small>wrong in the 3 s before: {escape(errors)}</small></li>"
        for infraction, errors in zip(episode.infractions, failure.errors_before, strict=True)
    ]
    kinds = sorted(_infraction_kinds(failure)) + ([] if succeeded(failure.result) else ["goal missed"])
    data = {
        "run": failure.run, "condition": trial.condition, "task": trial.scenario.task, "kind": "|".join(kinds),
        "blame": "|".join(why.blamed),
    }  # fmt: skip
    attributes = "".join(f' data-{name}="{escape(value)}"' for name, value in data.items())
    driven = f"{episode.route_done:.0f} of {episode.route_length:.0f} m in {episode.duration:.0f} s"
    cause = f"<p>{escape(str(failure.cause))}</p>" if failure.cause else ""
    blame = f'<p class="blame"><b>To blame</b> {escape(why.blame)}</p>' if why.blame else ""
    note = f"<small>{escape(why.note)}</small>" if why.note else ""
    return (
        f'<article class="card"{attributes}><h3>{escape(trial.key)} <em>{escape(failure.run)}</em></h3>'
        f"<p>{escape(episode.outcome.value)}; {driven}</p>{cause}<ol>{''.join(infractions)}</ol>{blame}{pictures}{note}"
        "</article>"
    )
