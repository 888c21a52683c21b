"""What explains a driver, as tables for people."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.console import Group
from rich.table import Table
from rich.text import Text

from caldrive.affordances import SPECS
from caldrive.provenance import code_version

if TYPE_CHECKING:  # a table waits for neither torch nor SUMO
    from caldrive.explain.blame import Blame
    from caldrive.explain.counterfactual_study import Study
    from caldrive.explain.counterfactuals import Effect
    from caldrive.explain.observations import Finding
    from caldrive.explain.recorded import Figures


def blame_table(blame: Blame, name: str, episodes: int) -> Group:
    """A row for each affordance and for what else failures come from; the first column adds up to all of them."""
    table = Table("to blame", "failures", "rescued by its truth", "fail with it alone seen", box=SIMPLE_HEAD)
    by_title = {spec.title: spec.name for spec in SPECS}
    for title, count in blame.shares().items():
        of_it = by_title.get(title)
        more = (str(len(blame.rescued[of_it])), str(len(blame.spoilt[of_it]))) if of_it else ()
        table.add_row(title, str(count), *more)
    table.add_row("all of them", str(len(blame.failures)), str(len(blame.rescued["all"])))
    said = [f"{name}: {len(blame.failures)} of {episodes} episodes went wrong"]
    if blame.unlike:
        said.append(
            f"{len(blame.unlike)} of them did not go as before when they were driven again with nothing told: this "
            "agent does not do the same each time"
        )
    return Group(*map(Text, said), table)


def attention_table(figures: Sequence[Figures], out: Path) -> Group:
    """How true the attention is, a row for each situation."""
    said = Text(f"attention: {out}")
    if not figures:
        return Group(said)
    heads = ("situation", "frames", "points at it", "on it", "its area", "deletion", "insertion", "new weights")
    table = Table(*heads, box=SIMPLE_HEAD)
    for one in figures:
        where = ["" if value is None else f"{100 * value:.1f} %" for value in (one.pointing, one.energy, one.area)]
        curves = (one.network, one.random, one.centred)
        lost = " ".join(f"{curve.deletion:.2f}" for curve in curves)
        won = " ".join(f"{curve.insertion:.2f}" for curve in curves)
        cascade = " ".join(f"{value:.2f}" for value in one.cascade)
        table.add_row(one.situation, str(one.examples), *where, lost, won, cascade)
    note = "deletion, insertion: of the attention, of random maps, of the middle; new weights: rank correlation with it"
    return Group(table, Text(note), said)


def study_table(study: Study) -> Group:
    """The effect of each change, the verdict on each of the paper's observations, and where the sheet is."""
    missed = [f"{name}: {found - right} of {found}" for name, (found, right) in study.found.items() if found > right]
    gap = study.gap
    notes = [
        "probabilities of the class asked about, of a car ahead its distance in m; after: changed in all frames that "
        "the network looks at, last column: in the present one alone; intervals: 95 %, episodes drawn again",
        f"left out, as the network saw them wrong: {', '.join(missed) or 'none'}",
        f"at the wheel, in 8-bit integers, {gap.other_answers} of {gap.cases} answers are other ones; probabilities "
        f"differ by {gap.difference:.3f} on average",
        f"driven by {code_version()}; sheet: {study.sheet}",
    ]
    return Group(_effect_table(study.effects), _finding_table(study.findings), *map(Text, notes))


def _effect_table(effects: Sequence[Effect]) -> Table:
    """A row for each change; controls, which should change nothing, are dim."""
    heads = ("situation", "change", "cases", "before", "after", "difference", "flipped", "now alone")
    table = Table(*heads, box=SIMPLE_HEAD)
    for one in effects:
        change = f"{one.change} (control)" if one.control else one.change
        table.add_row(
            one.situation, change, str(one.cases), f"{one.before:.2f}", f"{one.after:.2f}",
            f"{one.difference:+.2f}{_interval(one.interval, 2)}", f"{one.flipped}/{one.cases}",
            f"{one.difference_now:+.2f} {one.flipped_now}/{one.cases}", style="dim" if one.control else "",
        )  # fmt: skip
    return table


def _finding_table(findings: Sequence[Finding]) -> Table:
    table = Table("the paper's observations", "cases", "value", "verdict", box=SIMPLE_HEAD)
    for one in findings:
        value = "-" if one.value is None else f"{one.value:+.3f}{_interval(one.interval, 3)}"
        table.add_row(one.statement, str(one.cases), value, one.verdict)
    return table


def _interval(interval: tuple[float, float] | None, digits: int) -> str:
    """An interval in brackets, nothing for none."""
    return "" if interval is None else " ({0:+.{2}f} to {1:+.{2}f})".format(*interval, digits)
