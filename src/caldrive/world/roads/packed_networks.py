"""SUMO networks that take little room: what no simulation needs is left out, and many are packed into one archive.

In the archive the points of a shape stand as whole centimetres from the point before, which packs better.
"""

from __future__ import annotations

import io
import lzma
import re
import tarfile
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

import numpy as np

from caldrive.files import write_whole

ARCHIVE = Path(__file__).parent / "data" / "generated_towns.tar.xz"
_OUTLINES = re.compile(rb'(<(?:edge|junction) [^>]*) shape="[^"]*"')
_SHAPE = re.compile(rb'(?<= shape=")[^"]+')


def stripped(network: bytes) -> bytes:
    """A network without the outlines of edges and junctions, which only editors draw, without indentation, and with one
    zero instead of two."""
    return re.sub(rb"\n\s+", b"\n", _OUTLINES.sub(rb"\1", network)).replace(b"-0.00", b"0.00")


def pack(networks: Mapping[str, bytes], archive: Path = ARCHIVE) -> None:
    """Writes an archive of stripped networks, in centimetres, by their names."""
    content = io.BytesIO()
    with tarfile.open(fileobj=content, mode="w", format=tarfile.USTAR_FORMAT) as file:
        for name, network in sorted(networks.items()):
            member, packed = tarfile.TarInfo(name), _SHAPE.sub(_to_steps, network)
            member.size = len(packed)
            file.addfile(member, io.BytesIO(packed))
    write_whole(archive, lzma.compress(content.getvalue(), preset=9 | lzma.PRESET_EXTREME))


@lru_cache(maxsize=1)
def packed_names() -> frozenset[str]:
    """The names of the networks in the package's archive."""
    with tarfile.open(ARCHIVE) as file:
        return frozenset(file.getnames())


def packed_network(name: str) -> bytes:
    """A network of the package's archive, as it was stripped."""
    with tarfile.open(ARCHIVE) as file:
        member = file.extractfile(name)
        assert member is not None
        return _SHAPE.sub(_from_steps, member.read())


def _to_steps(shape: re.Match[bytes]) -> bytes:
    """Points as whole centimetres, each but the first from the one before."""
    points = np.rint(100 * np.array([point.split(b",") for point in shape[0].split()], dtype=float)).astype(int)
    points[1:] = np.diff(points, axis=0)
    return b" ".join(b"%d,%d" % (x, y) for x, y in points.tolist())


def _from_steps(shape: re.Match[bytes]) -> bytes:
    """Points in metres: the inverse of `_to_steps`."""
    steps = np.array([step.split(b",") for step in shape[0].split()], dtype=int)
    return b" ".join(b"%.2f,%.2f" % (x, y) for x, y in (np.cumsum(steps, axis=0) / 100).tolist())
