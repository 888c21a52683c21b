"""The verb `search`, and what its options say."""

from __future__ import annotations

from pathlib import Path

import pytest

from caldrive.cli import main, parse
from caldrive.search.config import SearchConfig
from tests.command_line import refusal, run_json
from tests.search.data import make_source


def test_a_search_answers_with_the_best_blocks_and_its_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = make_source(tmp_path)
    small = ("--trials", "2", "--steps", "2", "--batch", "4", "--tasks", "relative_angle", "--seeds", "1")
    options = ("--data", str(source.data), "--model", str(source.model), "--out", str(source.out), "--workers", "1")
    answer = run_json("search", *options, *small, "--joint-steps", "1")
    assert answer["tasks"]["relative_angle"]["trials"] == 2
    assert Path(answer["networks"]["groups"]["model"]) == source.out / "model.safetensors"
    assert Path(answer["report"]).read_text().startswith("# Search for task blocks")
    assert main(["search", *options, *small, "--joint-steps", "1"]) == 0
    assert f"caldrive drive --model {source.out / 'model.safetensors'}" in capsys.readouterr().out.replace("\n", "")
    sentence = refusal(capsys, "search", *options, "--tasks", "red_light")
    assert "found one value only of the red light" in sentence


def test_every_setting_is_an_option_and_may_come_from_a_file(tmp_path: Path) -> None:
    (tmp_path / "search.toml").write_text('trials = 60\nsampler = "tpe"\ntasks = ["relative_angle"]\n')
    search = parse(["search", "--config", str(tmp_path / "search.toml"), "--trials", "7", "--conditioning"])
    assert search.search == SearchConfig(trials=7, sampler="tpe", tasks=("relative_angle",), conditioning=True)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("--trials", "0"), "found --trials 0, wanted 1 to 100000"),
        (("--tasks", "wings"), "found --tasks wings, wanted one of hazard_stop"),
        (("--sampler", "grid"), "found --sampler grid, wanted one of random, tpe"),
        (("--tasks", "red_light", "--conditioning"), "found --conditioning with --tasks red_light, whose blocks"),
        (("--data", "gone"), "there is no episode"),
        (("--model", "gone.safetensors"), "found no file"),
        (("--workers", "0"), "found --workers 0"),
    ],
)
def test_bad_input_is_one_sentence(
    options: tuple[str, ...],
    sentence: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert sentence in refusal(capsys, "search", *options)
    assert not (tmp_path / "out").exists()
