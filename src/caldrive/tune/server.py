"""Serves the page on which a controller is tuned, to this machine only; NiceGUI brings all that the browser needs."""

from __future__ import annotations

import socket
from contextlib import suppress
from pathlib import Path
from typing import Any

from caldrive.checks import require_within
from caldrive.control.controller import ControlConfig

HOST = "127.0.0.1"
PORTS = (1024, 65535, 8080)  # least, most, usual


def require_nicegui() -> Any:
    """NiceGUI itself. Raises RuntimeError where it is not installed."""
    try:
        import nicegui
    except ImportError as error:
        raise RuntimeError("found no NiceGUI, wanted it for the page: type pip install 'caldrive[tune]'") from error
    return nicegui


def require_free_port(port: int) -> None:
    """Raises ValueError where a port cannot be, or somebody has it."""
    require_within("--port", port, *PORTS)
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError as error:
            raise ValueError(
                f"found port {port} taken, wanted a free one: type --port {port + 1 if port < PORTS[1] else PORTS[2]}"
            ) from error


def serve(controller: ControlConfig, path: Path, port: int) -> None:
    """Serves the page until Ctrl-C. path: the controller's file that it saves. Raises ValueError for a port that is
    taken, RuntimeError without NiceGUI."""
    from caldrive.tune.page import TuningPage

    nicegui = require_nicegui()
    require_free_port(port)
    nicegui.run.process_pool_start_method = "spawn"
    with suppress(KeyboardInterrupt):  # the usual end
        nicegui.ui.run(
            lambda: TuningPage(controller, path).build(), host=HOST, port=port, title="caldrive tune", reload=False,
            show=False, show_welcome_message=False,
        )  # fmt: skip
