"""The reference line of an OpenDRIVE road: where one is s metres along it (ASAM OpenDRIVE 1.8, section 9)."""

from __future__ import annotations

import math
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import Pose
from caldrive.geometry import moved, wrap_angle

SHAPES = ("line", "arc", "spiral", "poly3", "paramPoly3")  # what a <geometry> can be
STEPS = 65  # places at which a curve is summed up


def number(element: ET.Element, name: str) -> float:
    """An attribute as a number, 0 where it is missing. Raises ValueError where it is none."""
    try:
        value = float(element.get(name) or 0.0)
    except ValueError:
        raise ValueError(f"<{element.tag}> has {name}={element.get(name)!r}, which is no number") from None
    if not math.isfinite(value):
        raise ValueError(f"<{element.tag}> has {name}={value}")
    return value


def pose_on_line(road: ET.Element, s: float) -> Pose:
    """Where the reference line of a road is after s metres, and its heading there.

    Raises ValueError for a road without a <geometry> there, and for numbers that are none.
    """
    here = [piece for piece in road.findall("planView/geometry") if number(piece, "s") <= s + 1e-6]
    if not here:
        raise ValueError(f"road {road.get('id')} has no <geometry> at s={s:g}")
    return _along(here[-1], s - number(here[-1], "s"))


def shape_of(geometry: ET.Element) -> ET.Element | None:
    """The element that says what a <geometry> is; editors put data of their own beside it."""
    return next((child for child in geometry if child.tag in SHAPES), None)


def _along(geometry: ET.Element, ds: float) -> Pose:
    """The pose ds metres into a geometry; one without a shape is straight."""
    start = Pose(number(geometry, "x"), number(geometry, "y"), number(geometry, "hdg"))
    shape, length = shape_of(geometry), number(geometry, "length")
    if shape is None or shape.tag == "line":
        return moved(start, forward=ds)
    if shape.tag == "poly3":
        return _along_cubic(start, shape, ds)
    if shape.tag == "paramPoly3":
        return _along_parametric(start, shape, ds, length)
    first, last = curvatures(shape)
    last = first + ds / max(length, 1e-9) * (last - first)
    s = np.linspace(0, ds, STEPS)
    heading = start.heading + first * s + (last - first) * s**2 / (2 * max(ds, 1e-9))
    x, y = np.trapezoid(np.cos(heading), s), np.trapezoid(np.sin(heading), s)
    return Pose(start.x + float(x), start.y + float(y), wrap_angle(float(heading[-1])))


def curvatures(shape: ET.Element) -> tuple[float, float]:
    """The curvature (1/m) where an arc or a spiral begins, and where it ends."""
    if shape.tag == "arc":
        return number(shape, "curvature"), number(shape, "curvature")
    return number(shape, "curvStart"), number(shape, "curvEnd")


def _along_cubic(start: Pose, shape: ET.Element, ds: float) -> Pose:
    """poly3: v = a + b u + c u² + d u³, u ahead and v to the left of the start, up to an arc length."""
    v = np.array([number(shape, name) for name in "dcba"])
    u = np.linspace(0, ds, STEPS)
    arc = _arc_length(u, np.polyval(v, u))
    at = float(np.interp(ds, arc, u))
    return moved(start, at, float(np.polyval(v, at)), math.atan(float(np.polyval(np.polyder(v), at))))


def _arc_length(u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far it is along a line of points (N,), (N,) from the first to each (N,), m."""
    return np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(u), np.diff(v)))))


def _along_parametric(start: Pose, shape: ET.Element, ds: float, length: float) -> Pose:
    p = ds if shape.get("pRange") == "arcLength" else ds / max(length, 1e-9)
    u, v = ([number(shape, f"{k}{axis}") for k in "dcba"] for axis in "UV")
    turn = math.atan2(float(np.polyval(np.polyder(v), p)), float(np.polyval(np.polyder(u), p)))
    return moved(start, float(np.polyval(u, p)), float(np.polyval(v, p)), turn)
