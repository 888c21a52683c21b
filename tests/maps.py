"""Small OpenDRIVE maps."""

from __future__ import annotations

import re
from pathlib import Path

LINE = '<geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry>'
LANES = """<lanes><laneSection s="0">
  <left><lane id="1" type="driving" level="false"><link/><width sOffset="0" a="4" b="0" c="0" d="0"/></lane></left>
  <center><lane id="0" type="none" level="false"/></center>
  <right><lane id="-1" type="driving" level="false"><link/><width sOffset="0" a="4" b="0" c="0" d="0"/></lane></right>
</laneSection></lanes>"""


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
