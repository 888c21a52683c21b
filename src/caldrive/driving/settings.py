"""What the commands can be told: plain data with a sentence on each field, which is also its help text."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from caldrive.config import CollectConfig


@dataclass(frozen=True)
class DriverSettings:
    """Who drives, and where."""

    agent: str = "cal"
    """Who drives: cal sees the camera image only, oracle knows the truth."""
    model: Path | None = None
    """The network of cal, a .safetensors file; without it the one in the package."""
    town: str = "town01"
    """town01, town02 or an OpenDRIVE file."""
    task: str = "navigation"
    """straight, one-turn, navigation or navigation-dynamic."""
    weather: int = 1
    """One of CARLA's weathers, 1 to 14."""
    cars: int | None = None
    """Other cars; without it what the task prescribes."""
    people: int | None = None
    """Pedestrians; without it what the task prescribes."""
    route: int = 0
    """The first of the task's routes to drive, from 0."""
    seed: int = 0
    """Decides everything random: traffic, pedestrians, lights."""
    cap: float | None = None
    """A speed in km/h that no limit exceeds; the paper's comparison drives with 20."""
    preset: str = "default"
    """The controller: default, or paper for the laws as printed."""
    seconds: float | None = None
    """Ends every episode after so many simulated seconds."""


@dataclass(frozen=True)
class DriveSettings(DriverSettings):
    """Drive episodes, film them, and write down what happened."""

    episodes: int = 1
    """How many episodes, one for each route from --route on."""
    video: bool = True
    """Film the drive; --no-video does not, and draws no speeds."""
    out: Path = Path("out/drive")
    """Folder for drive.mp4, and for each episode its trace (JSON) and its speed over distance (PNG)."""


@dataclass(frozen=True)
class BenchmarkSettings:
    """Drive a whole suite; what a folder holds already is kept, and the rest is driven."""

    suite: str = "quick"
    """corl2017, corl2017-once (each of its routes in one weather only), nocrash, traffic-school, quick, or a .json
    file with trials."""
    agent: str = "cal"
    """Who drives: cal sees the camera image only, oracle knows the truth."""
    model: Path | None = None
    """The network of cal, a .safetensors file; without it the one in the package."""
    out: Path = Path("out/benchmark")
    """Folder for results.jsonl, a line an episode, and run.json, which says what drove."""
    known: tuple[Path, ...] = ()
    """Folders of other suites that the same agent drove; an episode that is among theirs is not driven again."""
    workers: int = 2
    """Processes that drive at the same time, here or with --ray local; a cluster uses all its processors."""
    ray: str | None = None
    """Drive with Ray: local, auto for the cluster that this machine belongs to, or a cluster's address."""
    cap: float = 20.0
    """A speed in km/h that no limit exceeds, as in the paper's comparison."""
    signs: bool = False
    """Obey the speed signs instead of --cap."""
    preset: str = "default"
    """The controller: default, or paper for the laws as printed."""
    time_limit: str = "paper"
    """paper: the path at 10 km/h; code: the authors' path at 5 km/h plus 10 s."""
    seed: int = 0
    """Decides everything random: traffic, pedestrians, lights."""

    @property
    def pace(self) -> float | None:
        """The speed in km/h that no limit exceeds; None where the signs alone count."""
        return None if self.signs else self.cap


@dataclass(frozen=True)
class DeterminismSettings(DriverSettings):
    """Drive the same episode in two fresh processes and compare every image, control and truth."""

    task: str = "navigation-dynamic"
    """straight, one-turn, navigation or navigation-dynamic."""
    seconds: float | None = 60.0
    """Compares so many simulated seconds."""


@dataclass(frozen=True)
class WorldSpeedSettings:
    """Camera steps a second in one process at 200 x 88, and which part takes how long."""

    town: str = "town01"
    """town01, town02 or an OpenDRIVE file."""
    weather: int = 1
    """One of CARLA's weathers, 1 to 14."""
    cars: int = 20
    """Other cars."""
    people: int = 50
    """Pedestrians."""
    steps: int = 600
    """How many steps to measure."""
    seed: int = 0
    """Decides everything random."""


@dataclass(frozen=True)
class AgentSpeedSettings:
    """Milliseconds from image to control."""

    model: Path | None = None
    """The network, a .safetensors file; without it the one in the package."""
    steps: int = 300
    """How many images to measure."""
    threads: int | None = None
    """Threads for the network; without it as many as the machine has cores."""


@dataclass(frozen=True)
class CollectSettings:
    """Record episodes that the oracle drives; what is there already is kept."""

    out: Path = Path("out/recording")
    """Folder for the episodes."""
    town: str = CollectConfig.town
    """town01 for training; town02 is for evaluation only."""
    weathers: tuple[int, ...] = CollectConfig.weathers
    """The weathers, in turn."""
    episodes: int = CollectConfig.episodes
    """How many episodes the folder holds in the end."""
    duration: float = CollectConfig.duration
    """Simulated seconds of each; of those in which the car stands for long one in fifteen counts."""
    cars: int = CollectConfig.cars
    """Other cars in half of the episodes; tailgating ones have twice as many, the others a third of them."""
    people: int = CollectConfig.people
    """Pedestrians, who cross more often than usual."""
    width: int = CollectConfig.width
    """Width of the images in pixels; the preset paper takes 320."""
    height: int = CollectConfig.height
    """Height of the images in pixels; the preset paper takes 144."""
    rearranged: float = CollectConfig.rearranged
    """Share of the episodes with other houses, trees and colours along the same streets."""
    semantic: bool = False
    """Also record what each pixel shows: a number of world/semantics.py for each."""
    workers: int = 2
    """Processes that record at the same time."""
    seed: int = 0
    """Decides everything random."""


@dataclass(frozen=True)
class TrainSettings:
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


@dataclass(frozen=True)
class DataSettings:
    """Check every file and image of a recording, count its labels and draw their histograms."""

    picture: Path = Path("out/recording.png")
    """The PNG file for the histograms."""


@dataclass(frozen=True)
class EvaluateSettings:
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
