"""The verbs that record, check, train and evaluate."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

import tyro

from caldrive.commands.answer import Answer, Output
from caldrive.config import CollectConfig
from caldrive.driving.settings import CollectSettings, DataSettings, EvaluateSettings, TrainSettings
from caldrive.perception.config import PERCEPTIONS, TRAININGS, TrainingConfig
from caldrive.progress import Progress


@dataclass(frozen=True)
class Collect(CollectSettings, Output):
    def run(self, progress: Progress) -> Answer:
        from caldrive.driving.collection import collect
        from caldrive.driving.outputs import require_writable_folder
        from caldrive.driving.tables import counts_table
        from caldrive.episode_reader import read_episode
        from caldrive.episodes import episode_path
        from caldrive.perception.folders import class_counts

        require_writable_folder(self.out)
        asked = {field.name: getattr(self, field.name) for field in fields(CollectConfig) if hasattr(self, field.name)}
        config = CollectConfig(**asked)
        for _ in collect(config, self.out, self.workers, progress):
            pass
        counts = class_counts([read_episode(episode_path(self.out, k)) for k in range(config.episodes)])
        return Answer({"out": str(self.out), "counts": counts}, counts_table(self.out, counts))


@dataclass(frozen=True)
class Data(DataSettings, Output):
    folder: tyro.conf.Positional[Path] = Path("out/recording")
    """Folder with the recorded episodes."""

    def run(self, progress: Progress) -> Answer:
        from caldrive.driving.outputs import require_writable_file
        from caldrive.driving.tables_seen import recording_table
        from caldrive.perception.recordings import check_recording, draw_histograms

        require_writable_file(self.picture, "--picture", ".png")
        found, episodes = check_recording(self.folder, progress)
        if episodes:
            draw_histograms(episodes, found.counts, self.picture)
        picture = self.picture if episodes else None
        values = asdict(found) | {"picture": str(picture) if picture else None}
        return Answer(values, recording_table(found, picture), int(bool(found.damaged)))


@dataclass(frozen=True)
class Train(TrainSettings, Output):
    def _config(self) -> TrainingConfig:
        from caldrive.driving.limits import MOST_SEED, require_within

        if self.preset not in TRAININGS:
            raise ValueError(f"found preset {self.preset!r}, wanted one of {', '.join(TRAININGS)}: type --preset small")
        usual = TRAININGS[self.preset]
        steps = usual.steps if self.steps is None else self.steps
        rate = usual.learning_rate if self.rate is None else self.rate
        require_within("--steps", steps, 1, 10_000_000, 1000)
        require_within("--rate", rate, 1e-9, 1.0, 4e-4)
        require_within("--seed", self.seed, 0, MOST_SEED, 0)
        initial = str(self.initial) if self.initial else None
        return replace(usual, seed=self.seed, device=self.device, initial=initial, steps=steps, learning_rate=rate)

    def run(self, progress: Progress) -> Answer:
        from caldrive.driving.outputs import require_writable_folder
        from caldrive.perception.backbone import imagenet_file
        from caldrive.perception.memory import keep_memory
        from caldrive.perception.training import begun, train

        require_writable_folder(self.out)
        keep_memory()
        config = self._config()
        if self.initial and self.imagenet:
            raise ValueError("found --initial and --imagenet, wanted one network to begin with: type one of them")
        wanted = PERCEPTIONS[self.preset].width == 1.0 and not self.initial and not begun(self.out)
        imagenet = self.imagenet or (imagenet_file() if wanted else None)
        began_anew = self._began_anew()
        model = train(config, self.data, self.out, PERCEPTIONS[self.preset], imagenet, progress)
        told = f"trained: caldrive drive --model {model}"
        if began_anew:
            told += f"\nbegan anew, as {self.initial} builds them otherwise: {', '.join(began_anew)}"
        return Answer({"model": str(model), "began_anew": began_anew}, told)

    def _began_anew(self) -> list[str]:
        """The task blocks that --initial does not give; none where a run is taken up that needs its file no more."""
        from caldrive.perception.beginning import anew
        from caldrive.perception.checkpoint import load_network
        from caldrive.perception.training import begun

        if self.initial is None or begun(self.out):
            return []
        return anew(load_network(self.initial)[1].config, PERCEPTIONS[self.preset])


@dataclass(frozen=True)
class Evaluate(EvaluateSettings, Output):
    def run(self, progress: Progress) -> Answer:
        from caldrive.driving.drivers import model_path
        from caldrive.driving.outputs import require_writable_file
        from caldrive.driving.tables_seen import evaluation_table
        from caldrive.perception.checkpoint import load_network
        from caldrive.perception.dataset import Frames
        from caldrive.perception.folders import find_episodes, held_out
        from caldrive.perception.precision import driving_precision, features_in
        from caldrive.perception.report import PAPER, report

        if self.worst is not None:
            require_writable_file(self.worst, "--worst", ".png")
        network, info = load_network(model_path(self.model))
        precision = driving_precision(self.precision, info)
        episodes = find_episodes(self.data)
        if self.held_out:
            episodes = held_out(episodes, info.data)
        frames = Frames(episodes, (network.config.image_height, network.config.image_width))
        features = features_in(precision, network, info)
        found = report(network, frames, features, self.worst, progress)
        values = asdict(found) | {"paper": PAPER, "precision": precision}
        return Answer(values, evaluation_table(found, precision))
