"""Areas and volumes of meshes."""

from __future__ import annotations

import numpy as np

from caldrive.world.scene.meshes import Mesh


def area_vectors(mesh: Mesh) -> np.ndarray:
    """Normals (N, 3) of the triangles, as long as these are large (m²)."""
    a, b, c = np.moveaxis(mesh.vertices["position"][mesh.triangles].astype(float), 1, 0)
    return np.cross(b - a, c - a) / 2


def volume(mesh: Mesh) -> float:
    """Enclosed volume (m³); positive where triangles are counter-clockwise from outside."""
    return float((mesh.vertices["position"][mesh.triangles[:, 0]] * area_vectors(mesh)).sum() / 3)
