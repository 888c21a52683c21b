"""The verbs of the network: train it on a recording, and evaluate what it sees."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from tyro.conf import FlagConversionOff, arg

from caldrive.agents.conditional_imitation.config import (
    IMITATION_NETWORKS,
    IMITATION_TRAININGS,
    ImitationConfig,
    ImitationNetworkConfig,
)
from caldrive.agents.modular_pipeline.config import (
    PIPELINE_TRAININGS,
    SEGMENTATION_NETWORK,
    PipelineConfig,
    SegmentationConfig,
)
from caldrive.checks import require_modules
from caldrive.commands.answer import TYPED, Answer, Configurable, Output
from caldrive.perception.network.config import NETWORKS, NetworkConfig
from caldrive.perception.training.config import TRAININGS, TrainingConfig
from caldrive.progress import Progress
from caldrive.reinforcement.config import REINFORCEMENTS, ReinforcementConfig

LEARNERS = ("gymnasium", "stable_baselines3")  # what learning by reinforcement needs


@dataclass(frozen=True, kw_only=True)
class Train(Configurable):
    """Train CAL's network on a recording; a run that was stopped goes on."""

    PRESETS: ClassVar[dict[str, Train]] = {}
    BY_AGENT: ClassVar[dict[str, type[Any]]] = {}

    agent: Literal["cal"] = field(default="cal", metadata=TYPED)
    """Whose network: cal; or cil (conditional imitation learning), mp (modular pipeline) or rl (reinforcement
    learning), which have options of their own: caldrive train --agent cil --help."""
    data: Path = Path("out/recording")
    """Folder with the recorded episodes."""
    out: Path = Path("out/training")
    """Folder for model.safetensors, the state of the run, its metrics and their curves."""
    preset: str = "small"
    """What all other options begin with: small, for two cores, or paper: full width, from VGG16's ImageNet weights."""
    training: Annotated[TrainingConfig, arg(name=""), FlagConversionOff] = field(
        default=TRAININGS["small"], metadata={"flat": True}
    )
    network: Annotated[NetworkConfig, FlagConversionOff] = NETWORKS["small"]
    """The network that is trained."""

    def run(self, progress: Progress) -> Answer:
        """Trains; answers with the network's file."""
        from caldrive.checks import require_writable_folder
        from caldrive.perception.training.distributed import keep_freed_memory
        from caldrive.perception.training.folder import TrainingFolder
        from caldrive.perception.training.initial import untrained_blocks
        from caldrive.perception.training.train import train

        require_writable_folder(self.out)
        keep_freed_memory()
        new_blocks = [] if TrainingFolder(self.out).has_state else untrained_blocks(self.training, self.network)
        model = train(self.training, self.data, self.out, self.network, progress)
        lines = [f"trained: caldrive drive --model {model}"]
        if new_blocks:
            names = ", ".join(new_blocks)
            lines.append(f"trained from new weights, as {self.training.initial} builds them differently: {names}")
        return Answer({"model": str(model), "new_blocks": new_blocks}, "\n".join(lines))


@dataclass(frozen=True, kw_only=True)
class TrainImitation(Configurable):
    """Train the network of conditional imitation learning on a recording; a run that was stopped goes on."""

    PRESETS: ClassVar[dict[str, TrainImitation]] = {}

    agent: Literal["cil"] = field(default="cil", metadata=TYPED)
    """Whose network."""
    data: Path = Path("out/recording")
    """Folder with the recorded episodes, or with SeqTrain and SeqVal of HDF5 files (CORL-2017)."""
    out: Path = Path("out/imitation")
    """Folder for model.safetensors, the state of the run, its metrics and their curves."""
    preset: str = "published"
    """What all other options begin with: published, or cal-backbone: CAL's convolutions, augmentation and rate."""
    training: Annotated[ImitationConfig, arg(name=""), FlagConversionOff] = field(
        default=IMITATION_TRAININGS["published"], metadata={"flat": True}
    )
    network: Annotated[ImitationNetworkConfig, FlagConversionOff] = IMITATION_NETWORKS["published"]
    """The network that is trained."""

    def run(self, progress: Progress) -> Answer:
        """Trains; answers with the network's file."""
        from caldrive.agents.conditional_imitation.learner import train_imitation

        return _trained(self, lambda: train_imitation(self.training, self.data, self.out, self.network, progress))


TrainImitation.PRESETS.update(
    {
        name: TrainImitation(preset=name, training=IMITATION_TRAININGS[name], network=IMITATION_NETWORKS[name])
        for name in IMITATION_TRAININGS
    }
)


