"""CARLA's client library."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec

import pytest

from caldrive.carla_bridge.client.library import carla_module


def test_without_the_wheel_one_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "carla", None)
    with pytest.raises(RuntimeError, match=r"^found no CARLA client, wanted .*pip install 'caldrive\[carla\]'"):
        carla_module()


@pytest.mark.skipif(find_spec("carla") is None, reason="needs the wheel of CARLA's client")
def test_it_is_there_where_the_environment_names_no_home() -> None:
    """Without one the library ends the process with a segmentation fault."""
    program = "from caldrive.carla_bridge.client.library import carla_module; carla_module()"
    environment = {name: value for name, value in os.environ.items() if name != "HOME"}
    assert subprocess.run([sys.executable, "-c", program], env=environment, check=False).returncode == 0
