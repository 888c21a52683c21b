"""The verbs of the network: train it on a recording, and evaluate what it sees."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path

from caldrive.commands.answer import Answer, Configurable, Output
from caldrive.perception.network.config import PERCEPTIONS
from caldrive.perception.training.config import TRAININGS, TrainingConfig
from caldrive.progress import Progress


@dataclass(frozen=True, kw_only=True)
class Train(Configurable):
    """Train the small network on a recording; a run that was stopped goes on."""

    data: Path = Path("out/recording")
    """Folder with the recorded episodes."""
    out: Path = Path("out/training")
    """Folder for model.safetensors, the state of the run, its metrics and their curves."""
    steps: int | None = None
    """Steps of the whole network, where the preset's are not wanted; those of its blocks alone follow."""
    preset: str = "small"
    """small, for two cores, or paper: full width, from VGG16's ImageNet weights."""
    imagenet: Path | None = None
    """VGG16's weights for preset paper (.safetensors or .pth); without it those in torch.hub's cache."""
    initial: Path | None = None
    """A trained network (.safetensors) to begin with, instead of a new one; its blocks where they are built alike."""
    rate: float | None = None
    """Base learning rate, where the preset's is not wanted."""
    device: str = "auto"
    """cpu, cuda, or auto for a GPU where there is one; torchrun trains on several."""
    seed: int = 0
    """Decides everything random."""

    def _config(self) -> TrainingConfig:
        from caldrive.checks import MOST_SEED, require_within

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
        from caldrive.checks import require_writable_folder
        from caldrive.perception.network.backbone import imagenet_file
        from caldrive.perception.training.distributed import keep_memory
        from caldrive.perception.training.train import begun, train

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
        from caldrive.perception.network.checkpoint import load_network
        from caldrive.perception.training.run import anew
        from caldrive.perception.training.train import begun

        if self.initial is None or begun(self.out):
            return []
        return anew(load_network(self.initial)[1].config, PERCEPTIONS[self.preset])


@dataclass(frozen=True, kw_only=True)
class Evaluate(Output):
    """How well a network sees recorded frames: by command, weather, place and cars, beside the paper's figures."""

    data: Path = Path("out/recording")
    """Folder with the recorded episodes."""
    model: Path | None = None
    """The network, a .safetensors file; without it the one in the package."""
    held_out: bool = False
    """Only those episodes that training on this folder kept for validation."""
    worst: Path | None = None
    """A PNG file for the frames that it gets most wrong."""
    precision: str = "auto"
    """fp32, bf16, int8 or int7; auto is what it drives in."""

    def run(self, progress: Progress) -> Answer:
        from caldrive.agents.registry import model_path
        from caldrive.checks import require_writable_file
        from caldrive.commands.tables import evaluation_table
        from caldrive.perception.dataset.frames import Frames
        from caldrive.perception.evaluation.report import PAPER, report
        from caldrive.perception.inference.engines import driving_precision, features_in
        from caldrive.perception.network.checkpoint import load_network
        from caldrive.recordings.folder import find_episodes, held_out

        if self.worst is not None:
            require_writable_file(self.worst, "--worst", ".png")
        network, info = load_network(model_path(self.model))
        precision = driving_precision(self.precision, info)
        episodes = find_episodes(self.data)
        if self.held_out:
            episodes = held_out(episodes, info.data.get("validation_episodes", []))
        frames = Frames(episodes, (network.config.image_height, network.config.image_width))
        features = features_in(precision, network, info)
        found = report(network, frames, features, self.worst, progress)
        values = asdict(found) | {"paper": PAPER, "precision": precision}
        return Answer(values, evaluation_table(found, precision))
