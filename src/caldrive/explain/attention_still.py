"""Where the network looks in a picture of one's own, as a still: the raw picture, and beside it each affordance."""

from __future__ import annotations

import io
from collections import deque
from collections.abc import Iterable, Sequence

import numpy as np
from PIL import Image as Picture
from PIL import ImageDraw

from caldrive.agents.rows import model_path
from caldrive.checks import require_within, require_writable_file
from caldrive.datatypes import Image
from caldrive.driving.settings import PictureSettings
from caldrive.explain.activation_maps import Question, attend
from caldrive.explain.attention_video import PANEL_WIDTH, Scene, grid, own_scenes
from caldrive.explain.overlay import BAR, scale_of, still
from caldrive.files import write_whole
from caldrive.perception.network.checkpoint import load_network
from caldrive.perception.network.network import Network
from caldrive.visualization.gauges import BACKGROUND, MUTED, write

ENDING = ".png"


def draw_still(settings: PictureSettings, affordances: Sequence[str], method: str) -> None:
    """Draws where the network looks in a person's own picture; of several the last one, with those before it as its
    history. Raises ValueError for settings that cannot be."""
    require_writable_file(settings.out, "--out", ENDING)
    require_within("--every", settings.every, 1, 1_000_000, 1)
    questions = [Question.parse(text) for text in affordances]
    network, _ = load_network(model_path(settings.model))
    write_whole(settings.out, _still(network, own_scenes(settings, network.config.image_size), questions, method))


def _still(network: Network, scenes: Iterable[Scene], questions: Sequence[Question], method: str) -> bytes:
    """The newest of some scenes as a PNG."""
    last = deque(scenes, maxlen=network.span)
    if not last:
        raise ValueError("found no picture, wanted one at least: give another file")
    images = [scene.image for scene in last]
    drawn = [_raw(images[-1])]
    for question in questions:
        asked = Question(question.affordance, last[-1].command, question.label)
        attention = attend(network, asked, images, method)
        drawn.append(still(images, attention, scale_of(attention.maps), width=PANEL_WIDTH))
    content = io.BytesIO()
    Picture.fromarray(grid(drawn)).save(content, "PNG", optimize=True)
    return content.getvalue()


def _raw(image: Image) -> Image:
    """The picture without attention, as large as it is drawn with it."""
    height = round(image.shape[0] * PANEL_WIDTH / image.shape[1])
    page = Picture.new("RGB", (PANEL_WIDTH, height + BAR), BACKGROUND)
    page.paste(Picture.fromarray(image).resize((PANEL_WIDTH, height), Picture.Resampling.BICUBIC))
    write(ImageDraw.Draw(page), (8, height + BAR / 2), "what the network is shown", 14, MUTED)
    return np.asarray(page)
