"""The fuzzer's parts: inputs that follow from a seed, oracles that know good from bad, outputs that are looked at."""

from __future__ import annotations

import gzip
import io
import json
import random
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from safetensors.numpy import save

from scripts.attack import oracles, words
from scripts.attack.attempt import Attempt, keep, kept
from scripts.attack.attempts import Attempts
from scripts.attack.formats import BY_ENDING, of_file
from scripts.attack.good import TEXTS, written_by_hand
from scripts.attack.mutations import of_bytes, of_json, of_text
from scripts.attack.outputs import impossible, leftovers, snapshot, torn
from scripts.attack.words import Option

SEEDS = st.integers(0, 2**32)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inside: st.lists(inside, max_size=4) | st.dictionaries(st.text(), inside, max_size=4),
    max_leaves=10,
)


def table(**columns: list[object]) -> bytes:
    buffer = io.BytesIO()
    pq.write_table(pa.table(columns), buffer)
    return buffer.getvalue()


def picture() -> bytes:
    return written_by_hand()["pictures/0.png"]


GOOD = {
    "a.json": b'{"a": [1, 2.5, {"b": null}]}',
    "a.jsonl": b'{"a": 1}\n{"a": 2}\n',
    "a.json.gz": gzip.compress(b'{"a": [1, 2]}'),
    "drive.toml": TEXTS["drive.toml"].encode(),
    "map.xodr": TEXTS["map.xodr"].encode(),
    "a.parquet": table(frame=[0, 1], speed=[1.0, 2.0], command=["left", "right"], image=[b"a", b"b"]),
    "a.safetensors": save({"a": np.ones(3000, np.float32)}, {"caldrive": '{"version": 2}'}),
    "a.png": picture(),
}


@settings(max_examples=30, deadline=None)
@given(JSON, SEEDS)
def test_any_json_is_changed_and_always_in_the_same_way(values: object, seed: int) -> None:
    content = json.dumps(values).encode()
    assert of_json(content, random.Random(seed)) == of_json(content, random.Random(seed))


@settings(max_examples=30, deadline=None)
@given(st.binary(max_size=200), SEEDS)
def test_any_bytes_are_changed_whatever_they_are(content: bytes, seed: int) -> None:
    for change in (of_bytes, of_text, of_json):
        assert isinstance(change(content, random.Random(seed)), bytes)


@pytest.mark.parametrize("name", GOOD)
def test_every_format_is_changed_without_end(name: str) -> None:
    assert {name.rpartition(".")[2] for name in GOOD} | {"jpg"} == BY_ENDING.keys()
    changed = {of_file(name, GOOD[name], random.Random(seed)) for seed in range(20)}
    assert len(changed - {GOOD[name]}) > 10


@pytest.mark.parametrize("name", GOOD)
def test_the_oracles_find_nothing_wrong_with_what_is_good(name: str) -> None:
    assert oracles.why_bad(name, GOOD[name]) == ""


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.json", b'{"a": NaN}'),
        ("a.json", b"{"),
        ("suite.json", b"[]"),
        ("suite.json", written_by_hand()["suite.json"].replace(b'"weather": 1', b'"weather": 15')),
        ("suite.json", written_by_hand()["suite.json"].replace(b'"crossing": 1.0', b'"crossing": -1.0')),
        ("drive.toml", b"cars = -1"),
        ("controller.toml", b"cap = nan"),
        ("drive.toml", b"cars"),
        ("a.xodr", b"<OpenDRIVE><road length='nan'/></OpenDRIVE>"),
        ("a.xodr", b"<OpenDRIVE>"),
        ("a.safetensors", GOOD["a.safetensors"][:-1]),
        ("a.parquet", GOOD["a.parquet"][:-9]),
        ("a.parquet", table(speed=[1.0, float("nan")])),
        ("a.parquet", table(frame=[-1])),
        ("a.png", picture()[:-30]),
    ],
)
def test_the_oracles_know_what_is_bad(name: str, content: bytes) -> None:
    assert oracles.why_bad(name, content)


