"""How the program reads each kind of input: command lines that work, and the files in them that are attacked."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from fnmatch import fnmatch

DRIVE = "drive --agent oracle --seconds 0.3 --no-video"
COLLECT = "collect --out recording --config recording.toml --workers 1"
BENCHMARK = "benchmark --agent oracle --workers 1"
TRAIN_NEW = "train --data recording --out out --config training.toml"
TRAIN = "train --data recording --out training --config training.toml"


@dataclass(frozen=True)
class Use:
    """A command line that ends well. needs: files, or folders, of the good inputs; attacked: a pattern of those that
    are changed."""

    kind: str
    line: str
    needs: tuple[str, ...]
    attacked: str

    @property
    def arguments(self) -> tuple[str, ...]:
        return tuple(shlex.split(self.line))

    def targets(self, names: list[str]) -> list[str]:
        """Those of its files that are attacked."""
        return [name for name in names if fnmatch(name, self.attacked)]


USES = (
    Use("settings", f"{DRIVE} --config drive.toml", ("drive.toml",), "drive.toml"),
    Use("settings", f"{DRIVE} --controller controller.toml", ("controller.toml",), "controller.toml"),
    Use("settings", "collect --out out --config recording.toml --workers 1", ("recording.toml",), "recording.toml"),
    Use("settings", TRAIN_NEW, ("recording", "training.toml"), "*.toml"),
    Use("suite", f"{BENCHMARK} --suite suite.json --out out", ("suite.json",), "suite.json"),
    Use("results", "report run", ("run", "suite.json"), "run/*"),
    Use("results", f"{BENCHMARK} --suite suite.json --out run", ("run", "suite.json"), "run/*"),
    Use("results", f"{BENCHMARK} --suite suite.json --out out --known run", ("run", "suite.json"), "run/*"),
    Use("results", "replay run short-0", ("run", "suite.json"), "run/*"),
    Use("recording", "data recording", ("recording",), "recording/*"),
    Use("recording", COLLECT, ("recording", "recording.toml"), "recording/*"),
    Use("recording", "evaluate --data recording --model training/model.safetensors", ("recording", "training"),
        "recording/*.parquet"),
    Use("recording", TRAIN_NEW, ("recording", "training.toml"),
        "recording/*.parquet"),
    Use("network", "drive --seconds 0.3 --no-video --model training/model.safetensors", ("training",), "*/model.*"),
    Use("network", "speed agent --steps 3 --threads 1 --model training/model.safetensors", ("training",), "*/model.*"),
    Use("network", "evaluate --data recording --model training/model.safetensors", ("recording", "training"),
        "*/model.*"),
    Use("network", "see pictures --model training/model.safetensors", ("pictures", "training"), "*/model.*"),
    Use("network", f"{TRAIN_NEW} --initial training/model.safetensors",
        ("recording", "training.toml", "training"), "*/model.*"),
    Use("state", TRAIN, ("recording", "training.toml", "training"), "training/[ms]*"),
    Use("map", f"{DRIVE} --town map.xodr --from 20,-2 --to 80,-2", ("map.xodr",), "map.xodr"),
    Use("map", f"{DRIVE} --town crossing.xodr --task straight", ("crossing.xodr",), "crossing.xodr"),
    Use("map", "town --town map.xodr --plan plan.png", ("map.xodr",), "map.xodr"),
    Use("map", f"{BENCHMARK} --suite own_map.json --out out", ("map.xodr", "own_map.json"), "map.xodr"),
    Use("picture", "see pictures --model training/model.safetensors", ("pictures", "training"), "pictures/*"),
    Use("picture", "see video.mp4 --model training/model.safetensors --crop 8:40 --values v.parquet",
        ("video.mp4", "training"), "video.mp4"),
)  # fmt: skip
