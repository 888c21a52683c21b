"""Where the network looks: class activation maps from gradients (section 4.3 of the paper), by one of two methods.

`gradcam` (Selvaraju et al. 2017), as in the paper: the maps of the last stage, each weighted by the mean of its
gradient. `hirescam` (Draelos and Carin 2020) multiplies each place by its own gradient, so that a map shows what
counted at that place; here it takes the stage before, whose places are half as large. Both take the rectified maps that
the last convolution of the stage is given: behind it, values are shifted by a batch norm, and 0 means nothing.
docs/looking-inside.md measures both.

Captum computes the gradients. All frames of a block's history pass the backbone as one batch: called frame by frame,
Captum would keep the last one's map only and say nothing. The weights are those before they became 8-bit integers,
which have no gradient.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from caldrive.affordances import BY_NAME, AffordanceSpec
from caldrive.datatypes import Command, Image
from caldrive.perception.images import normalise, to_float
from caldrive.perception.network.network import COMMANDS, Network
from caldrive.perception.targets import decode

Map = NDArray[np.float32]
# The stage of the backbone, from 0, whose maps are looked at: in the last one a place stands for 16 x 16 pixels, in the
# one before for 8 x 8.
METHODS = {"hirescam": 3, "gradcam": 4}


@dataclass(frozen=True)
class Question:
    """What a network is asked."""

    affordance: str
    """An affordance by its name."""
    command: Command = Command.STRAIGHT
    """What the navigation system asks for meanwhile."""
    label: int | None = None
    """A class by its value, such as 60 on a sign; without it the likeliest one, of a probability the positive one."""

    def __post_init__(self) -> None:
        """Raises ValueError where there is no such affordance or class."""
        if self.affordance not in BY_NAME:
            raise ValueError(
                f"found affordance {self.affordance!r}, wanted one of {', '.join(BY_NAME)}: type one of them"
            )
        if self.label is not None and self.label not in self.spec.classes:
            raise ValueError(_no_class(self.spec, str(self.label)))

    @classmethod
    def parse(cls, text: str) -> Question:
        """A question as one types it: an affordance's name, with a class of it where that is asked for, such as
        speed_sign=60. Raises ValueError as above."""
        name, equals, label = text.partition("=")
        question = cls(name)
        labels = {str(value): value for value in question.spec.classes}
        if equals and label not in labels:
            raise ValueError(_no_class(question.spec, label))
        return replace(question, label=labels[label]) if equals else question

    @property
    def spec(self) -> AffordanceSpec:
        """The affordance's row."""
        return BY_NAME[self.affordance]


def _no_class(spec: AffordanceSpec, found: str) -> str:
    """What to say where an affordance has no such class."""
    classes = ", ".join(map(str, spec.classes)) or "none, as it is a number"
    wanted = f"{spec.name}={spec.classes[-1]}" if spec.classes else spec.name
    return f"found class {found} of {spec.title}, wanted one of its classes ({classes}): type {wanted}"


@dataclass(frozen=True)
class Reply:
    """What a network says."""

    label: str
    """What was asked in words: a class, or the value itself."""
    probability: float | None
    """Of that class; None for a value."""
    value: float
    """The likeliest class, or a value in SI units (km/h on signs)."""
    target: int
    """The number of the output that was asked about."""


@dataclass(frozen=True)
class Attention:
    """What a reply is made from, in the images that the block looks at."""

    reply: Reply
    maps: tuple[Map, ...]
    """For each frame that the block looks at, the oldest first, (h, w): what speaks for the class, never negative, or
    what makes the value larger (+) and smaller (-)."""
    back: tuple[int, ...]
    """How many frames each of them lies back."""

    @property
    def now(self) -> Map:
        """The map of the present frame."""
        return self.maps[-1]

    @property
    def shares(self) -> tuple[float, ...]:
        """The share of all attention that each frame has."""
        totals = np.array([np.abs(one).sum() for one in self.maps])
        return tuple((totals / max(totals.sum(), 1e-12)).tolist())


def ask(network: Network, question: Question, images: Sequence[Image]) -> Reply:
    """What a network says in the newest of some images (H, W, 3), the oldest first; where there are fewer than it looks
    back, the first one stands for those before it."""
    with torch.no_grad():
        return _reply(question, _outputs(network, question, _batch(network, question, images)))


