"""The report: its figures as text, and the page in a real browser."""

from __future__ import annotations

import base64
import gzip
import io
import json
import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import simplejpeg
from rich.console import Console

from caldrive.affordances import BY_NAME
from caldrive.benchmark.artifacts import trace_path
from caldrive.benchmark.report.failure_cards import failures_section
from caldrive.benchmark.report.figures import error_sums
from caldrive.benchmark.report.page import report_page, report_text
from caldrive.benchmark.report.runs import (
    LARGE_ERRORS,
    BenchmarkRun,
    Explanation,
    FailureMoment,
    failures,
    load_run,
    load_runs,
)
from caldrive.benchmark.report.tables import tables
from caldrive.benchmark.suites import TrialResult, suite
from caldrive.commands.tables import benchmark_table
from caldrive.files import json_line
from caldrive.results import EpisodeResult, Infraction, InfractionKind, Outcome, result_values
from caldrive.scenarios import Scenario
from tests.benchmark.traces import after, trace

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
DESCRIPTION: dict[str, Any] = {
    "suite": "quick", "agent": "cal", "model": "abc", "cap": 20.0, "code": "123", "began": "2026-01-02T03:04:05+00:00",
    "machine": "two cores", "seed": 0, "time_limit": "paper", "controller": "default", "model_file": None,
    "suite_content": None, "precision": "int8", "workers": 2,
}  # fmt: skip
COMFORT = {
    "center_distance": 0.05, "jerk": 0.4, "lateral_straight": 0.1, "lateral_turn": 0.2, "turning": 10.0,
    "comfortable": 0.9,
}  # fmt: skip
METRICS: dict[str, Any] = {
    "reds_obeyed": 3, "off_lane": 0.0, "error/hazard_stop": 0.01, "error/red_light": 0.0,
    "error/speed_sign": 0.02, "error/vehicle_distance": 0.5, "error/relative_angle": 0.02,
    "error/center_distance": 0.1, "before/0/relative_angle": 0.3, "before/0/hazard_stop": 0.5,
}  # fmt: skip


def episode(
    scenario: Scenario, outcome: Outcome, infractions: tuple[Infraction, ...], comfort: dict[str, float]
) -> EpisodeResult:
    """An episode of 50 s and 250 m."""
    return EpisodeResult(
        scenario=scenario, outcome=outcome, duration=50.0, distance=250.0, route_done=200.0, route_length=250.0,
        infractions=infractions, comfort=comfort,
    )  # fmt: skip


def run(name: str, folder: Path) -> BenchmarkRun:
    """The quick suite, driven well but for every fifth episode."""
    results = []
    for k, trial in enumerate(suite("quick")):
        kind = InfractionKind.SIDEWALK if k % 2 else InfractionKind.RED_LIGHT
        infractions = (Infraction(kind, time=12.5, x=100.0, y=90.0),) if k % 5 == 4 else ()
        outcome = Outcome.TIMEOUT if k % 10 == 4 else Outcome.SUCCESS
        results.append(TrialResult(trial, episode(trial.scenario, outcome, infractions, COMFORT), METRICS))
    return BenchmarkRun(name, folder, DESCRIPTION | {"agent": name}, tuple(results))


def test_names_with_brackets_stand_in_the_terminals_tables_as_they_are(tmp_path: Path) -> None:
    (result, *_) = run("cal", tmp_path).results
    trial = replace(result.trial, condition="[/wet]", scenario=replace(result.trial.scenario, task="[bold]turn"))
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(benchmark_table([replace(result, trial=trial)], "out/[red]"))
    text = console.export_text()
    assert text.count("[/wet]") == 2
    assert "[bold]turn" in text
    assert "out/[red]" in text


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[BenchmarkRun]:
    both = [run(name, tmp_path_factory.mktemp(name)) for name in ("oracle", "cal")]
    folder, key = both[1].folder, both[1].results[4].trial.key
    still = folder / "stills" / f"{key}-0.jpg"
    still.parent.mkdir()
    still.write_bytes(simplejpeg.encode_jpeg(np.full((20, 40, 3), 90, np.uint8)))
    content = {"trace": trace(true_center_distance=after(200, 1.5), command="left")}
    path = trace_path(folder, key)
    path.parent.mkdir()
    path.write_bytes(gzip.compress(json.dumps(content).encode()))
    jpeg = still.read_bytes()
    moments = tuple(
        FailureMoment(title, "red light: seen 3 %, true yes", jpeg, jpeg) for title in ("1 s before", "red light")
    )
    why = Explanation("red light: its truth rescues it", "red light", ("red light",), ("red light",), moments)
    return [both[0], replace(both[1], explanations={both[1].results[9].trial.key: why})]


