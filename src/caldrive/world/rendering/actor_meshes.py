"""Meshes of cars and people, of which each picture draws many: the fine ones near by, the coarse ones far away."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from caldrive.compiled import Floats, Integers, compiled, f32, inlined
from caldrive.world.rendering.actors import Actors
from caldrive.world.rendering.light import Light
from caldrive.world.scene.cars import GLOWING, SHAPES, CarPart, car_mesh, far_car_mesh
from caldrive.world.scene.meshes import merge
from caldrive.world.scene.people import (
    HIP_HEIGHT,
    SHOULDER_HEIGHT,
    Limb,
    Shown,
    far_person_mesh,
    half_of,
    person_mesh,
)

PAINT, GLASS = int(CarPart.PAINT), int(CarPart.GLASS)
LEFT_LEG, RIGHT_LEG, LEFT_ARM, RIGHT_ARM = (
    int(limb) for limb in (Limb.LEFT_LEG, Limb.RIGHT_LEG, Limb.LEFT_ARM, Limb.RIGHT_ARM)
)
HIP, SHOULDER = f32(HIP_HEIGHT), f32(SHOULDER_HEIGHT)
ZERO, HALF, ONE, PER_BYTE = f32(0.0), f32(0.5), f32(1.0), f32(1 / 255)


class ActorMeshes(NamedTuple):
    """All meshes in one."""

    positions: Floats
    """(V, 3) in m."""
    normals: Floats
    """(V, 3)."""
    colors: Floats
    """(V, 3) in [0, 1]."""
    parts: Integers
    """(V, 2): slot and spare byte, see `meshes.VERTEX`."""
    triangles: Integers
    """(T, 3)."""
    bounds: Integers
    """(M + 1,): the first triangle of each mesh, and the end of the last."""
    sizes: Integers
    """(M,): triangles of each mesh."""


def actor_meshes() -> ActorMeshes:
    """Of each shape of car the fine and the coarse one, then those of people, whole, their legs and their torsos."""
    meshes = [make(shape) for shape in SHAPES for make in (car_mesh, far_car_mesh)] + [person_mesh(), far_person_mesh()]
    meshes += [half_of(mesh, half) for half in (Shown.LEGS, Shown.TORSO) for mesh in meshes[-2:]]
    whole = merge(meshes)
    vertices = whole.vertices
    parts = np.stack((vertices["slot"], vertices["spare"]), axis=1)
    return ActorMeshes(
        positions=np.ascontiguousarray(vertices["position"]),
        normals=((vertices["normal"].astype(float) - 128) / 127).astype(np.float32),
        colors=(vertices["color"] / 255).astype(np.float32),
        parts=parts.astype(np.int32),
        triangles=whole.triangles.astype(np.int32),
        bounds=np.cumsum([0, *(len(mesh.triangles) for mesh in meshes)]).astype(np.int32),
        sizes=np.array([len(mesh.triangles) for mesh in meshes], np.int32),
    )


@compiled
def project_actors(
    meshes: ActorMeshes, actors: Actors, matrix: Floats, corners: Floats, sources: Integers, n: int
) -> int:
    """Writes the clip coordinates of all triangles of some actors from place n on; returns where they end. sources:
    (triangles, 2): actor and triangle."""
    for actor in range(len(actors.meshes)):
        mesh = actors.meshes[actor]
        for triangle in range(meshes.bounds[mesh], meshes.bounds[mesh + 1]):
            for k in range(3):
                x, y, z = _in_the_world(meshes, actors, actor, meshes.triangles[triangle, k])
                for axis in range(3):
                    corners[n, k, axis] = (
                        matrix[axis, 0] * x + matrix[axis, 1] * y + matrix[axis, 2] * z + matrix[axis, 3]
                    )
            sources[n, 0], sources[n, 1] = actor, triangle
            n += 1
    return n


@inlined
def _in_the_world(
    meshes: ActorMeshes, actors: Actors, actor: int, vertex: int
) -> tuple[np.float32, np.float32, np.float32]:
    """Where a vertex of an actor is, in m."""
    place, scale = actors.places[actor], actors.scales[actor]
    x, y, z = meshes.positions[vertex, 0], meshes.positions[vertex, 1], meshes.positions[vertex, 2]
    cosine, sine, pivot = _swing(meshes.parts[vertex, 1], place)
    x, z = cosine * x - sine * (z - pivot), sine * x + cosine * (z - pivot) + pivot
    x, y, z = x * scale[0], y * scale[1], z * scale[2]
    return place[2] * x - place[3] * y + place[0], place[3] * x + place[2] * y + place[1], z + place[6]


@inlined
def _swing(limb: int, place: Floats) -> tuple[np.float32, np.float32, np.float32]:
    """Cosine and sine of a limb's angle, and the height that it turns about; opposite limbs swing together."""
    if limb in (LEFT_LEG, RIGHT_ARM):
        return place[4], place[5], HIP if limb == LEFT_LEG else SHOULDER
    if limb in (RIGHT_LEG, LEFT_ARM):
        return place[4], -place[5], HIP if limb == RIGHT_LEG else SHOULDER
    return ONE, ZERO, ZERO


@compiled
def actor_values(
    meshes: ActorMeshes, actors: Actors, source: Integers, light: Light, values: Floats, flat: Floats
) -> None:
    """Writes what `surfaces` needs of one triangle: values (3, VALUES) and flat (FLATS,). source: as above."""
    actor, triangle = source[0], source[1]
    place = actors.places[actor]
    flat[0], flat[1] = place[0], place[1]
    for k in range(3):
        vertex = meshes.triangles[triangle, k]
        slot, spare = meshes.parts[vertex, 0], meshes.parts[vertex, 1]
        nx, ny, nz = _normal(meshes, place, vertex, spare)
        _, _, z = _in_the_world(meshes, actors, actor, vertex)
        gloss = ZERO
        if slot == GLASS:
            gloss = f32(0.30)
        elif slot == PAINT and spare == 0 and _is_black(actors.colors[actor]):  # people have a fourth colour
            gloss = f32(0.12)
        up = HALF + HALF * nz
        facing = nx * light.sun_direction[0] + ny * light.sun_direction[1] + nz * light.sun_direction[2]
        for c in range(3):
            albedo = meshes.colors[vertex, c]
            if 0 < slot < GLASS:
                albedo *= actors.colors[actor, 3 * slot - 3 + c]
            lit = albedo * (light.ground_ambient[c] + up * (light.sky_ambient[c] - light.ground_ambient[c]))
            lit += gloss * light.horizon[c] * (f32(0.35) + f32(0.65) * max(nz, ZERO))
            sunlit = albedo * light.sun[c] * max(facing, ZERO)
            glows = spare == GLOWING
            values[k, c], values[k, 3 + c] = (albedo, ZERO) if glows else (lit, sunlit)
        values[k, 6], values[k, 7] = z - place[6], ZERO


@inlined
def _is_black(colors: Floats) -> bool:
    """Whether the fourth colour is none: people have one, cars have not."""
    return bool(colors[9] == ZERO and colors[10] == ZERO and colors[11] == ZERO)


@inlined
def _normal(meshes: ActorMeshes, place: Floats, vertex: int, spare: int) -> tuple[np.float32, np.float32, np.float32]:
    """The normal of an actor's vertex in the world."""
    x, y, z = meshes.normals[vertex, 0], meshes.normals[vertex, 1], meshes.normals[vertex, 2]
    cosine, sine, _ = _swing(spare, place)
    x, z = cosine * x - sine * z, sine * x + cosine * z
    return place[2] * x - place[3] * y, place[3] * x + place[2] * y, z
