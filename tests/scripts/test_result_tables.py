"""The tables of the README and of docs/results.md say what the kept lines say."""

from __future__ import annotations

import gzip
import re
import shutil
from pathlib import Path

import pytest

from caldrive.benchmark.report.runs import load_run
from caldrive.results import InfractionKind
from scripts.result_tables import RESULTS, TABLES, markdown, seeds, unseen

FOLDER = RESULTS / "unseen"


def test_touches_stand_in_the_order_that_the_head_names() -> None:
    head, *rows = unseen(FOLDER)
    column = head.index("touched: people, cars, objects")
    for row in rows:
        touched = [touch.kind for one in load_run(FOLDER / row[0]).results for touch in one.episode.touches]
        kinds = InfractionKind.COLLISION_PERSON, InfractionKind.COLLISION_CAR, InfractionKind.COLLISION_OBJECT
        assert row[column] == ", ".join(str(touched.count(kind)) for kind in kinds)


@pytest.mark.parametrize("name", TABLES)
def test_every_row_of_a_table_is_as_long_as_its_head(name: str) -> None:
    suite, table = TABLES[name]
    if not (RESULTS / suite).exists():
        pytest.skip(f"no kept results of {suite}")
    assert len({row.count("|") for row in markdown(table(RESULTS / suite)).splitlines()}) == 1


def test_a_run_that_lacks_a_task_leaves_its_cell_empty(tmp_path: Path) -> None:
    for name in ("oracle", "part"):
        folder = tmp_path / name
        folder.mkdir()
        for file in (FOLDER / "oracle").iterdir():
            (folder / file.name).write_bytes(file.read_bytes())
    part = tmp_path / "part"
    lines = load_run(part).folder / "results.jsonl"
    kept = gzip.decompress((part / "results.jsonl.gz").read_bytes()).splitlines(keepends=True)
    lines.write_bytes(b"".join(line for line in kept if b'"straight"' in line))
    head, whole, half = unseen(tmp_path)
    assert len(head) == len(whole) == len(half)
    assert half[2] == ""


def test_seeds_stand_together_with_mean_range_and_the_one_in_the_middle(tmp_path: Path) -> None:
    for name, kept in (("cil-0", "oracle"), ("cil-1", "cal"), ("cil-2", "oracle"), ("cal", "cal")):
        shutil.copytree(RESULTS / "corl2017" / kept, tmp_path / name)
    head, *rows = seeds(tmp_path)
    assert head[2] == "training"
    assert [row[:2] for row in rows] == [("cil", "3")]
    mean, low, high = map(int, re.findall(r"\d+", rows[0][head.index("new town")]))
    assert low <= mean <= high
    assert rows[0][-1] in ("cil-0", "cil-1", "cil-2")