def test_missed_goals_say_how_they_began(runs: list[BenchmarkRun]) -> None:
    table = next(table for table in tables(runs) if table.title == "Failure causes")
    town = runs[1].results[4].trial.scenario.town
    assert table.rows == (("cal", town, "left its lane", "(100, 0)", "left", "1"),)
    text = "left its lane at (100, 0), left: relative angle off by 0.00 rad"
    assert text in report_text(runs)
    assert text in report_page(runs)


def test_every_cell_stands_beside_the_papers(runs: list[BenchmarkRun]) -> None:
    success = next(table for table in tables(runs) if table.title == "Success")
    row = dict(zip(success.head, next(r for r in success.rows if r[:2] == ("new town", "navigation")), strict=True))
    assert row["CAL (published)"] == "70"
    assert row["MP (published)"] == "24"
    assert "of 2" in row["cal %"]
    assert len(success.rows) == 16


def test_infractions_stand_beside_table_2(runs: list[BenchmarkRun]) -> None:
    infractions = next(table for table in tables(runs) if table.title == "Infractions")
    row = next(r for r in infractions.rows if r[:3] == ("new weather", "navigation-dynamic", "opposite lane"))
    assert row[3].startswith("> ")
    assert row[-1] == ">60"
    row = next(r for r in infractions.rows if r[:3] == ("new weather", "all", "opposite lane"))
    assert row[-4:] == ("", "", "", "")  # the paper counts in one task only


def test_failures_say_what_was_wrong_before(runs: list[BenchmarkRun]) -> None:
    failed = failures(runs)
    assert len(failed) == 2 * sum(k % 5 == 4 for k in range(len(runs[0].results)))
    assert failed[0].errors_before == ("relative angle 0.30 rad, hazard stop 50 %",)


def test_one_of_a_kind_stands_in_the_singular(runs: list[BenchmarkRun]) -> None:
    text = report_text([replace(runs[0], results=runs[0].results[:5])])
    assert "1 infraction of its own fault in 1 km" in text
    assert "1 episode missed its goal" in text


def test_every_affordance_has_an_error_from_which_it_is_named() -> None:
    assert set(LARGE_ERRORS) == set(BY_NAME)


def test_the_text_holds_all_tables_and_failures(runs: list[BenchmarkRun]) -> None:
    text = report_text(runs)
    for table in tables(runs):
        assert f"## {table.title}" in text
    listed = text.split("## Failures")[1]
    assert listed.count("| cal | town0") == len(failures(runs)) // 2
    assert "caldrive benchmark --suite quick --agent cal --cap 20" in text


def test_the_command_says_all_that_is_not_usual(runs: list[BenchmarkRun]) -> None:
    change = {"seed": 3, "time_limit": "code", "controller": "paper", "cap": None, "model_file": "/a/b.safetensors"}
    assert replace(runs[0], description=runs[0].description | change).command == (
        "caldrive benchmark --suite quick --agent oracle --signs --controller paper --time-limit code --seed 3 "
        "--model /a/b.safetensors --out DIR"
    )


def test_runs_of_one_agent_are_told_apart_by_their_folders(tmp_path: Path) -> None:
    (trial, *_) = suite("quick")
    result = episode(trial.scenario, Outcome.SUCCESS, (), COMFORT)
    folders = [tmp_path / "a" / "cal", tmp_path / "b" / "cal"]
    for folder in folders:
        folder.mkdir(parents=True)
        (folder / "run.json").write_text(json.dumps(DESCRIPTION))
        line = {"key": trial.key, "result": result_values(result), "figures": METRICS}
        (folder / "results.jsonl").write_text(json.dumps(line) + "\n")
    assert [run.name for run in load_runs(folders)] == ["cal (a/cal)", "cal (b/cal)"]
    assert [run.name for run in load_runs(folders[:1])] == ["cal"]
    with pytest.raises(ValueError, match="a folder twice"):
        load_runs([folders[0], folders[0] / ".." / "cal"])


