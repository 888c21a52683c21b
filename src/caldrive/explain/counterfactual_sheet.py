"""Counterfactuals as pictures: a moment as it was, with the change, the difference, and where the network looked."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
from PIL import Image as Picture
from PIL import ImageDraw

from caldrive.datatypes import Image
from caldrive.explain.counterfactuals import Counterfactual, Seen
from caldrive.explain.overlay import overlay, said, scale_of
from caldrive.visualization.gauges import BACKGROUND, MUTED, write

CAPTION, GAP, WIDTH = 22, 4, 300  # pixels; the width is a picture's
HEADS = ("as it was", "with the change", "difference, three times as strong", "attention, as it was")
STRONGER = 3  # times as strong a difference is drawn, as a shadow is faint


def row(seen: Seen, changed: Counterfactual) -> bytes:
    """A PNG: a case with one of its changes."""
    before, attention, intervention = seen.images[-1], seen.attention, changed.intervention
    difference = np.abs(before.astype(int) - changed.image).max(axis=2, keepdims=True) * STRONGER
    looked = overlay(before, attention.now, scale_of([attention.now]), attention.reply.probability)
    gray = np.broadcast_to(difference.clip(max=255).astype(np.uint8), before.shape)
    pictures = [before, changed.image, gray, looked]
    height = round(before.shape[0] * WIDTH / before.shape[1])
    page = Picture.new("RGB", (len(pictures) * (WIDTH + GAP), height + CAPTION), BACKGROUND)
    for k, picture in enumerate(pictures):
        page.paste(Picture.fromarray(picture).resize((WIDTH, height)), (k * (WIDTH + GAP), CAPTION))
    kind = " (control)" if intervention.control else ""
    text = f"{intervention.situation}, {intervention.name}{kind}: {said(changed.before)}, then {said(changed.after)}"
    write(ImageDraw.Draw(page), (6, CAPTION / 2), text, 13)
    return _png(np.asarray(page))


def sheet(rows: Sequence[bytes]) -> bytes:
    """A PNG of rows, one below the other."""
    head = Picture.new("RGB", (len(HEADS) * (WIDTH + GAP), CAPTION), BACKGROUND)
    for k, text in enumerate(HEADS):
        write(ImageDraw.Draw(head), (k * (WIDTH + GAP) + 6, CAPTION / 2), text, 13, MUTED)
    pictures = [np.asarray(Picture.open(io.BytesIO(one))) for one in rows]
    return _png(np.concatenate([np.asarray(head), *pictures]))


def _png(picture: Image) -> bytes:
    content = io.BytesIO()
    Picture.fromarray(picture).save(content, "PNG", optimize=True)
    return content.getvalue()
