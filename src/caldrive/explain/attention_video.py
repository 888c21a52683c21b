"""Where the network looks as moving pictures: a video of a drive, or of a person's own pictures."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO

import numpy as np

from caldrive.agents.registry import agent_entry
from caldrive.agents.rows import model_path
from caldrive.checks import require_within, require_writable_file
from caldrive.datatypes import Affordances, CameraConfig, Command, Image
from caldrive.driving.choice import chosen_scenarios
from caldrive.driving.pictures import open_source
from caldrive.driving.referee import Referee
from caldrive.driving.rollout import rollout
from caldrive.driving.see import at_size, kept_rows, parse_crop
from caldrive.driving.settings import EpisodeSettings, PictureSettings
from caldrive.driving.setup import set_up
from caldrive.explain.activation_maps import Attention, Question, attend
from caldrive.explain.overlay import explained, scale_of, true_text
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
    truth: Affordances | None = None
    """What is true in it, where that is known."""


@dataclass(frozen=True)
class Looked:
    """A scene, and the attention to each affordance in it."""

    scene: Scene
    attentions: tuple[Attention, ...]
    truths: tuple[str, ...]
    """What is true of each affordance, by `true_text`; empty where that is not known."""


def drive_attention(
    settings: EpisodeSettings, affordances: Sequence[str], method: str, out: Path, progress: Progress = silent
) -> int:
    """Drives an episode and writes the video of where CAL's network looks (that of `settings` where it drives, else the
    package's); returns its number of frames. Raises ValueError for settings that cannot be."""
    questions = _checked(affordances, out)
    network, _ = load_network(model_path(settings.model if settings.agent == "cal" else None))
    require_camera(agent_entry(settings.agent).camera(settings) or CameraConfig(), network)
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
    scenes = own_scenes(settings, network.config.image_size)
    return _write(network, scenes, questions, method, settings.out, source.rate / source.every, progress)


def _checked(affordances: Sequence[str], out: Path) -> list[Question]:
    """The questions, without a command. Raises ValueError where one, or the video's name, cannot be."""
    require_writable_file(out, "--out", ".mp4")
    return [Question.parse(text) for text in affordances]


def require_camera(camera: CameraConfig, network: Network) -> None:
    """Raises ValueError where an agent's camera does not give what a network takes."""
    height, width = network.config.image_size
    if (camera.width, camera.height) != (width, height):
        raise ValueError(
            f"found an agent whose camera gives {camera.width} x {camera.height}, wanted {width} x {height} as the "
            "network takes them that is asked where it looks: take another --agent, or do without attention"
        )


def _driven(settings: EpisodeSettings) -> Iterator[Scene]:
    """What the camera sees in an episode, until the referee ends it."""
    (scenario,) = chosen_scenarios(settings, 1)
    world, agent = set_up(settings, images=True)
    with closing(world):
        referee = Referee(scenario, signs=settings.cap is None)
        for step in rollout(world, agent, scenario):
            outcome = referee.watch(step.truth)
            done = min(1.0, step.truth.route_done / step.truth.route_length)
            yield Scene(step.observation.image, step.observation.command, done, step.truth.affordances)
            if outcome is not None:
                return


def own_scenes(settings: PictureSettings, size: tuple[int, int]) -> Iterator[Scene]:
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
    """Writes the video. All scenes come before its first frame, as one scale holds for all of them: meanwhile their
    arrays lie in a file without a name."""
    out.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryFile(dir=out.parent) as file:
        looked = [_put_away(file, one) for one in look(network, scenes, questions, method, progress)]
        if not looked:
            raise ValueError("found no picture, wanted one at least: give another file")
        scales = [scale_of([one.attentions[k].now for one in looked]) for k in range(len(questions))]
        file.seek(0)
        with VideoWriter(out, rate=rate) as video:
            for one in looked:
                video.add(panels(_taken_back(file, one), scales))
    return len(looked)


def _put_away(file: IO[bytes], looked: Looked) -> Looked:
    """Writes the arrays of a scene; what is left has the present maps alone, from which the scale is made."""
    np.save(file, looked.scene.image, allow_pickle=False)
    for attention in looked.attentions:
        np.save(file, np.stack(attention.maps), allow_pickle=False)
    attentions = (replace(attention, maps=(attention.now.copy(),)) for attention in looked.attentions)
    scene = replace(looked.scene, image=np.empty((0, 0, 3), np.uint8))
    return replace(looked, scene=scene, attentions=tuple(attentions))


def _taken_back(file: IO[bytes], left: Looked) -> Looked:
    """The next scene, with its arrays."""
    scene = replace(left.scene, image=np.load(file, allow_pickle=False))
    attentions = (replace(one, maps=tuple(np.load(file, allow_pickle=False))) for one in left.attentions)
    return replace(left, scene=scene, attentions=tuple(attentions))


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
        yield Looked(scene, attentions, tuple(_truth(question, scene.truth) for question in questions))


def _truth(question: Question, truth: Affordances | None) -> str:
    """What is true of an affordance, by `true_text`; empty where that is not known."""
    return "" if truth is None else true_text(question.spec, getattr(truth, question.affordance))


def panels(looked: Looked, scales: Sequence[float]) -> Image:
    """A frame: a panel for each affordance, two beside each other."""
    drawn = [
        explained(looked.scene.image, attention, scale, width=PANEL_WIDTH, truth=truth)
        for attention, scale, truth in zip(looked.attentions, scales, looked.truths, strict=True)
    ]
    frame = grid(drawn)
    return frame[: frame.shape[0] // 2 * 2]


def grid(drawn: Sequence[Image]) -> Image:
    """Pictures of one width, two beside each other, each row as high as its highest."""
    columns = min(COLUMNS, len(drawn))
    rows = [_row(drawn[k : k + columns], columns * drawn[0].shape[1]) for k in range(0, len(drawn), columns)]
    return np.concatenate(rows)


def _row(drawn: Sequence[Image], width: int) -> Image:
    """Pictures beside each other, so many pixels wide."""
    row = np.full((max(len(one) for one in drawn), width, 3), BACKGROUND, np.uint8)
    for k, one in enumerate(drawn):
        row[: len(one), k * one.shape[1] : (k + 1) * one.shape[1]] = one
    return row
