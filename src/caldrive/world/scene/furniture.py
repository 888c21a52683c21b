"""The classes of the semantic image. In meshes of what stands still, a vertex's slot is its class."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from caldrive.datatypes import Semantic
from caldrive.world.scene.decor import N_VARIANTS, Crown, Decor, Oddment
from caldrive.world.scene.meshes import (
    RGB,
    Detail,
    Mesh,
    box,
    classed_detail,
    disc,
    lathe,
    merge,
    packed,
    quads,
    smooth,
)
from caldrive.world.scene.scenery import Prop
from caldrive.world.scene.textures import SIGN_LAYERS, Tex

# Of props; all others are furniture.
PROP_CLASSES = {"tree": Semantic.PLANT, "hedge": Semantic.PLANT, "light_post": Semantic.LIGHT}
HEAD = 2.5  # m, the middle of a light's head; low enough for the red lamp to be in view wherever it counts
LAMPS = {"red": HEAD + 0.34, "yellow": HEAD, "green": HEAD - 0.34}  # m above the ground
LAMP_RADIUS = 0.155
LAMP_FACE = -0.2  # m ahead of the post's middle: the side that the traffic sees
SIGN_HEIGHT, SIGN_RADIUS = 2.1, 0.5
TREE_HEIGHT = 6.0  # m, of the templates
_POLE: RGB = (132, 136, 140)

_DARK: RGB = (34, 36, 38)


def _pole(height: float, radius: float, color: RGB = _POLE, n: int = 5) -> Mesh:
    return lathe(((radius, -0.05), (radius, height)), n, color)


def _light_post() -> Detail:
    """The mast, a black plate with a light rim, and three dark lenses; the camera adds the lit one."""
    mast, grey = _pole(HEAD - 0.52, 0.07, (86, 90, 94), 3), (226, 226, 222)
    y, z0, z1 = 0.29, HEAD - 0.61, HEAD + 0.61
    face = quads([[(-0.04, y, z0), (-0.04, -y, z0), (-0.04, -y, z1), (-0.04, y, z1)]], _DARK)
    housing = box((-0.11, 0, HEAD), (0.16, 0.40, 1.08), (26, 27, 29))
    dark = {"red": (74, 22, 22), "yellow": (76, 62, 20), "green": (20, 62, 34)}
    lenses = [disc((LAMP_FACE - 0.005, 0, z), LAMP_RADIUS, 8, dark[name], -1) for name, z in LAMPS.items()]
    always = (mast, box((0.0, 0, HEAD), (0.05, 0.66, 1.30), grey), face)
    return Detail(merge(always), merge((housing, *lenses)))


def _sign_post(limit: int) -> Detail:
    near, far = (
        merge(
            (
                _pole(2.1, 0.045, n=sides),
                disc(
                    (-0.07, 0, SIGN_HEIGHT), SIGN_RADIUS, n, (255, 255, 255), -1, SIGN_LAYERS[limit], slot=Semantic.SIGN
                ),
            )
        )
        for sides, n in ((4, 16), (3, 8))
    )
    return Detail(disc((-0.05, 0, SIGN_HEIGHT), SIGN_RADIUS, 6, (118, 120, 122), 1), near, far)


def _uneven(mesh: Mesh, strength: float) -> Mesh:
    """Dents in a crown; where two vertices meet they stay together."""
    made = mesh.vertices.copy()
    x, y, z = made["position"].T
    made["position"][:, :2] *= (1 + strength * np.sin(3 * np.arctan2(y, x) + 2.3 * z) * np.hypot(x, y))[:, None]
    return Mesh(made, mesh.triangles)


def _crown(profile: Sequence[tuple[float, float]], color: RGB, layer: Tex, n: int, dents: float) -> Mesh:
    middle = (profile[0][1] + profile[-1][1]) / 2
    made = lathe(profile, n, color, layer=layer, spare=255, tile=2.6)
    return smooth(_uneven(made, dents), (0, 0, middle - 0.4), 0.8)


def _tree(crown: Crown) -> Detail:
    profile, color, layer = crown.profile, crown.color, crown.layer
    trunk = lathe(((0.17, -0.06), (0.12, profile[1][1])), 3, crown.bark, spare=255)
    dents = 0.0 if layer is Tex.NEEDLES else 0.10
    rough = (profile[0], profile[1] if layer is Tex.NEEDLES else profile[2], profile[-1])
    return Detail(trunk, _crown(profile, color, layer, 7, dents), _crown(rough, color, layer, 4, 0.0))


def _lamp(reach: float) -> Detail:
    """A lamp on an arm, or a lantern where the arm has no length."""
    if reach > 0:
        arm = box((reach, 0, 6.0), (2 * reach + 0.1, 0.22, 0.1), (70, 74, 80))
        return Detail(_pole(6.0, 0.07, (70, 74, 80), 3), arm, arm)
    lantern = lathe(((0.09, 4.0), (0.24, 4.5), (0.0, 4.8)), 5, (52, 60, 54))
    return Detail(_pole(4.0, 0.06, (52, 60, 54), 3), lantern, lathe(((0.09, 4.0), (0.24, 4.5)), 3, (52, 60, 54)))


def _bench(color: RGB) -> Mesh:
    seat = box((0, 0, 0.43), (0.45, 1.7, 0.06), color)
    back = box((-0.22, 0, 0.72), (0.05, 1.7, 0.3), color)
    legs = [box((0, y, 0.2), (0.4, 0.07, 0.4), (70, 70, 72)) for y in (-0.7, 0.7)]
    return merge((seat, back, *legs))


def _billboard(variant: int) -> Detail:
    layer, frame = (Tex.POSTER_A, (70, 60, 50)) if variant % 2 else (Tex.POSTER_B, (60, 66, 70))
    y, z0, z1 = 2.2, 1.5, 4.3
    panel = [[(0.12, -y, z0), (0.12, y, z0), (0.12, y, z1), (0.12, -y, z1)]]
    uv = [[(0, 0, layer), (1, 0, layer), (1, 1, layer), (0, 1, layer)]]
    legs = [box((0, s * 1.5, 0.8), (0.15, 0.15, 1.7), frame) for s in (-1, 1)]
    return Detail(merge((quads(panel, (255, 255, 255), uv), box((0, 0, 2.9), (0.2, 4.6, 3.0), frame), *legs)))


def _oddment(thing: Oddment) -> Detail:
    middle, size = (0, 0, thing.height / 2), (thing.length, thing.width, thing.height + 0.1)
    return Detail(box(middle, size, thing.color, thing.layer, 2.0))


def _template(kind: str, variant: int, label: int, decor: Decor) -> Detail:
    furniture = decor.furniture
    if odd := furniture.oddment(kind, variant):
        return _oddment(odd)
    hue = furniture.hues[variant % N_VARIANTS]
    if kind == "light_post":
        return _light_post()
    if kind == "sign_post":
        return _sign_post(label)
    if kind == "tree":
        return _tree(decor.crowns[variant])
    if kind == "lamp":
        return _lamp(decor.arm)
    if kind == "billboard":
        return _billboard(variant)
    if kind == "hedge":
        return Detail(box((0, 0, 0.62), (0.9, 7.0, 1.36), (86, 122, 62), Tex.LEAVES, 2.0))
    if kind == "fence":
        return Detail(box((0, 0, 0.7), (0.08, 8.0, 1.5), decor.fence, Tex.BRICKS, 3.0))
    if kind == "wall":
        return Detail(box((0, 0, 0.95), (0.3, 8.0, 2.0), (176, 160, 150), Tex.BRICKS, 2.4))
    if kind == "container":
        return Detail(box((0, 0, 1.25), (2.4, 6.0, 2.6), hue, Tex.TILES, 2.0))
    small = {
        "bin": lambda: lathe(((0.2, 0.0), (0.23, 0.9), (0.0, 0.98)), 6, furniture.bin),
        "hydrant": lambda: lathe(((0.14, 0.0), (0.12, 0.6), (0.0, 0.75)), 6, furniture.hydrant),
        "box": lambda: box((0, 0, 0.6), (0.5, 0.9, 1.3), hue),
        "bench": lambda: _bench(furniture.bench),
    }
    return Detail(near=small[kind]())


def copies(mesh: Mesh, props: Sequence[Prop], foot: float, scales: Sequence[float]) -> Mesh:
    """A template copied to the poses of props and scaled, standing at a height."""
    n, v = len(props), len(mesh.vertices)
    heading = np.array([p.pose.heading for p in props])
    c, s = np.cos(heading), np.sin(heading)
    zero, one = np.zeros(n), np.ones(n)
    turn = np.stack(
        (np.stack((c, s, zero), 1), np.stack((-s, c, zero), 1), np.stack((zero, zero, one), 1)), 1
    )  # row vectors
    made = np.tile(mesh.vertices, (n, 1))
    at = np.array([(p.pose.x, p.pose.y, foot) for p in props])
    made["position"] = np.asarray(scales)[:, None, None] * (made["position"] @ turn) + at[:, None]
    made["normal"] = packed((made["normal"] - 128.0) / 127 @ turn)
    triangles = mesh.triangles[None] + (v * np.arange(n, dtype=np.uint32))[:, None, None]
    return Mesh(made.reshape(-1), triangles.reshape(-1, 3), np.repeat(at[:, :2], len(mesh.triangles), axis=0))


def furniture_meshes(props: Sequence[Prop], decor: Decor, foot: float) -> Detail:
    """Everything but buildings, as three meshes: drawn always, from near, from afar. foot: height of the ground (m)."""
    groups: defaultdict[tuple[str, int, int], list[Prop]] = defaultdict(list)
    for prop in props:
        if prop.kind != "building":
            groups[prop.kind, prop.variant, prop.label].append(prop)
    always, near, far = list[Mesh](), list[Mesh](), list[Mesh]()
    for (kind, variant, label), members in groups.items():
        detail = classed_detail(_template(kind, variant, label, decor), PROP_CLASSES.get(kind, Semantic.FURNITURE))
        scales = [p.height / TREE_HEIGHT if kind == "tree" else 1.0 for p in members]
        for found, mesh in ((always, detail.always), (near, detail.near), (far, detail.far)):
            if len(mesh.triangles):
                found.append(copies(mesh, members, foot, scales))
    return Detail(merge(always), merge(near), merge(far))
