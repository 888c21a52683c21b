"""The options of `caldrive benchmark`: one dataclass for Python, the command line and TOML files."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path

from caldrive.driving.settings import DriverSettings
from caldrive.plugins import full_name


@dataclass(frozen=True, kw_only=True)
class BenchmarkSettings(DriverSettings):
    """Drive a whole suite; what a folder holds already is kept, and the rest is driven."""

    suite: str = "quick"
    """corl2017, corl2017-once (each of its routes in one weather only), dynamic (its fourth task only), nocrash,
    nocrash-once (the first of its three seeds), traffic-school, quick, unseen and unseen-wide (generated towns that
    nobody tuned to), generated (others, to develop on), or a .json file with trials."""
    out: Path = Path("out/benchmark")
    """Folder for results.jsonl, a line an episode, and run.json, which says what drove."""
    known: tuple[Path, ...] = ()
    """Folders of other suites that the same agent drove; an episode that is among theirs is not driven again."""
    workers: int = 2
    """Processes that drive at the same time, here or with --ray local; a cluster uses all its processors. In CARLA,
    which has one world, there is always one."""
    ray: str | None = None
    """Drive with Ray: local, auto for the cluster that this machine belongs to, or a cluster's address."""
    cap: float | None = 20.0
    """A speed in km/h that no limit exceeds, as in the paper's comparison."""
    signs: bool = False
    """Obey the speed signs instead of --cap."""
    time_limit: str = "paper"
    """paper: the path at 10 km/h; code: the authors' path at 5 km/h plus 10 s."""
    seed: int = 0
    """Decides everything random: traffic, pedestrians, lights."""

    @property
    def driver(self) -> DriverSettings:
        """Who drives, the same for processes that stand in other folders."""
        own = {field.name: getattr(self, field.name) for field in fields(DriverSettings)}
        return replace(
            DriverSettings(**own),
            agent=full_name(self.agent),
            model=self.model.resolve() if self.model else None,
            controller=full_name(self.controller),
            cap=None if self.signs else self.cap,
        )