def test_a_folder_without_results_is_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"no run\.json"):
        load_run(tmp_path)


def test_results_without_figures_of_comfort_are_named(tmp_path: Path) -> None:
    (trial, *_) = suite("quick")
    old = episode(trial.scenario, Outcome.SUCCESS, (), {"jerk": 0.4})
    line = {"key": trial.key, "result": result_values(old), "figures": {}}
    (tmp_path / "run.json").write_text(json.dumps(DESCRIPTION))
    (tmp_path / "results.jsonl").write_text(json.dumps(line) + "\n")
    with pytest.raises(ValueError, match="older caldrive"):
        load_run(tmp_path)


def test_two_runs_write_the_same_page(runs: list[BenchmarkRun]) -> None:
    assert report_page(runs) == report_page(runs)


def test_a_blind_frame_is_off_by_nothing_that_counts() -> None:
    seen = trace(predicted_center_distance=[None] * 300 + [0.5] * 300)
    count, wrong = error_sums(seen, "center_distance")
    assert (count.sum(), wrong.sum()) == (300, pytest.approx(150))
    assert list(np.flatnonzero(count)) == [6, 7, 8, 9, 10, 11]  # from 30 s on, in slots of 5 s


def test_what_comes_from_files_is_text_and_no_markup(runs: list[BenchmarkRun]) -> None:
    evil = replace(runs[0], name="<script>alert(1)</script>")
    assert "<script>alert" not in report_page([evil])


