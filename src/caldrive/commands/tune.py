"""The verb that tunes the controller."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from caldrive.commands.answer import Answer, Configurable
from caldrive.progress import Progress
from caldrive.tune.config import TuneConfig


@dataclass(frozen=True, kw_only=True)
class Tune(Configurable):
    """Tune the controller: by hand on a page in the browser (NiceGUI), or with --auto by a search (Optuna); a search
    that was stopped goes on."""

    controller: str = "default"
    """Where tuning begins: default, paper, or a .toml file of constants."""
    auto: bool = False
    """Search instead of serving the page."""
    port: int = 8080
    """Port of the page, which only this machine can open."""
    out: Path = Path("out/tune")
    """Folder for controller.toml, which --controller takes; with --auto also for the trials and a report."""
    workers: int = 2
    """With --auto: processes that drive at the same time."""
    tune: Annotated[TuneConfig, arg(name="")] = field(default=TuneConfig(), metadata={"flat": True})

    def run(self, progress: Progress) -> Answer:
        """Serves the page until Ctrl-C; or searches, and answers with the costs before and after."""
        from caldrive.checks import require_writable_folder
        from caldrive.control.presets import controller_config

        controller, path = controller_config(self.controller, None), self.out / "controller.toml"
        require_writable_folder(self.out)
        if self.auto:
            _require_other_file(self.controller, path)
            from caldrive.commands.tables import tuning_table
            from caldrive.tune.auto import tune
            from caldrive.tune.report import report_values, write_report

            findings = tune(self.tune, controller, self.out, self.workers, progress)
            page = write_report(findings, self.tune, self.out, path)
            return Answer(report_values(findings, self.tune, path), tuning_table(findings, self.tune, page, path))

        from caldrive.tune.server import HOST, require_free_port, require_nicegui, serve

        require_nicegui()
        require_free_port(self.port)
        before = _saved_at(path)
        print(f"tuning: http://{HOST}:{self.port} (Ctrl-C ends it)", file=sys.stderr, flush=True)
        serve(controller, path, self.port)
        saved = path if _saved_at(path) != before else None
        return Answer({"controller": saved and str(saved)}, f"saved: {saved}" if saved else "nothing was saved")


def _saved_at(path: Path) -> int | None:
    """When a file was written, in ns; None where there is none."""
    return path.stat().st_mtime_ns if path.is_file() else None


def _require_other_file(controller: str, path: Path) -> None:
    """Raises ValueError where a search would write over the file that it begins with."""
    if Path(controller).resolve() == path.resolve():
        raise ValueError(
            f"found --controller {controller}, which the search would write over, wanted another file: give another "
            "--out"
        )
