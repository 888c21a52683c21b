"""The page's charts, as options of ECharts: each signal over time, of one drive or of two on top of each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from caldrive.driving.comfort import Column
from caldrive.tune.signals import Drive
from caldrive.tune.ziegler_nichols import Response, Ultimate

BLUE, ORANGE, GREEN, GREY = "#1f5fa8", "#d9822b", "#2e8b57", "#8a8f98"
DIGITS = 4  # significant ones that the browser gets


@dataclass(frozen=True)
class Chart:
    """A chart's title, its unit, and its lines: signal, name and colour of each."""

    title: str
    unit: str
    lines: tuple[tuple[str, str, str], ...]
    least: float | None = None
    """Where its axis begins; None for where the values do."""
    most: float | None = None


CHARTS: tuple[Chart, ...] = (
    Chart("Speed", "km/h", (("speed", "speed", BLUE), ("target", "target", ORANGE)), 0.0),
    Chart("Distance to the car ahead", "m", (("vehicle_distance", "distance", BLUE),), 0.0),
    Chart("Throttle and brake", "", (("throttle", "throttle", GREEN), ("brake", "brake", ORANGE)), 0.0, 1.0),
    Chart("Steering, + left", "", (("steer", "steer", BLUE),), -1.0, 1.0),
    Chart("Distance to the centre line", "m", (("center_distance", "distance", BLUE),)),
    Chart("Relative angle", "°", (("relative_angle", "angle", BLUE),)),
    Chart("Acceleration", "m/s²", (("acceleration", "acceleration", BLUE),)),
    Chart("Jerk", "m/s³", (("jerk", "along the road", BLUE), ("lateral_jerk", "across it", ORANGE))),
)


def chart_options(chart: Chart, drives: Mapping[str, Drive]) -> dict[str, Any]:
    """Options of a chart. drives: by name, the one that is tuned last; those before it are dashed and pale."""
    present = list(drives)[-1] if drives else ""
    series = [
        _line(
            f"{name}: {label}" if len(drives) > 1 else label, seen.time, getattr(seen, signal), color, name != present
        )
        for name, seen in ((name, drive.signals) for name, drive in drives.items())
        for signal, label, color in chart.lines
    ]
    end = max((float(drive.signals.time[-1]) for drive in drives.values()), default=1.0)
    return _options(chart.title, chart.unit, series, end) | {
        "yAxis": {"type": "value", "name": chart.unit, "min": chart.least, "max": chart.most, "scale": True},
    }  # fmt: skip


def oscillation_options(found: Ultimate, dt: float) -> dict[str, Any]:
    """Options of a chart of the responses at gains near half of the ultimate one, at it, and above it."""
    wanted = {"half of K_u": 0.5, "K_u": 1.0, "above K_u": 1.2}
    series = []
    for (name, share), color in zip(wanted.items(), (GREEN, BLUE, ORANGE), strict=True):
        gain = min(found.responses, key=lambda tried: abs(tried - share * found.gain))
        values: Response = found.responses[gain][: round(8 * found.period / dt)]
        series.append(_line(f"{name} ({gain:.3g})", np.arange(len(values)) * dt, values, color, faded=False))
    end = float(series[0]["data"][-1][0])
    return _options("The loop at three gains", "km/h", series, end)


def _line(name: str, time: Column, values: Column, color: str, faded: bool) -> dict[str, Any]:
    """A series of ECharts; what is no number leaves a gap."""
    points = [
        [round(float(t), 2), float(f"{v:.{DIGITS}g}") if np.isfinite(v) else None]
        for t, v in zip(time, values, strict=True)
    ]
    style = {"width": 1.3, "type": "dashed", "opacity": 0.55} if faded else {"width": 1.8}
    return {
        "name": name, "type": "line", "showSymbol": False, "color": color, "lineStyle": style, "data": points,
    }  # fmt: skip


def _options(title: str, unit: str, series: Sequence[dict[str, Any]], end: float) -> dict[str, Any]:
    small = {"fontSize": 11}
    return {
        "animation": False,
        "title": {"text": title, "left": 8, "top": 4, "textStyle": {"fontSize": 13, "fontWeight": 600}},
        "legend": {"right": 8, "top": 4, "itemHeight": 8, "textStyle": small, "show": len(series) > 1},
        "grid": {"left": 48, "right": 14, "top": 44, "bottom": 24},
        "tooltip": {"trigger": "axis"},
        "xAxis": {"type": "value", "min": 0, "max": round(end, 1), "axisLabel": {**small, "formatter": "{value} s"}},
        "yAxis": {"type": "value", "name": unit, "scale": True, "axisLabel": small},
        "series": list(series),
    }
