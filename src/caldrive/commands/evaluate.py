"""The verb `evaluate`."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

from caldrive.commands.answer import Answer, Output
from caldrive.progress import Progress


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
