"""What a search for constants found, as a page (Markdown), and the controller's file."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from caldrive.files import write_whole
from caldrive.formats import markdown_table
from caldrive.tune.auto import Judged, TuningResult, changed_constants
from caldrive.tune.config import TuneConfig
from caldrive.tune.constants import write_controller
from caldrive.tune.cost import Cost

PAGE = "report.md"
HEADS = ("where", "controller", "cost", "time", "jerk", "centre", "infractions")


def write_report(findings: TuningResult, config: TuneConfig, out: Path, controller: Path) -> Path:
    """Writes report.md into the search's folder, and the controller's file; returns the page's path."""
    write_controller(controller, findings.after.controller)
    page = out / PAGE
    write_whole(page, "\n\n".join(_sections(findings, config)).encode() + b"\n")
    return page


def cost_rows(findings: TuningResult, config: TuneConfig) -> list[tuple[str, ...]]:
    """Rows below HEADS: where it was tuned, and on other routes, before and after."""
    judged = {"before": findings.before, "after": findings.after}
    rows = [("where it was tuned", name, *_figures(one.tuned, config)) for name, one in judged.items()]
    return rows + [
        ("other routes", name, *_figures(one.others, config)) for name, one in judged.items() if one.others is not None
    ]


def constant_rows(findings: TuningResult) -> list[tuple[str, str, str]]:
    """The constants that changed: name, before and after."""
    return [(name, f"{old:.4g}", f"{new:.4g}") for name, (old, new) in changed_constants(findings).items()]


def report_values(findings: TuningResult, config: TuneConfig, controller: Path) -> dict[str, Any]:
    """The findings in JSON's types."""

    def values(judged: Judged) -> dict[str, Any]:
        parts = {"tuned": judged.tuned, "others": judged.others}
        return {
            name: asdict(one) | {"total": one.total(config.cost)} if one is not None else None
            for name, one in parts.items()
        }

    return {
        "controller": str(controller), "trials": findings.trials, "pruned": findings.pruned,
        "before": values(findings.before), "after": values(findings.after),
        "changed": {name: list(pair) for name, pair in changed_constants(findings).items()},
    }  # fmt: skip


def _figures(cost: Cost, config: TuneConfig) -> tuple[str, ...]:
    parts = (cost.total(config.cost), cost.time, cost.jerk, cost.center, cost.infractions)
    return tuple(f"{part:.3f}" for part in parts)


def _sections(findings: TuningResult, config: TuneConfig) -> Iterable[str]:
    weights = ", ".join(f"{name} {weight:g}" for name, weight in vars(config.cost).items())
    driven = [*config.maneuvers, *(f"route {k} of town01" for k in range(config.routes))]
    yield "# Search for the controller's constants"
    yield (
        f"{findings.trials} trials, of which {findings.pruned} were pruned; seed {config.seed}. Each drove "
        f"{', '.join(driven)} with the true affordances."
    )
    yield "## Mean cost of a drive"
    yield markdown_table(HEADS, cost_rows(findings, config))
    yield (
        f"cost: the sum of the parts, weighted ({weights}); time: share of the time limit; jerk: RMS, in units of 8.37 "
        "m/s³; centre: mean distance to the centre line, in units of 0.334 m; infractions: at fault, and goals missed."
    )
    yield "## Constants that changed"
    yield (
        markdown_table(("constant", "before", "after"), constant_rows(findings))
        if changed_constants(findings)
        else ("None: nothing was found that costs less.")
    )
