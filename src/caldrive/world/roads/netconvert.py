"""SUMO's netconvert: plain networks and OpenDRIVE maps become SUMO networks."""

from __future__ import annotations

import os
import re
import subprocess
import tempfile
from pathlib import Path

# Without these types an OpenDRIVE sidewalk takes cars, which then never move.
_TYPES = """<types>
  <type id="driving" numLanes="1" speed="13.89" disallow="pedestrian"/>
  <type id="sidewalk" numLanes="1" speed="1.4" allow="pedestrian"/>
  {closed}
</types>"""
_CLOSED = (
    "shoulder", "border", "stop", "none", "restricted", "parking", "median", "curb", "biking", "special1", "rail",
    "tram",
)  # fmt: skip
_COMMON = [
    "--no-turnarounds", "--junctions.internal-link-detail=16", "--junctions.corner-detail=8", "--xml-validation=never",
    "--no-warnings", "--precision=3", "--junctions.limit-turn-speed=4", "--check-lane-foes.all=false",
]  # fmt: skip


def netconvert_binary() -> Path:
    """Where netconvert is. Raises RuntimeError when the extra is not installed."""
    try:
        import sumo
    except ImportError:
        raise RuntimeError(
            "found no netconvert, wanted it to read an OpenDRIVE map: type pip install 'caldrive[opendrive]'"
        ) from None
    return Path(sumo.SUMO_HOME) / "bin" / "netconvert"


def run_netconvert(arguments: list[str], target: Path) -> None:
    """Runs netconvert and puts its network at target, whole or not at all.

    Raises RuntimeError where it is not installed, CalledProcessError where it fails.
    """
    binary = netconvert_binary()
    environment = {**os.environ, "SUMO_HOME": str(binary.parent.parent)}
    with tempfile.TemporaryDirectory(dir=target.parent) as folder:
        network = Path(folder) / "net.xml"
        command = [str(binary), *arguments, *_COMMON, f"--output-file={network}"]
        subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
        # The header names the time and the command line: without it the same plan gives the same bytes.
        network.write_text(re.sub(r"<!--.*?-->\s*", "", network.read_text(), flags=re.DOTALL))
        os.replace(network, target)


def convert_opendrive(source: Path, target: Path) -> None:
    """Turns an OpenDRIVE file into a SUMO network. Raises ValueError where the file is not a usable map."""
    with tempfile.TemporaryDirectory() as folder:
        types = Path(folder) / "types.xml"
        closed = "\n  ".join(f'<type id="{name}" numLanes="1" disallow="all"/>' for name in _CLOSED)
        types.write_text(_TYPES.format(closed=closed))
        arguments = [
            f"--opendrive-files={source}", f"--type-files={types}", "--opendrive.internal-shapes",
            "--opendrive.import-all-lanes", "--opendrive.curve-resolution=0.5", "--offset.disable-normalization",
        ]  # fmt: skip
        try:
            run_netconvert(arguments, target)
        except subprocess.CalledProcessError as error:
            reason = next((line for line in error.stderr.splitlines() if "rror" in line), "no reason given")
            raise ValueError(
                f"found that netconvert cannot read {source} ({reason}), wanted an OpenDRIVE map: "
                "give another .xodr file"
            ) from error