@pytest.mark.parametrize(
    ("option", "word", "bad"),
    [
        (Option("--cars", "INT"), "3", False),
        (Option("--cars", "INT"), "-3", True),
        (Option("--cars", "INT"), "1.5", True),
        (Option("--cap", "FLOAT"), "1e308", False),
        (Option("--cap", "FLOAT"), "nan", True),
        (Option("--command", "{left,right}"), "left", False),
        (Option("--command", "{left,right}"), "back", True),
        (Option("--agent", "STR"), "💥", True),
        (Option("--out", "PATH"), "💥", False),
    ],
)
def test_what_no_option_can_be_is_known_from_its_kind(option: Option, word: str, bad: bool) -> None:
    assert bool(words.why_bad(option, word)) == bad


def test_the_options_of_a_verb_are_those_of_its_help() -> None:
    found = {option.name: option.kind for option in words.options("collect")}
    assert found["--width"] == found["--weathers"] == "INT"
    assert (found["--duration"], found["--out"], found["--town"]) == ("FLOAT", "PATH", "STR")
    assert "--semantic" not in found
    assert Option("--command", "{left,straight,right}") in words.options("see pictures")


def test_a_verb_with_one_option_gets_no_two() -> None:
    good = written_by_hand()
    drawn = [words.random_words(random.Random(k), good) for k in range(300)]
    assert {attempt.arguments[0] for attempt in drawn} == {use.arguments[0] for use in words.BASES}


def test_a_number_and_a_seed_give_the_same_attempt() -> None:
    kinds, good = ("suite", "map", "own code"), written_by_hand()
    one, again, other = (Attempts(seed, good, kinds) for seed in (1, 1, 2))
    numbers = range(1000, 1009)
    assert [one[k] for k in numbers] == [again[k] for k in numbers] != [other[k] for k in numbers]
    assert {one[k].kind for k in numbers} == set(kinds)


def test_an_attempt_is_kept_with_all_that_it_needs(tmp_path: Path) -> None:
    attempt = Attempt("suite", ("benchmark", "--suite", "a/b.json"), {"a/b.json": b"\xff"}, "no JSON")
    keep(attempt, tmp_path, {"outcome": "HANG"})
    assert kept(tmp_path) == attempt


def test_only_new_files_are_looked_at_and_torn_ones_are_found(tmp_path: Path) -> None:
    work = tmp_path / "work"
    work.mkdir()
    (work / "given.json").write_text("{")
    before = snapshot(work)
    assert not list(torn(work, before))
    for name, content in {**GOOD, "b.png": picture()[:-30], "b.json": b"{", "b.jsonl": b"{}\n{"}.items():
        (work / name).write_bytes(content)
    assert [why.partition(":")[0] for why in torn(work, before)] == ["b.json", "b.jsonl", "b.png"]
    assert not leftovers(tmp_path)
    (work / ".a.json.7.tmp").touch()
    assert leftovers(tmp_path) == ["work/.a.json.7.tmp"]


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.json", b'{"trace": {"steer": [0.0, 1.5]}}'),
        ("a.parquet", table(x=[float("nan")])),
        ("a.csv", b"red_light\n1.7\n"),
        ("a.md", b"| speed | nan |"),
        ("a.safetensors", save({"a": np.full(3, np.nan, np.float32)})),
    ],
)
def test_numbers_that_cannot_be_are_found(name: str, content: bytes, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    assert list(impossible(tmp_path, {}))


def test_a_picture_that_was_changed_is_still_one_now_and_then() -> None:
    sizes = set()
    for seed in range(30):
        content = of_file("a.png", GOOD["a.png"], random.Random(seed))
        if not oracles.why_bad("a.png", content):
            with Image.open(io.BytesIO(content)) as image:
                sizes.add(image.size)
    assert len(sizes) > 3
