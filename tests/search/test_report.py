"""The page, the picture and the settings that a search leaves."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image as Picture

from caldrive.cli import parse
from caldrive.commands.train import Train
from caldrive.search.examples import Source
from caldrive.search.report import change, printed, result_values, write_report
from caldrive.search.run import SearchResult
from tests.search.data import TINY_SEARCH


@pytest.fixture(scope="module")
def page(searched: tuple[Source, SearchResult]) -> Path:
    source, findings = searched
    return write_report(findings, source, TINY_SEARCH)


def test_the_page_has_our_figures_beside_the_papers(page: Path, searched: tuple[Source, SearchResult]) -> None:
    text, angle = page.read_text(), searched[1].tasks[1]
    best = angle.best.block
    row = f"| relative angle | {best.layer} | {best.nodes} | {best.dropout:.2f} | {best.length} | {best.dilation} "
    assert row + "| tconv | 100 | 0.44 | 10 | 1 |" in text
    assert "| 84.96 % | 87.41 % | +2.9 % |" in text
    assert "| 0.00797 | 0.00207 | -74.0 % |" in text
    assert "| task | groups | input | all |" in text
    assert f"compared on {searched[1].frames[1]} frames of 1 whole episodes that were held out" in text


def test_the_picture_has_a_row_for_each_task(page: Path) -> None:
    with Picture.open(page.with_name("parameters.png")) as picture:
        assert picture.width > 1000
        assert 300 < picture.height < 600


def test_train_takes_the_best_blocks_from_a_file(page: Path, searched: tuple[Source, SearchResult]) -> None:
    train = parse(["train", "--config", str(page.with_name("blocks.toml"))])
    for task in searched[1].tasks:
        assert getattr(train.network, task.task) == task.best.block
    assert train.network.red_light == Train().network.red_light  # which the search left out
    assert set(tomllib.loads(page.with_name("blocks.toml").read_text())["network"]) == set(TINY_SEARCH.tasks)


def test_a_task_without_one_kind_of_block_has_a_dash(page: Path, searched: tuple[Source, SearchResult]) -> None:
    source, findings = searched
    angle = findings.tasks[1]
    temporal = tuple(block for block in angle.retrained if block.block.temporal)
    assert temporal
    only = replace(findings, tasks=(replace(angle, retrained=temporal),))
    text = write_report(only, source, TINY_SEARCH).read_text()
    write_report(findings, source, TINY_SEARCH)
    assert f"| relative angle | MAE | - | {temporal[0].mean:.5f} | - |" in text


def test_values_are_printed_as_the_supplement_prints_them() -> None:
    assert printed("red_light", 0.92414) == "92.41 %"
    assert printed("relative_angle", 0.002071) == "0.00207"
    assert change(0.00797, 0.00207) == "-74.0 %"
    assert change(0.0, 1.0) == "-"


def test_the_answer_is_json(searched: tuple[Source, SearchResult], page: Path) -> None:
    values = json.loads(json.dumps(result_values(searched[1], page), allow_nan=False))
    assert values["tasks"]["hazard_stop"]["trials"] == TINY_SEARCH.trials
    assert Path(values["networks"]["groups"]["model"]).is_file()
