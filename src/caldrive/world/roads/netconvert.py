"""SUMO's netconvert: plain networks and OpenDRIVE maps become SUMO networks."""

from __future__ import annotations

import os
import re
import resource
import signal
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack, suppress
from importlib.metadata import version
from pathlib import Path
from typing import BinaryIO

from caldrive.world.roads.memory_files import memory_file, path_of

MOST_SECONDS, MOST_WORK = 300, 60  # s for one map, by the clock and of a processor: Town01 of CARLA takes 0.3
MOST_SAID = 100_000  # bytes of what it says that are looked at
_LIMITS = {  # they hold even where this process is gone, and nobody waits
    resource.RLIMIT_CPU: MOST_WORK, resource.RLIMIT_AS: 4 << 30, resource.RLIMIT_FSIZE: 1 << 30,
    resource.RLIMIT_CORE: 0,
}  # fmt: skip

# `opendrive_repairs` leaves these types of lanes; without them netconvert lets cars drive on sidewalks.
_LANE_TYPES = b"""<types>
  <type id="driving" numLanes="1" speed="13.89" disallow="pedestrian"/>
  <type id="none" numLanes="1" disallow="all"/>
</types>"""
_OPENDRIVE = (
    "--opendrive.internal-shapes", "--opendrive.import-all-lanes", "--opendrive.curve-resolution=0.5",
    "--offset.disable-normalization",
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
            "found no netconvert, wanted it to make roads of a map or of a seed: type pip install 'caldrive[opendrive]'"
        ) from None
    return Path(sumo.SUMO_HOME) / "bin" / "netconvert"


def run_netconvert(inputs: Mapping[str, bytes], options: Sequence[str] = ()) -> bytes:
    """The network that netconvert makes. inputs: what is in the files that it reads, by the option that names each;
    options: more than the common ones, or in their place.

    Raises RuntimeError where it is not installed, ValueError with its reason where it makes none.
    """
    binary = netconvert_binary()
    with ExitStack() as stack:
        files = {option: stack.enter_context(memory_file(content)) for option, content in inputs.items()}
        network, said = stack.enter_context(memory_file()), stack.enter_context(memory_file())
        named = [f"--{option}={path_of(file)}" for option, file in files.items()]
        command = [str(binary), *named, *options, *_but(options), f"--output-file={path_of(network)}"]
        code = _run(command, binary.parent.parent, [file.fileno() for file in (*files.values(), network)], said)
        if code != 0:
            raise ValueError(_reason(code, _content(said, MOST_SAID).decode(errors="replace")))
        # The header names the time and the command line: without it the same plan gives the same bytes.
        return re.sub(rb"<!--.*?-->\s*", b"", _content(network), flags=re.DOTALL)


def _but(options: Sequence[str]) -> list[str]:
    """The common options without those that are given: netconvert takes none twice."""
    given = {option.partition("=")[0] for option in options}
    return [option for option in _COMMON if option.partition("=")[0] not in given]


def _run(command: Sequence[str], home: Path, files: Sequence[int], said: BinaryIO) -> int:
    """Runs a program of SUMO within its limits; returns its exit code. files: those that it may open; said: takes what
    it says. Raises ValueError where it takes too long."""
    environment = {**os.environ, "SUMO_HOME": str(home)}
    with subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=said, stderr=said, pass_fds=files, env=environment
    ) as process:
        try:
            with suppress(ProcessLookupError):  # it is done already
                _limit(process.pid)
            return process.wait(MOST_SECONDS)
        except subprocess.TimeoutExpired:
            raise ValueError(f"netconvert works on it for more than {MOST_SECONDS} s") from None
        finally:
            process.kill()


def _limit(process: int) -> None:
    """Limits a running program by its number, unless somebody limits it more."""
    for kind, most in _LIMITS.items():
        _, hard = resource.prlimit(process, kind)
        least = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.prlimit(process, kind, (least, least))


def _content(file: BinaryIO, most: int = -1) -> bytes:
    """What is in a file, up to so many bytes."""
    file.seek(0)
    return file.read(most)


def _reason(code: int, said: str) -> str:
    """Why netconvert failed, from its exit code (below 0: the signal that ended it) and from what it said."""
    if code in (-signal.SIGXCPU, -signal.SIGKILL):
        return f"netconvert works on it for more than {MOST_WORK} s"
    errors = [line for line in said.splitlines() if "rror" in line]
    if code < 0:
        return f"netconvert was ended by {signal.Signals(-code).name}"
    return f"netconvert says: {errors[0] if errors else 'nothing'}"


def convert_opendrive(content: bytes, junctions: Iterable[str] = ()) -> bytes:
    """An OpenDRIVE map as a SUMO network. junctions: ids of those with lights.

    Raises ValueError with netconvert's reason where the map is no use.
    """
    lights = [f"--tls.set={','.join(sorted(junctions))}"] if junctions else []
    return run_netconvert({"opendrive-files": content, "type-files": _LANE_TYPES}, [*_OPENDRIVE, *lights])


def conversion() -> bytes:
    """All that a network depends on beside the map: the version of SUMO, the options, the types of lanes."""
    return repr((version("eclipse-sumo"), _OPENDRIVE, _COMMON, _LANE_TYPES)).encode()