def attend(network: Network, question: Question, images: Sequence[Image], method: str = "hirescam") -> Attention:
    """Where a network looks, in images as for `ask`. Raises ValueError for an unknown method, RuntimeError without
    Captum."""
    captum = require_captum()
    if method not in METHODS:
        raise ValueError(f"found method {method!r}, wanted one of {', '.join(METHODS)}: type --method hirescam")
    batch = _batch(network, question, images)
    with torch.no_grad():
        reply = _reply(question, _outputs(network, question, batch))
    asked, layer = partial(_evidence, network, question, reply.target), _last_convolution(network, METHODS[method])
    if method == "gradcam":
        maps = captum.LayerGradCam(asked, layer).attribute(batch, attribute_to_layer_input=True)[:, 0]
    else:
        maps = captum.LayerGradientXActivation(asked, layer).attribute(batch, attribute_to_layer_input=True).sum(1)
    arrays = (maps.relu() if question.spec.discrete else maps).detach().numpy().astype(np.float32)
    return Attention(reply, tuple(arrays), frames_back(network, question.affordance))


def frames_back(network: Network, affordance: str) -> tuple[int, ...]:
    """How many frames back each frame lies that the block of an affordance looks at, the oldest first."""
    config = network.task_blocks()[affordance].config
    return tuple(k * config.dilation for k in reversed(range(config.length)))


def frames_at(images: Sequence[Image], back: Sequence[int]) -> list[Image]:
    """The images (H, W, 3) that lie so many frames back, of some that end with the present one; where there are fewer,
    the first one stands for those before it."""
    last = len(images) - 1
    return [images[max(0, last - frames)] for frames in back]


def upsampled(one: Map, size: tuple[int, int]) -> Map:
    """A map (h, w) at the size (H, W) of an image, bilinear."""
    grid = torch.from_numpy(one)[None, None]
    result: Map = nn.functional.interpolate(grid, size=size, mode="bilinear", align_corners=False)[0, 0].numpy()
    return result


def require_captum() -> Any:
    """Captum's module of attributions. Raises RuntimeError where it is missing."""
    try:
        import captum.attr
    except ImportError as error:
        raise RuntimeError("found no Captum, wanted it for attention: type pip install 'caldrive[explain]'") from error
    return captum.attr


def _batch(network: Network, question: Question, images: Sequence[Image]) -> Tensor:
    """The images (T, 3, H, W) that the block looks at. Raises ValueError where they are of another size than the
    network's."""
    (height, width), wanted = images[-1].shape[:2], network.config.image_size
    if (height, width) != wanted:
        raise ValueError(
            f"found images of {width} x {height}, wanted {wanted[1]} x {wanted[0]} as this network takes them: give "
            "--model with one for these"
        )
    return normalise(to_float(np.stack(frames_at(images, frames_back(network, question.affordance)))))


def _outputs(network: Network, question: Question, images: Tensor) -> Tensor:
    """The outputs (1, K) of a block from the images that it looks at."""
    back, features = frames_back(network, question.affordance), network.features(images)
    place = {frames: k for k, frames in enumerate(back)}
    history = features[[place.get(frames, 0) for frames in reversed(range(back[0] + 1))]]
    command = torch.tensor([[COMMANDS.index(question.command)]])
    result: Tensor = network.task_blocks()[question.affordance](history[None], command)
    return result


def _evidence(network: Network, question: Question, target: int, images: Tensor) -> Tensor:
    """What is looked for in the images, (1,): a value, or how much more speaks for a class than for all others. One
    class's output alone misses what only speaks against the others."""
    outputs = _outputs(network, question, images)
    if not question.spec.discrete:
        return outputs[:, target]
    others = torch.cat((outputs[:, :target], outputs[:, target + 1 :]), dim=1)
    return outputs[:, target] - others.logsumexp(1)


def _last_convolution(network: Network, stage: int) -> nn.Module:
    """The last convolution of a stage of the backbone: what it is given is not halved yet."""
    convolutions = network.backbone.stages[stage]
    assert isinstance(convolutions, nn.ModuleList)
    return convolutions[-1]


def _reply(question: Question, output: Tensor) -> Reply:
    """Outputs (1, K) in words and numbers."""
    spec = question.spec
    others = {name: torch.zeros(1, other.outputs) for name, other in BY_NAME.items()}
    value = float(getattr(decode(others | {spec.name: output}), spec.name) or 0)
    if not spec.discrete:
        return Reply(spec.title, None, value, 0)
    target = 1 if spec.binary else int(output.argmax())
    if question.label is not None:
        target = spec.classes.index(question.label)
    which = "" if spec.binary else f" {spec.classes[target]}"
    label = f"{spec.title}{which}" if target else f"no {spec.title}"
    return Reply(label, float(output[0].softmax(0)[target]), value, target)
