"""netconvert runs within limits, says why it failed, and leaves no file."""

from __future__ import annotations

from pathlib import Path

import pytest

from caldrive.world.roads import netconvert
from caldrive.world.roads.netconvert import convert_opendrive, run_netconvert

needs_netconvert = pytest.mark.skipif(
    not pytest.importorskip("importlib.util").find_spec("sumo"), reason="netconvert comes with the extra opendrive"
)
OUTPUT = 'for word; do case "$word" in --output-file=*) output="${word#*=}";; esac; done\n'


@pytest.fixture
def program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A shell script in netconvert's place."""
    path = tmp_path / "bin" / "netconvert"
    path.parent.mkdir()
    monkeypatch.setattr(netconvert, "netconvert_binary", lambda: path)
    return path


def says(program: Path, script: str) -> None:
    program.write_text(f"#!/bin/sh\n{OUTPUT}{script}\n")
    program.chmod(0o755)


def test_its_network_comes_back_without_the_header(program: Path) -> None:
    says(program, 'echo Success.; echo "<!-- made today --><net/>" > "$output"')
    assert run_netconvert({}) == b"<net/>\n"


def test_it_reads_what_it_is_given(program: Path) -> None:
    says(program, 'cat "${1#*=}" > "$output"')
    assert run_netconvert({"node-files": b"<nodes/>"}) == b"<nodes/>"


def test_one_that_takes_too_long_is_ended(program: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(netconvert, "MOST_SECONDS", 0.1)
    says(program, "exec sleep 600")
    with pytest.raises(ValueError, match=r"netconvert works on it for more than 0\.1 s"):
        run_netconvert({})


def test_it_has_limits_of_its_own(program: Path) -> None:
    says(program, 'until [ "$(ulimit -f)" != unlimited ]; do :; done; { ulimit -t; ulimit -v; } > "$output"')
    seconds, kilobytes = map(int, run_netconvert({}).split())
    assert (seconds, kilobytes) == (60, 4 << 20)


def test_one_that_works_too_hard_is_named(program: Path) -> None:
    says(program, "kill -XCPU $$")
    with pytest.raises(ValueError, match="netconvert works on it for more than 60 s"):
        run_netconvert({})


def test_its_own_error_is_passed_on(program: Path) -> None:
    says(program, 'echo "Warning: odd"; echo "Error: no roads" >&2; exit 1')
    with pytest.raises(ValueError, match=r"netconvert says: Error: no roads$"):
        run_netconvert({})


def test_one_that_crashes_is_named(program: Path) -> None:
    says(program, "kill -SEGV $$")
    with pytest.raises(ValueError, match="netconvert was ended by SIGSEGV"):
        run_netconvert({})


@needs_netconvert
def test_a_map_without_roads_gives_no_network() -> None:
    with pytest.raises(ValueError, match="netconvert says: Error"):
        convert_opendrive(b"<OpenDRIVE/>")
