"""Where the network looks as moving pictures: a video of a drive or of a person's own pictures, and while a car
drives."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from caldrive.agents.rows import model_path
from caldrive.checks import require_within, require_writable_file
from caldrive.datatypes import Command, Image, Observation
from caldrive.driving.choice import chosen_scenarios
from caldrive.driving.pictures import open_source
from caldrive.driving.referee import Referee
from caldrive.driving.rollout import rollout
from caldrive.driving.see import at_size, kept_rows, parse_crop
from caldrive.driving.settings import EpisodeSettings, PictureSettings
from caldrive.driving.setup import set_up
from caldrive.explain.activation_maps import Attention, Question, attend
from caldrive.explain.overlay import explained, scale_of
from caldrive.perception.network.checkpoint import load_network
from caldrive.perception.network.network import Network
from caldrive.progress import Progress, silent
from caldrive.visualization.episode_video import VideoWriter
from caldrive.visualization.gauges import BACKGROUND

PANEL_WIDTH = 480  # pixels, of each affordance
COLUMNS = 2


@dataclass(frozen=True)
class Scene:
    """What the network is shown: an image (H, W, 3) of its own size, and the command."""

    image: Image
    command: Command
    done: float
    """How far the drive or the video has come, in [0, 1]."""


@dataclass(frozen=True)
class Looked:
    """A scene, and the attention to each affordance in it."""

    scene: Scene
    attentions: tuple[Attention, ...]


def drive_attention(
    settings: EpisodeSettings, affordances: Sequence[str], method: str, out: Path, progress: Progress = silent
) -> int:
    """Drives an episode and writes the video of where CAL's network looks (that of `settings` where it drives, else the
    package's); returns its number of frames. Raises ValueError for settings that cannot be."""
    questions = _checked(affordances, out)
    network, _ = load_network(model_path(settings.model if settings.agent == "cal" else None))
    scenes = _driven(settings)
    return _write(network, scenes, questions, method, out, 10.0, progress)


def see_attention(
    settings: PictureSettings, affordances: Sequence[str], method: str, progress: Progress = silent
) -> int:
    """The same for a person's own pictures, as `caldrive see` takes them."""
    questions = _checked(affordances, settings.out)
    require_within("--every", settings.every, 1, 1_000_000, 1)
    network, _ = load_network(model_path(settings.model))
    source = open_source(settings.source, settings.every)
    scenes = _pictures(settings, network.config.image_size)
    return _write(network, scenes, questions, method, settings.out, source.rate / source.every, progress)


def _checked(affordances: Sequence[str], out: Path) -> list[Question]:
    """The questions, without a command. Raises ValueError where one, or the video's name, cannot be."""
    require_writable_file(out, "--out", ".mp4")
    return [Question(name) for name in affordances]


def _driven(settings: EpisodeSettings) -> Iterator[Scene]:
    """What the camera sees in an episode, until the referee ends it."""
    (scenario,) = chosen_scenarios(settings, 1)
    world, agent = set_up(settings, images=True)
    with closing(world):
        referee = Referee(scenario, signs=settings.cap is None)
        for step in rollout(world, agent, scenario):
            outcome = referee.watch(step.truth)
            done = min(1.0, step.truth.route_done / step.truth.route_length)
            yield Scene(step.observation.image, step.observation.command, done)
            if outcome is not None:
                return


def _pictures(settings: PictureSettings, size: tuple[int, int]) -> Iterator[Scene]:
    """A person's own pictures in the network's size (height, width)."""
    source, command = open_source(settings.source, settings.every), Command(settings.command)
    crop = None if settings.crop is None else parse_crop(settings.crop)
    for picture in source:
        kept = picture.image[slice(*kept_rows(picture, crop))]
        yield Scene(
            at_size(kept, (size[1], size[0])), command, min(1.0, picture.number / source.count) if source.count else 0.0
        )


def _write(
    network: Network, scenes: Iterable[Scene], questions: Sequence[Question], method: str, out: Path, rate: float,
    progress: Progress,
) -> int:  # fmt: skip
    """Writes the video. All scenes come before its first frame: one scale holds for all of them."""
    looked = list(look(network, scenes, questions, method, progress))
    if not looked:
        raise ValueError("found no picture, wanted one at least: give another file")
    scales = [scale_of([one.attentions[k].now for one in looked]) for k in range(len(questions))]
    with VideoWriter(out, rate=rate) as video:
        for one in looked:
            video.add(panels(one, scales))
    return len(looked)


def look(
    network: Network, scenes: Iterable[Scene], questions: Sequence[Question], method: str, progress: Progress = silent
) -> Iterator[Looked]:
    """The attention in each scene, with those before it as its history."""
    history: deque[Image] = deque(maxlen=network.span)
    for scene in scenes:
        history.append(scene.image)
        images = list(history)
        attentions = tuple(
            attend(network, Question(question.affordance, scene.command, question.label), images, method)
            for question in questions
        )
        progress("attention", scene.done)
        yield Looked(scene, attentions)


def panels(looked: Looked, scales: Sequence[float]) -> Image:
    """A frame: a panel for each affordance, two beside each other."""
    drawn = [
        explained(looked.scene.image, attention, scale, width=PANEL_WIDTH)
        for attention, scale in zip(looked.attentions, scales, strict=True)
    ]
    columns = min(COLUMNS, len(drawn))
    drawn += [np.full_like(drawn[0], BACKGROUND)] * (-len(drawn) % columns)
    rows = [np.concatenate(drawn[k : k + columns], axis=1) for k in range(0, len(drawn), columns)]
    frame = np.concatenate(rows)
    return frame[: frame.shape[0] // 2 * 2]


class LiveAttention:
    """Draws the attention to one affordance while a car drives, for recordings. Its scale is the largest so far: what
    comes is not known yet. model: the network, None for the one in the package."""

    def __init__(self, affordance: str, model: Path | None = None, method: str = "hirescam") -> None:
        self.question, self.method = Question(affordance), method
        self.network, _ = load_network(model_path(model))
        self._history: deque[Image] = deque(maxlen=self.network.span)
        self._scale, self._time = 0.0, 0.0

    def __call__(self, observation: Observation) -> Image | None:
        """The picture of an observation; None where its image is of another size than the network's."""
        if observation.image.shape[:2] != self.network.config.image_size:
            return None
        if observation.time < self._time:  # another episode
            self._history.clear()
        self._time = observation.time
        self._history.append(observation.image)
        question = replace(self.question, command=observation.command)
        attention = attend(self.network, question, list(self._history), self.method)
        self._scale = max(self._scale, scale_of([attention.now]))
        return explained(observation.image, attention, self._scale, width=PANEL_WIDTH)
