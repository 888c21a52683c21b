"""Small OpenDRIVE maps."""

from __future__ import annotations

import math
import re
from pathlib import Path

LINE = '<geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry>'


def lane(number: int, kind: str = "driving", link: str = "", width: float = 4.0, more: str = "") -> str:
    """A lane of a road; link: ids of lanes before and after it, such as `-1 -1`, empty where there are none."""
    ends = "".join(
        f'<{end} id="{id}"/>' for end, id in zip(("predecessor", "successor"), link.split(), strict=False) if id != "."
    )
    size = f'<width sOffset="0" a="{width}" b="0" c="0" d="0"/>'
    return f'<lane id="{number}" type="{kind}" level="false"><link>{ends}</link>{size}{more}</lane>'


def lanes(right: str, left: str = "") -> str:
    """All lanes of a road."""
    parts = (f"<left>{left}</left>" if left else "", '<center><lane id="0" type="none" level="false"/></center>')
    return f'<lanes><laneSection s="0">{"".join(parts)}<right>{right}</right></laneSection></lanes>'


LANES = lanes(lane(-1), lane(1))


def road(
    number: int | str,
    geometry: str,
    of_lanes: str = LANES,
    links: str = "",
    signals: str = "",
    attributes: str = 'junction="-1"',
) -> str:
    """A road, as long as its geometry."""
    length = sum(float(piece) for piece in re.findall(r'<geometry[^>]* length="([^"]*)"', geometry))
    return f"""<road name="" length="{length}" id="{number}" {attributes}><link>{links}</link>
        <planView>{geometry}</planView>{of_lanes}<signals>{signals}</signals></road>"""


def straight(x: float, y: float, heading: float, length: float) -> str:
    """A straight reference line; heading in rad."""
    return f'<geometry s="0" x="{x}" y="{y}" hdg="{heading}" length="{length}"><line/></geometry>'


def write_roads(folder: Path, *parts: str, header: str = "", name: str = "map") -> Path:
    """A map of some roads and junctions."""
    path = folder / f"{name}.xodr"
    header = f'<header revMajor="1" revMinor="4" name="" version="1.0">{header}</header>'
    path.write_text(f'<?xml version="1.0"?><OpenDRIVE>{header}{"".join(parts)}</OpenDRIVE>')
    return path


def write_map(folder: Path, geometry: str = LINE, signals: str = "", objects: str = "", length: float = 100) -> Path:
    """A map of one road of two lanes."""
    path = folder / "road.xodr"
    path.write_text(
        f"""<?xml version="1.0"?><OpenDRIVE><header revMajor="1" revMinor="4" name="" version="1.0"/>
        <road name="" length="{length}" id="1" junction="-1"><link/><planView>{geometry}</planView>{LANES}
        <objects>{objects}</objects><signals>{signals}</signals></road></OpenDRIVE>"""
    )
    return path


def write_one_way_map(folder: Path) -> Path:
    """A map of one road of one lane."""
    path = write_map(folder)
    path.write_text(re.sub(r"<left>.*?</left>", "", path.read_text(), flags=re.DOTALL))
    return path


def sign_at(s: float, t: float = -5.0, limit: int = 60, more: str = 'orientation="+" dynamic="no"') -> str:
    return f'<signal id="7" s="{s}" t="{t}" type="274" value="{limit}" {more}/>'


def light_at(s: float, t: float = -5.0, more: str = 'orientation="+"', id: int = 9) -> str:
    return f'<signal id="{id}" s="{s}" t="{t}" dynamic="yes" type="1000001" {more}/>'


def link(end: str, kind: str, id: int, contact: str = "") -> str:
    """Of a road, at its `predecessor` or `successor`."""
    point = f'contactPoint="{contact}"' if contact else ""
    return f'<{end} elementType="{kind}" elementId="{id}" {point}/>'


def write_junction_map(folder: Path, signals: dict[int, str] | None = None, header: str = "", n_lanes: int = 1) -> Path:
    """Road 1 runs east into junction 10, and on as road 2; road 4 comes from the south and turns right into road 2.
    Roads 3 and 5 connect them. signals: by the road that they stand on; n_lanes: of roads 1 to 3."""
    on = signals or {}
    inside = 'junction="10"'
    arc = (
        f'<geometry s="0" x="110" y="-10" hdg="{math.pi / 2}" length="{5 * math.pi}"><arc curvature="-0.1"/></geometry>'
    )
    numbers = [-1 - k for k in range(n_lanes)]
    one, turn = lanes(lane(-1)), lanes(lane(-1, link=f"-1 {numbers[-1]}"))
    wide, through = lanes("".join(map(lane, numbers))), lanes("".join(lane(k, link=f"{k} {k}") for k in numbers))
    pairs = {3: numbers, 5: [-1]}
    connections = "".join(
        f'<connection id="{k}" incomingRoad="{incoming}" connectingRoad="{connecting}" contactPoint="start">'
        + "".join(f'<laneLink from="{k}" to="{k}"/>' for k in pairs[connecting])
        + "</connection>"
        for k, (incoming, connecting) in enumerate(((1, 3), (4, 5)))
    )
    to_2 = link("successor", "road", 2, "start")
    return write_roads(
        folder,
        road(1, straight(0, 0, 0, 100), wide, link("successor", "junction", 10), on.get(1, "")),
        road(2, straight(120, 0, 0, 200), wide, link("predecessor", "junction", 10), on.get(2, "")),
        road(3, straight(100, 0, 0, 20), through, link("predecessor", "road", 1, "end") + to_2, on.get(3, ""), inside),
        road(4, straight(110, -110, math.pi / 2, 100), one, link("successor", "junction", 10), on.get(4, "")),
        road(5, arc, turn, link("predecessor", "road", 4, "end") + to_2, on.get(5, ""), inside),
        f'<junction id="10" name="">{connections}</junction>',
        header=header,
    )