@dataclass(frozen=True, kw_only=True)
class TrainPipeline(Configurable):
    """Train the segmentation network of the modular pipeline on a recording; a run that was stopped goes on."""

    PRESETS: ClassVar[dict[str, TrainPipeline]] = {}

    agent: Literal["mp"] = field(default="mp", metadata=TYPED)
    """Whose network."""
    data: Path = Path("out/recording")
    """Folder with the recorded episodes, with semantic images."""
    out: Path = Path("out/segmentation")
    """Folder for model.safetensors, the state of the run, its metrics and their curves."""
    preset: str = "all-frames"
    """What all other options begin with: all-frames, or published: 2,500 frames without augmentation."""
    training: Annotated[PipelineConfig, arg(name=""), FlagConversionOff] = field(
        default=PIPELINE_TRAININGS["all-frames"], metadata={"flat": True}
    )
    network: Annotated[SegmentationConfig, FlagConversionOff] = SEGMENTATION_NETWORK
    """The network that is trained."""

    def run(self, progress: Progress) -> Answer:
        """Trains; answers with the network's file."""
        from caldrive.agents.modular_pipeline.learner import train_pipeline

        return _trained(self, lambda: train_pipeline(self.training, self.data, self.out, self.network, progress))


TrainPipeline.PRESETS.update(
    {name: TrainPipeline(preset=name, training=PIPELINE_TRAININGS[name]) for name in PIPELINE_TRAININGS}
)


@dataclass(frozen=True, kw_only=True)
class TrainReinforcement(Configurable):
    """Train a policy by trial and error in the embedded town; a run that was stopped goes on."""

    PRESETS: ClassVar[dict[str, TrainReinforcement]] = {}

    agent: Literal["rl"] = field(default="rl", metadata=TYPED)
    """Whose policy."""
    out: Path = Path("out/reinforcement")
    """Folder for model.safetensors, the state of the run, checkpoints, its metrics and their curves."""
    preset: str = "modern"
    """What all other options begin with: paper, as the CARLA paper's RL; modern, over a frozen encoder; affordances, on
    the true ones; or predicted, on those of CAL's network."""
    training: Annotated[ReinforcementConfig, arg(name=""), FlagConversionOff] = field(
        default=REINFORCEMENTS["modern"], metadata={"flat": True}
    )

    def run(self, progress: Progress) -> Answer:
        """Trains; answers with the policy's file."""
        require_modules("rl", *LEARNERS)
        from caldrive.reinforcement.train import train_rl

        return _trained(self, lambda: train_rl(self.training, self.out, progress))


TrainReinforcement.PRESETS.update(
    {name: TrainReinforcement(preset=name, training=REINFORCEMENTS[name]) for name in REINFORCEMENTS}
)
Train.BY_AGENT.update(cal=Train, cil=TrainImitation, mp=TrainPipeline, rl=TrainReinforcement)
Train.PRESETS.update({name: Train(preset=name, training=TRAININGS[name], network=NETWORKS[name]) for name in TRAININGS})


def _trained(verb: TrainImitation | TrainPipeline | TrainReinforcement, train: Callable[[], Path]) -> Answer:
    """The answer of a training, done into a folder that can be written into."""
    from caldrive.checks import require_writable_folder
    from caldrive.perception.training.distributed import keep_freed_memory

    require_writable_folder(verb.out)
    keep_freed_memory()
    model = train()
    return Answer({"model": str(model)}, f"trained: caldrive drive --agent {verb.agent} --model {model}")


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
        """Evaluates; answers with IoU and errors beside the paper's."""
        from caldrive.agents.rows import model_path
        from caldrive.checks import require_writable_file
        from caldrive.commands.tables import evaluation_table
        from caldrive.perception.dataset.frames import Frames
        from caldrive.perception.evaluation.report import published_metrics, report
        from caldrive.perception.inference.engines import backbone_engine
        from caldrive.perception.inference.precision import driving_precision
        from caldrive.perception.network.checkpoint import load_network
        from caldrive.recordings.folder import find_episodes, held_out

        if self.worst is not None:
            require_writable_file(self.worst, "--worst", ".png")
        network, info = load_network(model_path(self.model))
        precision = driving_precision(self.precision, info.ranges)
        episodes = find_episodes(self.data)
        if self.held_out:
            episodes = held_out(episodes, info.data.get("validation_episodes", []))
        frames = Frames(episodes, network.config.image_size)
        engine = backbone_engine(precision, network.backbone, network.config.image_size, info.ranges)
        evaluation = report(network, frames, engine, self.worst, progress)
        values = asdict(evaluation) | {"paper": published_metrics(), "precision": precision}
        return Answer(values, evaluation_table(evaluation, precision))
