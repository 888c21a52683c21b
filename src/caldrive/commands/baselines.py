"""The verb that makes the paper's other three systems from nothing, each training after the other."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from tyro.conf import UseAppendAction

from caldrive.agents.conditional_imitation.config import IMITATION_NETWORKS, IMITATION_TRAININGS
from caldrive.agents.modular_pipeline.config import PIPELINE_TRAININGS
from caldrive.checks import require_modules, require_writable_folder
from caldrive.commands.answer import Answer, Output
from caldrive.commands.train import LEARNERS, TrainImitation, TrainPipeline, TrainReinforcement
from caldrive.progress import Progress
from caldrive.reinforcement.config import REINFORCEMENTS

ENCODER = "mp-all-frames"  # whose backbone the policies over features see through
MODEL, LOG = "model.safetensors", "log.jsonl"
Make = Callable[[Path, Path], Any]  # recording and folder of all trainings to the command of one


def _imitation(preset: str, seed: int, data: Path, out: Path) -> TrainImitation:
    training = replace(IMITATION_TRAININGS[preset], seed=seed)
    return TrainImitation(preset=preset, training=training, network=IMITATION_NETWORKS[preset], data=data, out=out)


def _pipeline(preset: str, data: Path, out: Path) -> TrainPipeline:
    return TrainPipeline(preset=preset, training=PIPELINE_TRAININGS[preset], data=data, out=out)


def _reinforcement(preset: str, seed: int, data: Path, out: Path) -> TrainReinforcement:
    training = replace(REINFORCEMENTS[preset], seed=seed)
    if training.sees == "features":
        training = replace(training, encoder=out.parent / ENCODER / MODEL)
    return TrainReinforcement(preset=preset, training=training, out=out)


# Every training, in the order in which they are made: first one of each system, then the other seeds. One seed of
# imitation is no evidence: its success varies by 23 to 42 points with it (Codevilla et al. 2019).
TRAININGS: dict[str, Make] = {
    **{f"mp-{preset}": partial(_pipeline, preset) for preset in PIPELINE_TRAININGS},
    **{f"cil-{preset}-0": partial(_imitation, preset, 0) for preset in IMITATION_TRAININGS},
    **{f"rl-{preset}-0": partial(_reinforcement, preset, 0) for preset in ("affordances", "paper", "modern")},
    **{f"cil-{preset}-{seed}": partial(_imitation, preset, seed) for seed in (1, 2) for preset in IMITATION_TRAININGS},
    **{f"rl-affordances-{seed}": partial(_reinforcement, "affordances", seed) for seed in (1, 2)},
    **{f"rl-predicted-{seed}": partial(_reinforcement, "predicted", seed) for seed in range(3)},
    "rl-modern-1": partial(_reinforcement, "modern", 1),
}


@dataclass(frozen=True, kw_only=True)
class Baselines(Output):
    """Train the paper's other three systems (imitation, pipeline, reinforcement), every variant and seed; what is there
    already is kept, and a training that was stopped goes on."""

    data: Path = Path("out/recording")
    """Folder with the recorded episodes, with semantic images: those that CAL learns from."""
    out: Path = Path("out/baselines")
    """Folder with a folder for each training, and log.jsonl, which says when each began and how long it took."""
    only: UseAppendAction[tuple[str, ...]] = ()
    """A training to make, such as cil-published-0; may be given again. Without it all of them."""

    def run(self, progress: Progress) -> Answer:
        """Trains; answers with the networks' files."""
        from caldrive.files import locked_folder

        if unknown := [name for name in self.only if name not in TRAININGS]:
            raise ValueError(f"found --only {unknown[0]}, wanted one of {', '.join(TRAININGS)}: type one of these")
        require_writable_folder(self.out)
        names = self.only or tuple(TRAININGS)
        if any(name.startswith("rl-") for name in names):
            require_modules("rl", *LEARNERS)  # now, and not after the first trainings
        with locked_folder(self.out):
            for number, name in enumerate(names):
                if not (self.out / name / MODEL).is_file():
                    self._train(name, partial(_part, progress, f"{number + 1} of {len(names)}, {name}: "))
        models = {name: str(self.out / name / MODEL) for name in names}
        return Answer({"models": models}, "\n".join(f"{name}: {path}" for name, path in models.items()))

    def _train(self, name: str, progress: Progress) -> None:
        """One training, and two lines in the log: when it began, or went on; and how long that took, and whether it is
        done, which is missing where it was killed."""
        clock = time.perf_counter()
        self._log({"training": name, "began": datetime.now(UTC).isoformat(timespec="seconds")})
        try:
            TRAININGS[name](self.data, self.out / name).run(progress)
        finally:
            seconds, done = round(time.perf_counter() - clock), (self.out / name / MODEL).is_file()
            self._log({"training": name, "seconds": seconds, "done": done})

    def _log(self, line: dict[str, object]) -> None:
        with (self.out / LOG).open("a") as log:
            log.write(json.dumps(line) + "\n")


def _part(progress: Progress, prefix: str, label: str, share: float) -> None:
    """The progress of one training among others."""
    progress(prefix + label, share)
