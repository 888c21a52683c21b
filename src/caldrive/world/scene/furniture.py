"""Everything that stands still but buildings, as meshes: trees, lights, signs, lamps and other street furniture."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence

import numpy as np

from caldrive.datatypes import Semantic
from caldrive.world.scene.appearance import N_VARIANTS, Appearance, Distractor, Profile, TreeType
from caldrive.world.scene.meshes import (
    BUILDING_SHADOWS,
    RGB,
    WHITE,
    LodMesh,
    Mesh,
    Surface,
    box,
    disc,
    lathe,
    lod_with_class,
    merge,
    packed,
    quads,
    smooth,
)
from caldrive.world.scene.scenery import Prop
from caldrive.world.scene.textures import SIGN_LAYERS, Tex

# Of props; all others are furniture.
PROP_CLASSES = {"tree": Semantic.PLANT, "hedge": Semantic.PLANT, "light_post": Semantic.LIGHT}
LIGHT_HEIGHT = 2.5  # m, the middle of a light's head; so low that the red lamp is in view wherever it counts
LAMP_HEIGHTS = {"red": LIGHT_HEIGHT + 0.34, "yellow": LIGHT_HEIGHT, "green": LIGHT_HEIGHT - 0.34}  # m above the ground
LAMP_RADIUS = 0.155  # m
LAMP_FACE = -0.2  # m ahead of the post's middle: the side that the traffic sees
SIGN_HEIGHT, SIGN_RADIUS = 2.1, 0.5  # m
TREE_HEIGHT = 6.0  # m, of the templates
_POLE, _LAMP_POST, _LANTERN = Surface((132, 136, 140)), Surface((70, 74, 80)), Surface((52, 60, 54))
_UNLIT = {"red": (74, 22, 22), "yellow": (76, 62, 20), "green": (20, 62, 34)}


def furniture_meshes(props: Sequence[Prop], appearance: Appearance, foot: float) -> LodMesh:
    """Everything but buildings, as one mesh for each level of detail. foot: height of the ground, m."""
    groups: defaultdict[tuple[str, int, int], list[Prop]] = defaultdict(list)
    for prop in props:
        if prop.kind != "building":
            groups[prop.kind, prop.variant, prop.limit].append(prop)
    always, near, far = list[Mesh](), list[Mesh](), list[Mesh]()
    for (kind, variant, limit), members in groups.items():
        semantic = PROP_CLASSES.get(kind, Semantic.FURNITURE)
        template = lod_with_class(_template(kind, variant, limit, appearance), semantic)
        scales = [prop.height / TREE_HEIGHT if kind == "tree" else 1.0 for prop in members]
        for meshes, mesh in ((always, template.always), (near, template.near), (far, template.far)):
            if len(mesh.triangles):
                meshes.append(copies(mesh, members, foot, scales))
    return LodMesh(merge(always), merge(near), merge(far))


def copies(mesh: Mesh, props: Sequence[Prop], foot: float, scales: Sequence[float]) -> Mesh:
    """A template copied to the poses of N props and scaled by N factors, standing at a height in m."""
    n, v = len(props), len(mesh.vertices)
    heading = np.array([prop.pose.heading for prop in props])
    c, s = np.cos(heading), np.sin(heading)
    zero, unit = np.zeros(n), np.ones(n)
    turn = np.stack(
        (np.stack((c, s, zero), 1), np.stack((-s, c, zero), 1), np.stack((zero, zero, unit), 1)), 1
    )  # row vectors
    vertices = np.tile(mesh.vertices, (n, 1))
    at = np.array([(prop.pose.x, prop.pose.y, foot) for prop in props])
    vertices["position"] = np.asarray(scales)[:, None, None] * (vertices["position"] @ turn) + at[:, None]
    vertices["normal"] = packed((vertices["normal"] - 128.0) / 127 @ turn)
    triangles = mesh.triangles[None] + (v * np.arange(n, dtype=np.uint32))[:, None, None]
    owners = np.repeat(at[:, :2], len(mesh.triangles), axis=0)
    return Mesh(vertices.reshape(-1), triangles.reshape(-1, 3), owners)


def _template(kind: str, variant: int, limit: int, appearance: Appearance) -> LodMesh:
    """One prop of a kind at the origin, looking along x."""
    if distractor := appearance.furniture.distractor(kind, variant):
        return _distractor(distractor)
    detailed: dict[str, Callable[[], LodMesh]] = {
        "light_post": _light_post,
        "sign_post": lambda: _sign_post(limit),
        "tree": lambda: _tree(appearance.trees[variant]),
        "lamp": lambda: _lamp(appearance.lamp_arm),
        "billboard": lambda: _billboard(variant),
    }
    return detailed[kind]() if kind in detailed else _simple(kind, variant, appearance)


def _simple(kind: str, variant: int, appearance: Appearance) -> LodMesh:
    """Props of one mesh: large ones are always drawn, small ones only from near."""
    furniture = appearance.furniture
    hue = furniture.hues[variant % N_VARIANTS]
    large = {
        "hedge": lambda: box((0, 0, 0.62), (0.9, 7.0, 1.36), Surface((86, 122, 62), Tex.LEAVES, tile=2.0)),
        "fence": lambda: box((0, 0, 0.7), (0.08, 8.0, 1.5), Surface(appearance.fence, Tex.BRICKS, tile=3.0)),
        "wall": lambda: box((0, 0, 0.95), (0.3, 8.0, 2.0), Surface((176, 160, 150), Tex.BRICKS, tile=2.4)),
        "container": lambda: box((0, 0, 1.25), (2.4, 6.0, 2.6), Surface(hue, Tex.TILES, tile=2.0)),
    }
    small = {
        "bin": lambda: lathe(((0.2, 0.0), (0.23, 0.9), (0.0, 0.98)), 6, Surface(furniture.bin)),
        "hydrant": lambda: lathe(((0.14, 0.0), (0.12, 0.6), (0.0, 0.75)), 6, Surface(furniture.hydrant)),
        "box": lambda: box((0, 0, 0.6), (0.5, 0.9, 1.3), Surface(hue)),
        "bench": lambda: _bench(furniture.bench),
    }
    return LodMesh(always=large[kind]()) if kind in large else LodMesh(near=small[kind]())


def _pole(height: float, radius: float, surface: Surface = _POLE, n: int = 5) -> Mesh:
    return lathe(((radius, -0.05), (radius, height)), n, surface)


def _light_post() -> LodMesh:
    """The mast, a black plate with a light rim, and three dark lenses; the camera adds the lit one."""
    mast = _pole(LIGHT_HEIGHT - 0.52, 0.07, Surface((86, 90, 94)), 3)
    rim = box((0.0, 0, LIGHT_HEIGHT), (0.05, 0.66, 1.30), Surface((226, 226, 222)))
    x, y, z0, z1 = -0.04, 0.29, LIGHT_HEIGHT - 0.61, LIGHT_HEIGHT + 0.61
    plate = quads([[(x, y, z0), (x, -y, z0), (x, -y, z1), (x, y, z1)]], (34, 36, 38))
    housing = box((-0.11, 0, LIGHT_HEIGHT), (0.16, 0.40, 1.08), Surface((26, 27, 29)))
    lenses = [
        disc((LAMP_FACE - 0.005, 0, z), LAMP_RADIUS, 8, Surface(_UNLIT[name]), facing=-1)
        for name, z in LAMP_HEIGHTS.items()
    ]
    return LodMesh(always=merge((mast, rim, plate)), near=merge((housing, *lenses)))


def _sign_post(limit: int) -> LodMesh:
    face = Surface(WHITE, SIGN_LAYERS[limit], slot=Semantic.SIGN)
    near, far = (
        merge((
            _pole(2.1, 0.045, n=pole_sides),
            disc((-0.07, 0, SIGN_HEIGHT), SIGN_RADIUS, n, face, facing=-1),
        ))
        for pole_sides, n in ((4, 16), (3, 8))
    )  # fmt: skip
    back = disc((-0.05, 0, SIGN_HEIGHT), SIGN_RADIUS, 6, Surface((118, 120, 122)))
    return LodMesh(back, near, far)


def _dented(mesh: Mesh, strength: float) -> Mesh:
    """Dents in a crown; where two vertices meet they stay together."""
    vertices = mesh.vertices.copy()
    x, y, z = vertices["position"].T
    vertices["position"][:, :2] *= (1 + strength * np.sin(3 * np.arctan2(y, x) + 2.3 * z) * np.hypot(x, y))[:, None]
    return Mesh(vertices, mesh.triangles)


def _crown(profile: Profile, surface: Surface, n: int, dents: float) -> Mesh:
    middle = (profile[0][1] + profile[-1][1]) / 2
    return smooth(_dented(lathe(profile, n, surface), dents), (0, 0, middle - 0.4), squash=0.8)


def _tree(tree: TreeType) -> LodMesh:
    """The trunk, and a crown with seven sides, from afar with four."""
    profile, is_conifer = tree.profile, tree.layer is Tex.NEEDLES
    trunk = lathe(((0.17, -0.06), (0.12, profile[1][1])), 3, Surface(tree.bark, spare=BUILDING_SHADOWS))
    leaves = Surface(tree.color, tree.layer, tile=2.6, spare=BUILDING_SHADOWS)
    near = _crown(profile, leaves, n=7, dents=0.0 if is_conifer else 0.10)
    rough = (profile[0], profile[1] if is_conifer else profile[2], profile[-1])
    return LodMesh(trunk, near, _crown(rough, leaves, n=4, dents=0.0))


def _lamp(arm: float) -> LodMesh:
    """A lamp on an arm of some length (m), or a lantern where it has none."""
    if arm > 0:
        beam = box((arm, 0, 6.0), (2 * arm + 0.1, 0.22, 0.1), _LAMP_POST)
        return LodMesh(_pole(6.0, 0.07, _LAMP_POST, 3), beam, beam)
    lantern = lathe(((0.09, 4.0), (0.24, 4.5), (0.0, 4.8)), 5, _LANTERN)
    return LodMesh(_pole(4.0, 0.06, _LANTERN, 3), lantern, lathe(((0.09, 4.0), (0.24, 4.5)), 3, _LANTERN))


def _bench(color: RGB) -> Mesh:
    seat = box((0, 0, 0.43), (0.45, 1.7, 0.06), Surface(color))
    back = box((-0.22, 0, 0.72), (0.05, 1.7, 0.3), Surface(color))
    legs = [box((0, y, 0.2), (0.4, 0.07, 0.4), Surface((70, 70, 72))) for y in (-0.7, 0.7)]
    return merge((seat, back, *legs))


def _billboard(variant: int) -> LodMesh:
    layer, frame = (Tex.POSTER_A, (70, 60, 50)) if variant % 2 else (Tex.POSTER_B, (60, 66, 70))
    x, y, z0, z1 = 0.12, 2.2, 1.5, 4.3
    uv = [[(0, 0, layer), (1, 0, layer), (1, 1, layer), (0, 1, layer)]]
    poster = quads([[(x, -y, z0), (x, y, z0), (x, y, z1), (x, -y, z1)]], WHITE, uv)
    board = box((0, 0, 2.9), (0.2, 4.6, 3.0), Surface(frame))
    legs = [box((0, side * 1.5, 0.8), (0.15, 0.15, 1.7), Surface(frame)) for side in (-1, 1)]
    return LodMesh(merge((poster, board, *legs)))


def _distractor(thing: Distractor) -> LodMesh:
    return LodMesh(box((0, 0, thing.height / 2), (thing.length, thing.width, thing.height + 0.1), thing.surface))
