"""The options of the commands that drive and measure: a sentence on each field, which is also its help text."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from tyro.conf import Positional, arg

from caldrive.agents.settings import AgentSettings


@dataclass(frozen=True, kw_only=True)
class WorldSettings:
    """In which world somebody drives."""

    world: str = "embedded"
    """Where the agent drives: embedded, carla (a server that runs), or, but for a benchmark, your own:
    package.module:Class or file.py:Class."""
    host: str = "127.0.0.1"
    """The machine where CARLA runs, for --world carla."""
    port: int = 2000
    """Its port."""

    @property
    def address(self) -> dict[str, Any]:
        """What `make_world` has to know beside the world's name."""
        return {"host": self.host, "port": self.port} if self.world == "carla" else {}

    @property
    def is_mapped(self) -> bool:
        """Whether its towns can be looked up before it is there, to plan tasks in."""
        return self.world in ("embedded", "carla")


@dataclass(frozen=True, kw_only=True)
class DriverSettings(WorldSettings, AgentSettings):
    """Who drives, and in which world."""


@dataclass(frozen=True, kw_only=True)
class EpisodeSettings(DriverSettings):
    """Who drives, and where."""

    town: str = "town01"
    """town01, town02, random:SEED, random-wide:SEED, an OpenDRIVE file, or with --world carla a map of the server's,
    such as Town01."""
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
    start: Annotated[str | None, arg(name="from", metavar="X,Y[,HEADING]")] = None
    """Start at a place of your own instead of a task's: metres, and degrees counter-clockwise from east."""
    goal: Annotated[str | None, arg(name="to", metavar="X,Y")] = None
    """Drive to this place."""
    seed: int = 0
    """Decides everything random: traffic, pedestrians, lights."""
    seconds: float | None = None
    """Ends every episode after so many simulated seconds."""


@dataclass(frozen=True, kw_only=True)
class DriveSettings(EpisodeSettings):
    """Drive episodes, film them, and write down what happened."""

    episodes: int = 1
    """How many episodes, one for each route from --route on."""
    video: bool = True
    """--video films the drive and plots the speed; --no-video writes each episode's trace (episode-000.json) alone."""
    record: Annotated[Path | None, arg(metavar="FILE.mcap")] = None
    """Record the drive for Foxglove, Lichtblick or Rerun: camera, affordances, controller, signals, map, others and
    infractions, all episodes in one file. Needs pip install 'caldrive[record]'."""
    view: bool = False
    """Watch the same live in Rerun, on this machine. Needs pip install 'caldrive[view]'."""
    out: Path = Path("out/drive")
    """Folder for drive.mp4, and for each episode its trace (JSON) and its speed over distance (PNG)."""


@dataclass(frozen=True, kw_only=True)
class DeterminismSettings(EpisodeSettings):
    """Drive the same episode in two fresh processes and compare every image, control and truth."""

    task: str = "navigation-dynamic"
    """straight, one-turn, navigation or navigation-dynamic."""
    seconds: float | None = 60.0
    """Compares so many simulated seconds."""


@dataclass(frozen=True, kw_only=True)
class WorldSpeedSettings:
    """Camera steps a second in one process at 200 x 88, and which part takes how long."""

    town: str = "town01"
    """town01, town02, random:SEED, random-wide:SEED or an OpenDRIVE file."""
    weather: int = 1
    """One of CARLA's weathers, 1 to 14."""
    cars: int = 20
    """Other cars."""
    people: int = 50
    """Pedestrians."""
    cameras: Literal[1, 3] = 1
    """Pictures of each step: the agent's camera, or the three of a recording."""
    workers: int = 1
    """Worlds at the same time, each in a process of its own."""
    steps: int = 600
    """How many steps to measure, in each of them."""
    seed: int = 0
    """Decides everything random."""


@dataclass(frozen=True, kw_only=True)
class AgentSpeedSettings(AgentSettings):
    """Milliseconds from image to control, while the agent drives among others in town01."""

    steps: int = 300
    """How many images to measure."""
    threads: int | None = None
    """Threads for the network; without it as many as the machine has cores."""


@dataclass(frozen=True, kw_only=True)
class EnvSpeedSettings:
    """Steps a second of the gymnasium environment in town01, resets included."""

    observation: Literal["image", "affordances"] = "image"
    """What is seen: an image of 200 x 88, or the true affordances, for which nothing is drawn."""
    task: str = "navigation-dynamic"
    """straight, one-turn, navigation or navigation-dynamic (20 cars and 50 people)."""
    environments: int = 1
    """How many at the same time, each in a process of its own where there are several."""
    steps: int = 1000
    """How many steps to measure, in each of them."""
    seed: int = 0
    """Decides everything random."""


@dataclass(frozen=True, kw_only=True)
class PictureSettings:
    """A person's own video or pictures, and the network that looks at them."""

    source: Annotated[Positional[Path], arg(metavar="VIDEO_OR_FOLDER")]
    """A video, a folder of pictures (.png, .jpg; by name, 10 a second), or one picture."""
    crop: Annotated[str | None, arg(metavar="A:B")] = None
    """Rows A to B of each picture to look at, counted from the top; the authors keep 120:480 of their 600."""
    command: Literal["left", "straight", "right"] = "straight"
    """What the navigation system asks for at the next junction, in all pictures."""
    model: Path | None = None
    """The network, a .safetensors file; without it the one in the package."""
    every: Annotated[int, arg(metavar="N")] = 1
    """Take only every Nth picture: the network learnt at 10 a second, so that 3 suits a video of 30."""
    out: Path = Path("out/see.mp4")
    """The video to write, an .mp4 file."""


@dataclass(frozen=True, kw_only=True)
class SeeSettings(PictureSettings):
    """Run the network on your own video or pictures. It knows only the embedded towns: in other pictures its values
    may mean nothing."""

    values: Path | None = None
    """The affordances of every picture, a .csv or .parquet file; without it a .csv beside the video."""