@pytest.fixture(scope="module")
def page(runs: list[BenchmarkRun], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine: apt-get install chromium")
    from playwright.sync_api import sync_playwright

    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(report_page(runs))
    with sync_playwright() as browsers:
        browser = browsers.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        opened: Any = browser.new_page()
        opened.asked, opened.complaints = [], []
        opened.on("request", lambda request: opened.asked.append(request.url))
        opened.on("pageerror", lambda error: opened.complaints.append(str(error)))
        opened.on("console", lambda message: opened.complaints.append(message.text))
        opened.goto(path.as_uri())
        yield opened
        browser.close()


def test_who_broke_a_rule_is_shown_before_who_only_took_too_long(runs: list[BenchmarkRun]) -> None:
    slow, breaker = runs[1].results[4], runs[1].results[9]
    slow = replace(slow, episode=replace(slow.episode, infractions=()))
    for result, width in ((slow, 40), (breaker, 41)):
        picture = simplejpeg.encode_jpeg(np.full((20, width, 3), width, np.uint8))
        (runs[1].folder / "stills" / f"{result.trial.key}-0.jpg").write_bytes(picture)
    html = failures_section([replace(runs[1], results=(slow, breaker), explanations={})], 1200)  # one still
    (shown,) = re.findall(r"data:image/jpeg;base64,([^\"]+)", html)
    (runs[1].folder / "stills" / f"{breaker.trial.key}-0.jpg").unlink()
    assert simplejpeg.decode_jpeg(base64.b64decode(shown)).shape == (20, 41, 3)


def test_a_failure_whose_pictures_are_too_large_leaves_its_place_to_the_next(tmp_path: Path) -> None:
    sound = run("cal", tmp_path)
    bad = [replace(one, episode=replace(one.episode, outcome=Outcome.TIMEOUT)) for one in sound.results[:3]]
    pictures = zip(bad, (300, 30_000, 300), strict=True)
    whys = {one.trial.key: Explanation(moments=(FailureMoment("", "", b"x" * size),)) for one, size in pictures}
    html = failures_section([replace(sound, results=tuple(bad), explanations=whys)], 2000)
    assert html.count("<img") == 2
    assert "Pictures of 2," in html


def test_blame_is_counted_and_stands_beside_each_failure(runs: list[BenchmarkRun]) -> None:
    table = next(table for table in tables(runs) if table.title == "Blame")
    assert [row for row in table.rows if row[3] != "0"] == [("cal", "red light", "1 of 1", "1", "1")]
    assert len(table.rows) == len(BY_NAME)  # of the run of which nobody knows, none
    assert "| to blame |" in report_text(runs)
    assert "| red light: its truth rescues it |" in report_text(runs)
    assert "Blame" not in [table.title for table in tables(runs[:1])]
    assert "to blame" not in report_text(runs[:1])


def test_each_failure_is_in_one_row_of_the_table_of_blame(tmp_path: Path) -> None:
    either, both = (
        Explanation("?", "one of several", ("red light", "hazard stop")),
        Explanation("?", "world", ("world",)),
    )
    sound = run("cal", tmp_path)
    keys = [failure.result.trial.key for failure in sound.failures]
    explained = replace(sound, explanations=dict(zip(keys, [either, both, both], strict=False)))
    table = next(table for table in tables([explained]) if table.title == "Blame")
    counts = {row[1]: row[2:] for row in table.rows if row[2] != "0 of 3"}
    assert counts == {"one of several": ("1 of 3", "", ""), "world": ("2 of 3", "", "")}
    assert [row[3] for row in table.rows if row[1] in either.blamed] == ["1", "1"]


@pytest.mark.parametrize("size", [9_000, 30_000])
def test_thirty_failures_with_pictures_stay_below_three_megabytes(size: int, tmp_path: Path) -> None:
    why = Explanation(moments=(FailureMoment("1 s before", "", b"x" * size, b"x" * size),) * 3)
    sound = run("cal", tmp_path)
    bad = [replace(one, episode=replace(one.episode, outcome=Outcome.TIMEOUT)) for one in sound.results[:30]]
    explained = replace(sound, results=tuple(bad), explanations={one.trial.key: why for one in bad})
    html = report_page([explained])
    assert html.count("<article") == 30
    assert html.count("<img") == (6 * 30 if size == 9_000 else 6 * 11)
    assert len(html.encode()) < 3_000_000


def column(page: Any, table: int, head: str) -> list[str]:
    of_page = page.locator("table").nth(table)
    heads = of_page.locator("th").all_inner_texts()
    at = next(i for i, text in enumerate(heads) if text.startswith(head))
    return [row.locator("td").nth(at).inner_text() for row in of_page.locator("tbody tr").all()]


def test_a_folder_of_a_compressed_file_alone_is_reported_with_all_that_is_wrong_with_it(tmp_path: Path) -> None:
    whole, short = run("cal", tmp_path).results, {"distance": 500.0, "duration": 20.0}
    lines: list[dict[str, Any]] = [
        {"key": one.trial.key, "result": result_values(one.episode) | short, "figures": METRICS} for one in whole
    ]
    lines[0]["result"] |= {"outcome": "success", "distance": 0.0}
    lines[1]["result"] |= {"comfort": {"jerk": 0.4}}
    lines[2]["key"] = "of-another-suite"
    (tmp_path / "run.json").write_text(json.dumps(DESCRIPTION))
    (tmp_path / "results.jsonl.gz").write_bytes(gzip.compress(b"".join(map(json_line, lines)) + b"{\n"))
    loaded = load_run(tmp_path)
    assert len(loaded.results) == len(whole) - 3
    text = report_text([loaded])
    for said in (
        "line 1 of",
        "line 33 of",
        "lines of no trial of quick: 1",
        "unfinished: 30 of 32",
        "lack figures",
        "see Problems",
    ):
        assert said in text


def test_cal_is_compared_with_each_of_the_others_wherever_it_stands(runs: list[BenchmarkRun], tmp_path: Path) -> None:
    oracle, cal, own = replace(runs[0], name="oracle"), replace(runs[0], name="cal"), replace(runs[0], name="own")
    table = next(table for table in tables([oracle, cal, own]) if table.title == "Paired comparison")
    assert table.head[4:6] == ("cal alone", "other alone")
    assert {row[2] for row in table.rows} == {"oracle", "own"}
    whole = next(row for row in table.rows if row[:3] == ("all", "all", "oracle"))
    assert sum(map(int, whole[3:7])) == len(cal.results)
    assert whole[4:6] == ("0", "0")
    first_of_two = next(table for table in tables([oracle, own]) if table.title == "Paired comparison")
    assert first_of_two.head[4] == "oracle alone"


def test_a_name_from_a_file_stays_in_its_cell_of_a_table(runs: list[BenchmarkRun]) -> None:
    text = report_text([replace(runs[0], name="own | agent\nof mine")])
    assert "| own \\| agent of mine |" in text


def test_problems_of_a_run_stand_in_the_report_and_in_its_headline(tmp_path: Path) -> None:
    sound, broken = run("cal", tmp_path), replace(run("own", tmp_path), problems=("unfinished: 3 of 32",))
    assert "Problems" not in report_text([sound])
    text = report_text([sound, broken])
    assert "| own | unfinished: 3 of 32 |" in text
    first = text.splitlines()[2]
    assert first.startswith("cal: 29 of 32 goals reached in time, 6 infractions of its own fault in 8 km; own:")
    assert first.endswith("(see Problems).")


def test_the_keyboard_reaches_the_heads_of_tables(page: Any) -> None:
    head = page.locator("table").nth(1).locator("th button").nth(2)
    head.focus()
    page.keyboard.press("Enter")
    assert head.locator("..").get_attribute("aria-sort") == "ascending"


def test_the_papers_columns_are_in_view_at_1280_pixels(page: Any) -> None:
    page.set_viewport_size({"width": 1280, "height": 800})
    right = page.locator("table").nth(1).locator("th").last.evaluate("e => e.getBoundingClientRect().right")
    assert right <= 1280


def test_the_page_opens_with_its_tables_plots_and_stills(page: Any) -> None:
    heads = page.locator("h2").all_inner_texts()
    assert {"Runs", "Success", "Infractions", "Driving behaviour", "Speed over distance", "Failures"} <= set(heads)
    assert page.locator("svg").count() >= 5
    pictures = page.locator("article img")
    assert pictures.count() == 1 + 2 * 2  # a still of the benchmark, and two moments with attention
    assert set(pictures.evaluate_all("all => all.map(one => one.naturalWidth)")) == {40}


def test_no_page_is_wider_than_a_telephone(page: Any) -> None:
    page.set_viewport_size({"width": 390, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    page.set_viewport_size({"width": 1280, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth") <= 1280


def test_a_failure_says_whom_to_blame_and_what_was_looked_at(page: Any) -> None:
    page.select_option("select[data-filter=blame]", "red light")
    card = page.locator("article:visible")
    assert card.count() == 1
    assert "To blame red light: its truth rescues it" in card.inner_text().replace("\n", " ")
    assert "1 s before" in card.locator("figcaption").first.inner_text()
    page.select_option("select[data-filter=blame]", "")


def test_nothing_is_fetched_from_outside(page: Any) -> None:
    assert [url for url in page.asked if not url.startswith(("file:", "data:"))] == []
    assert page.complaints == []


def test_a_click_on_a_head_sorts_by_number_and_another_turns_it_round(page: Any) -> None:
    head = page.locator("table").nth(1).locator("th button", has_text=re.compile(r"^CAL \(published\)"))
    head.click()
    up = [int(text) for text in column(page, 1, "CAL")]
    assert up == sorted(up)
    head.click()
    assert [int(text) for text in column(page, 1, "CAL")] == sorted(up, reverse=True)


def test_failures_are_filtered_by_agent_and_kind(page: Any, runs: list[BenchmarkRun]) -> None:
    page.select_option("select[data-filter=run]", "cal")
    page.select_option("select[data-filter=kind]", "sidewalk")
    shown = page.locator("article:visible")
    expected = [
        failure
        for failure in failures(runs[1:])
        if any(i.kind is InfractionKind.SIDEWALK for i in failure.result.episode.infractions)
    ]
    assert shown.count() == len(expected) > 0
    assert page.locator("#shown").inner_text() == str(len(expected))
    page.select_option("select[data-filter=run]", "")
    assert shown.count() == 2 * len(expected)
