"""The page on which a controller is tuned by hand: sliders, live signals, two settings on top of each other (NiceGUI).

Each change drives the maneuver again, in a process of its own, and redraws; changes that come meanwhile wait for one
drive, not for one each.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from caldrive.control.controller import ControlConfig
from caldrive.datatypes import DT
from caldrive.tune.charts import CHARTS, COLUMNS, chart_options, figures, oscillation_options
from caldrive.tune.constants import Constant, constants, values_of, with_values, write_controller
from caldrive.tune.maneuvers import MANEUVERS, drive, route
from caldrive.tune.signals import Drive
from caldrive.tune.ziegler_nichols import RULES, Ultimate, find_ultimate, proposed, speed_response

ROUTES = 3  # of town01 to choose from


@lru_cache(maxsize=8)
def drive_named(name: str, config: ControlConfig) -> Drive:
    """What the process beside the page does. name: a maneuver's, or a route's number."""
    return drive(MANEUVERS[name] if name in MANEUVERS else route(int(name)), config)


@dataclass
class TuningPage:
    """One browser window: the constants on its sliders, the maneuver, the drives that it shows."""

    controller: ControlConfig
    path: Path
    maneuver: str = "speed"
    kept: ControlConfig | None = None
    """The setting that is kept for comparison."""
    drives: dict[str, Drive] = field(default_factory=dict)
    _stale: bool = False
    _busy: bool = False
    _ultimate: Ultimate | None = None

    def build(self) -> None:
        """Puts everything on the page."""
        from nicegui import ui

        self.ui, self.sliders = ui, dict[str, Any]()
        ui.query(".nicegui-content").classes("p-0")
        with ui.row(wrap=False).classes("w-full gap-0"):
            with ui.column().classes("w-96 h-screen overflow-y-auto p-3 gap-2 border-r shrink-0"):
                self._build_controls()
            with ui.column().classes("grow h-screen overflow-y-auto p-3 gap-2"):
                self._build_charts()
        ui.timer(0.1, self.redraw, once=True)

    def _build_controls(self) -> None:
        ui = self.ui
        titles = {name: maneuver.title for name, maneuver in MANEUVERS.items()}
        titles |= {str(k): f"route {k} of town01, among cars and people" for k in range(ROUTES)}
        ui.label("caldrive tune").classes("text-lg font-semibold")
        ui.select(titles, value=self.maneuver, label="Maneuver", on_change=self._choose).classes("w-full")
        with ui.row().classes("gap-2"):
            ui.button("Keep as A", on_click=self._keep).props("dense outline no-caps")
            ui.button("Back to A", on_click=self._back).props("dense outline no-caps")
            ui.button("Save", on_click=self._save).props("dense no-caps")
            self.spinner = ui.spinner()
        with ui.expansion("Ziegler-Nichols").props("dense").classes("w-full"):
            self._build_assistant()
        groups: dict[str, list[Constant]] = {}
        for constant in constants(self.controller):
            groups.setdefault(constant.name.rpartition(".")[0] or "general", []).append(constant)
        for name, members in groups.items():
            with ui.expansion(name, value=name == "longitudinal.cruise").props("dense").classes("w-full"):
                for constant in members:
                    self._build_slider(constant)

    def _build_slider(self, constant: Constant) -> None:
        ui, value = self.ui, values_of(self.controller)[constant.name]
        name = constant.name.rpartition(".")[2]
        if constant.kind == "switch":
            slider = ui.switch(name, value=value, on_change=partial(self._move, constant))
        else:
            with ui.row().classes("w-full justify-between text-xs"):
                ui.label(name).tooltip(constant.about)
                shown = ui.label()
            slider = ui.slider(
                min=constant.low, max=constant.high, step=constant.step, value=constant.position_of(value),
                on_change=partial(self._move, constant),
            ).props("dense").classes("px-2")  # fmt: skip
            shown.bind_text_from(slider, "value", partial(_printed, constant))
        slider.mark(constant.name).props(f'aria-label="{constant.name}"')
        self.sliders[constant.name] = slider

    def _build_assistant(self) -> None:
        ui = self.ui
        ui.label("Raises K_p of the speed loop until it oscillates, and takes the gains from K_u and T_u.").classes(
            "text-xs"
        )
        pids = {"cruise": "cruising", "follow": "following"}
        which = ui.select(pids, value="cruise", label="PID of").classes("w-full")
        rule = ui.select(list(RULES), value=next(iter(RULES)), label="Rule").classes("w-full")
        found = ui.label().classes("text-xs").mark("ultimate")
        chart = ui.echart(_empty()).classes("w-full h-48")
        chart.set_visibility(False)
        ui.button(
            "Find K_u and T_u", on_click=lambda: self._assist(which.value, rule.value, found, chart)
        ).props("dense outline no-caps")  # fmt: skip

    def _build_charts(self) -> None:
        ui = self.ui
        columns = [{"name": name, "label": name, "field": name, "align": "left"} for name in COLUMNS]
        self.table = ui.table(columns=columns, rows=[]).props("dense flat").classes("w-full")
        with ui.grid(columns=2).classes("w-full gap-2"):
            self.charts = [ui.echart(_empty(), renderer="svg").classes("w-full h-52") for _ in CHARTS]

    def _move(self, constant: Constant, event: Any) -> Any:
        """A slider has a new place."""
        self.controller = with_values(self.controller, {constant.name: constant.value_at(event.value)})
        return self.redraw()

    def _choose(self, event: Any) -> Any:
        self.maneuver = event.value
        return self.redraw()

    def _keep(self) -> Any:
        self.kept = self.controller
        return self.redraw()

    async def _back(self) -> None:
        if self.kept is not None:
            self._set(values_of(self.kept))
            await self.redraw()

    def _set(self, values: Mapping[str, Any]) -> None:
        """Moves sliders, which sets the constants."""
        for constant in constants(self.controller):
            if constant.name in values:
                slider, position = self.sliders[constant.name], constant.position_of(values[constant.name])
                if constant.kind != "switch" and position > slider.props["max"]:
                    slider.props["max"] = 2 * position
                slider.set_value(position)

    def _save(self) -> None:
        try:
            write_controller(self.path, self.controller)
        except OSError as error:
            self.ui.notify(
                f"found that {self.path} cannot be written ({error.strerror}), wanted a file for the constants: "
                "end with Ctrl-C and give another --out",
                type="negative",
            )
            return
        self.ui.notify(f"saved: caldrive drive --controller {self.path}", type="positive", multi_line=True)

    async def _assist(self, which: str, rule: str, found: Any, chart: Any) -> None:
        """Finds the ultimate gain, and puts the gains of the rule on the sliders."""
        from nicegui import run

        ultimate = self._ultimate or await run.cpu_bound(find_ultimate, speed_response, DT)
        if ultimate is None:  # the server stops
            return
        self._ultimate = ultimate
        gains = proposed(rule, ultimate, getattr(self.controller.longitudinal, which))
        values = {"kp": gains.kp, "ki": gains.ki, "kd": gains.kd}
        found.set_text(
            f"K_u = {ultimate.gain:.3g} per km/h, T_u = {ultimate.period:.3g} s: "
            + ", ".join(f"{name} = {value:.3g}" for name, value in values.items())
        )
        chart.options.update(oscillation_options(ultimate, DT))
        chart.set_visibility(True)
        chart.update()
        self._set({f"longitudinal.{which}.{name}": value for name, value in values.items()})

    async def redraw(self) -> None:
        """Drives until what is shown is what the sliders say."""
        self._stale = True
        if self._busy:
            return
        self._busy = True
        self.spinner.set_visibility(True)
        try:
            while self._stale:
                self._stale = False
                await self._redraw_once()
        finally:
            self._busy = False
            self.spinner.set_visibility(False)

    async def _redraw_once(self) -> None:
        try:
            self.drives = await self._driven()
            self._show()
        except (ValueError, RuntimeError) as error:
            self.ui.notify(str(error), type="negative", multi_line=True)

    async def _driven(self) -> dict[str, Drive]:
        """The drives of A, where it is kept, and of the present setting."""
        from nicegui import run

        settings = {"A": self.kept, "B": self.controller} if self.kept else {"": self.controller}
        name = self.maneuver
        drives = {key: await run.cpu_bound(drive_named, name, config) for key, config in settings.items()}
        return {key: one for key, one in drives.items() if one is not None}  # none while the server stops

    def _show(self) -> None:
        for chart, element in zip(CHARTS, self.charts, strict=True):
            element.options.clear()
            element.options.update(chart_options(chart, self.drives))
            element.update()
        self.table.rows = [{"": key or "now"} | figures(one) for key, one in self.drives.items()]
        self.table.update()


def _printed(constant: Constant, position: float) -> str:
    """A slider's value beside it."""
    value = constant.value_at(position)
    return "no limit" if value is constant.unlimited else f"{value:.4g}"


def _empty() -> dict[str, Any]:
    return {"xAxis": {}, "yAxis": {}, "series": []}
