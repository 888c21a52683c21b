"""The page's charts, as options of ECharts: each signal over time, of one drive or of two on top of each other; and the
table of figures above them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from caldrive.driving.comfort import Column
from caldrive.results import Outcome
from caldrive.tune.config import CostWeights
from caldrive.tune.cost import cost
from caldrive.tune.signals import Drive
from caldrive.tune.ziegler_nichols import Ultimate

BLUE, ORANGE, GREEN = "#1f5fa8", "#d9822b", "#2e8b57"
COLUMNS = ("", "time", "|centre|", "RMS jerk", "broken rules", "cost")  # of the table
DIGITS = 4  # after the point, that the browser gets


@dataclass(frozen=True)
class Chart:
    """A chart's title and unit, what its axis shows at least, and its lines: signal, name and colour of each."""

    title: str
    unit: str
    least: tuple[float, float]
    lines: tuple[tuple[str, str, str], ...]


CHARTS: tuple[Chart, ...] = (
    Chart("Speed", "km/h", (0, 30), (("speed", "speed", BLUE), ("target", "target", ORANGE))),
    Chart("Distance to the car ahead", "m", (0, 50), (("vehicle_distance", "distance", BLUE),)),
    Chart("Throttle and brake", "", (0, 1), (("throttle", "throttle", GREEN), ("brake", "brake", ORANGE))),
    Chart("Steering, + left", "", (-1, 1), (("steer", "steer", BLUE),)),
    Chart("Distance to the centre line, + where it lies left", "m", (-0.2, 0.2), (("center_distance", "", BLUE),)),
    Chart("Relative angle, + left", "°", (-4, 4), (("relative_angle", "", BLUE),)),
    Chart("Acceleration", "m/s²", (-2, 2), (("acceleration", "", BLUE),)),
    Chart("Jerk", "m/s³", (-4, 4), (("jerk", "along the road", BLUE), ("lateral_jerk", "across it", ORANGE))),
)


def chart_options(chart: Chart, drives: Mapping[str, Drive]) -> dict[str, Any]:
    """Options of a chart. drives: by name, the one that is tuned last; one before it is dashed and pale."""
    series = [
        _line(" ".join(filter(None, (name, label))), drive.signals.time, getattr(drive.signals, signal), color)
        for name, drive in drives.items()
        for signal, label, color in chart.lines
    ]
    for line in series[: -len(chart.lines)]:
        line["lineStyle"] = {"width": 1.3, "type": "dashed", "opacity": 0.55}
    options = _options(chart.title, chart.unit, series)
    values = [value for line in series for _, value in line["data"] if value is not None]
    low, high = chart.least
    inside = low <= min(values, default=low) and max(values, default=high) <= high
    options["yAxis"] |= {"min": low, "max": high} if inside else {"scale": False}  # else in round numbers from 0 on
    return options


def oscillation_options(found: Ultimate, dt: float) -> dict[str, Any]:
    """Options of a chart of the responses at gains near half of the ultimate one, at it, and above it."""
    series = []
    for share, color in ((0.5, GREEN), (1.0, BLUE), (1.2, ORANGE)):
        gain = min(found.responses, key=lambda tried: abs(tried - share * found.gain))
        values = found.responses[gain][: round(8 * found.period / dt)]
        series.append(_line(f"K_p = {gain:.3g}", np.array([k * dt for k in range(len(values))]), values, color))
    return _options("", "km/h", series)


def _line(name: str, time: Column, values: Column, color: str) -> dict[str, Any]:
    """A series of ECharts; what is no number leaves a gap."""
    points = [
        [round(float(t), 2), round(float(v), DIGITS) if np.isfinite(v) else None]
        for t, v in zip(time, values, strict=True)
    ]
    return {
        "name": name, "type": "line", "showSymbol": False, "color": color, "lineStyle": {"width": 1.8}, "data": points,
    }  # fmt: skip


def _options(title: str, unit: str, series: Sequence[dict[str, Any]]) -> dict[str, Any]:
    small = {"fontSize": 11}
    ends = [line["data"][-1][0] for line in series]
    return {
        "animation": False,
        "title": {"text": title, "left": 8, "top": 4, "textStyle": {"fontSize": 13, "fontWeight": 600}},
        "legend": {"right": 8, "top": 4, "itemHeight": 8, "textStyle": small, "show": len(series) > 1},
        "grid": {"left": 48, "right": 14, "top": 44, "bottom": 24},
        "tooltip": {"trigger": "axis"},
        "xAxis": {
            "type": "value", "min": 0, "max": max(ends, default=1.0),
            "axisLabel": {**small, "formatter": "{value} s", "showMaxLabel": False},
        },
        "yAxis": {"type": "value", "name": unit, "scale": True, "axisLabel": small},
        "series": list(series),
    }  # fmt: skip


def figures(drive: Drive) -> dict[str, str]:
    """A drive's row of the table, without its name."""
    seen, parts = drive.signals, cost(drive)
    broken = [infraction.kind.value for infraction in drive.result.infractions if infraction.at_fault]
    reached = drive.result.outcome is Outcome.SUCCESS
    values = (
        f"{drive.result.duration:.1f} s" if reached else drive.result.outcome.value,
        f"{abs(seen.center_distance).mean():.3f} m",
        f"{float((seen.jerk**2).mean()) ** 0.5:.2f} m/s³",
        ", ".join(broken) or "none",
        f"{parts.total(CostWeights()):.3f}",
    )
    return dict(zip(COLUMNS[1:], values, strict=True))
