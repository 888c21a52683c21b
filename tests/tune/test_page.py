"""The page: in a browser, a moved slider changes the curve; a taken port and a missing library end in a sentence."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from caldrive.control.presets import DEFAULT, controller_config
from caldrive.datatypes import DT
from caldrive.tune.charts import CHARTS, chart_options, figures, oscillation_options
from caldrive.tune.maneuvers import MANEUVERS, drive
from caldrive.tune.server import HOST, require_nicegui
from caldrive.tune.ziegler_nichols import find_ultimate, speed_response
from tests.command_line import refusal

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
PATIENCE = 600.0  # s, on a machine that is busy


def test_a_taken_port_ends_in_a_sentence(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind((HOST, 0))
        taken.listen()
        port = taken.getsockname()[1]
        said = refusal(capsys, "tune", "--port", str(port), "--out", str(tmp_path / "out"))
    assert f"found port {port} taken, wanted a free one: type --port" in said
    assert not (tmp_path / "out").exists()


def test_without_nicegui_a_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "nicegui", None)
    with pytest.raises(RuntimeError, match=r"found no NiceGUI, wanted it for the page: type pip install 'caldrive\[tu"):
        require_nicegui()


def test_every_chart_has_the_lines_of_both_settings() -> None:
    seen = drive(MANEUVERS["right"], DEFAULT)
    for chart in CHARTS:
        series = chart_options(chart, {"A": seen, "B": seen})["series"]
        assert [line["lineStyle"].get("type") for line in series] == ["dashed"] * len(chart.lines) + [None] * len(
            chart.lines
        )
        assert len(series[0]["data"]) == len(seen.signals.time)
    assert figures(seen)["broken rules"] == "none"


def test_the_assistants_chart_shows_decay_oscillation_and_growth() -> None:
    found = find_ultimate(speed_response, DT)
    swings = [
        [value for _, value in line["data"]][len(line["data"]) // 2 :]
        for line in oscillation_options(found, DT)["series"]
    ]
    half, edge, above = (max(values) - min(values) for values in swings)
    assert half < edge < above


@pytest.fixture
def address(tmp_path: Path) -> Iterator[str]:
    """The page, served by the command."""
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        port = probe.getsockname()[1]
    environment = {name: value for name, value in os.environ.items() if "PYTEST" not in name}
    process = subprocess.Popen(
        [sys.executable, "-m", "caldrive", "tune", "--port", str(port), "--out", str(tmp_path)], env=environment
    )
    try:
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end and process.poll() is None:
            with socket.socket() as probe:
                if probe.connect_ex((HOST, port)) == 0:
                    break
            time.sleep(0.1)
        yield f"http://{HOST}:{port}"
        process.send_signal(signal.SIGINT)  # Ctrl-C is its usual end
        assert process.wait(PATIENCE) == 0
    finally:
        process.kill()
        process.wait()


@pytest.fixture
def page(address: str) -> Iterator[Any]:
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine: apt-get install chromium")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as browsers:
        browser = browsers.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        opened: Any = browser.new_page()
        opened.set_default_timeout(1000 * PATIENCE)
        opened.asked, opened.complaints = [], []
        opened.on("request", lambda request: opened.asked.append(request.url))
        opened.on("pageerror", lambda error: opened.complaints.append(str(error)))
        opened.goto(address)
        yield opened
        browser.close()


# The speed's curves in the first chart; the line in its legend is short.
CURVES = """Array.from(document.querySelector('.nicegui-echart svg').querySelectorAll("path[stroke='#1f5fa8']"))
    .map(path => path.getAttribute('d')).filter(curve => curve.length > 500)"""


def test_a_moved_slider_changes_the_curve_and_is_saved(page: Any, address: str, tmp_path: Path) -> None:
    page.locator(".nicegui-echart svg").first.wait_for()
    page.wait_for_function(f"{CURVES}.length == 1")
    page.get_by_text("Keep as A").click()
    page.wait_for_function(f"{CURVES}.length == 2")
    kept, present = page.evaluate(CURVES)
    assert kept == present
    page.locator("[aria-label='longitudinal.cruise.kp']").click(position={"x": 12, "y": 5})  # near its left end
    page.wait_for_function(f"new Set({CURVES}).size == 2")
    page.get_by_text("Save", exact=True).click()
    page.get_by_text("saved: caldrive drive --controller").wait_for()
    assert controller_config(str(tmp_path / "controller.toml"), None).longitudinal.cruise.kp < 0.02
    assert page.complaints == []
    assert {url.partition("://")[2].partition("/")[0] for url in page.asked} == {address.partition("://")[2]}
