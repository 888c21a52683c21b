"""A whole search: its network drives, its folder is gone on with, and what does not go together is refused."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import torch

from caldrive.affordances import CONDITIONAL
from caldrive.perception.inference.predictor import NetworkPerception
from caldrive.perception.network.checkpoint import load_network
from caldrive.search import joint, run, studies
from caldrive.search.config import SearchConfig
from caldrive.search.examples import Source
from caldrive.search.run import SearchResult, Workers, search
from tests.parallel import fake_ray
from tests.perception.data import column_image, see
from tests.search.data import TINY_SEARCH

Searched = tuple[Source, SearchResult]


def test_the_network_of_the_best_blocks_drives(searched: Searched) -> None:
    source, findings = searched
    network, info = load_network(findings.networks["groups"].path)
    before, trained = load_network(source.model)
    for task in findings.tasks:
        assert getattr(network.config, task.task) == task.best.block
    backbones = [{n: v for n, v in net.state_dict().items() if n.startswith("backbone.")} for net in (before, network)]
    assert all(torch.equal(value, backbones[1][name]) for name, value in backbones[0].items())
    assert info.data["validation_episodes"] == trained.data["validation_episodes"]
    assert info.ranges == trained.ranges
    eyes = NetworkPerception(findings.networks["groups"].path)
    eyes.predict(see(column_image(0.5)))
    assert -3.2 < eyes.predict(see(column_image(-0.5), 1)).relative_angle < 3.2


def test_each_way_to_tell_the_command_gives_a_network(searched: Searched) -> None:
    source, findings = searched
    assert list(findings.networks) == ["groups", "input", "all"]
    for kind, network in findings.networks.items():
        config = load_network(network.path)[0].config
        sought = [spec.name for spec in CONDITIONAL if spec.name in TINY_SEARCH.tasks]
        assert [getattr(config, name).conditioning for name in sought] == [kind]
        assert config.hazard_stop.conditioning == "groups"
        NetworkPerception(network.path).predict(see(column_image(0.5)))
    [angle] = [task for task in findings.tasks if task.task == "relative_angle"]
    assert [block.block.conditioning for block in angle.conditioned] == list(findings.networks)
    assert all(len(block.values) == TINY_SEARCH.seeds for block in angle.conditioned)
    assert [path.name for path in sorted(source.out.glob("*.safetensors"))] == [
        "conditioning-all.safetensors", "conditioning-input.safetensors", "model.safetensors",
    ]  # fmt: skip


def test_a_finished_search_does_nothing_again(searched: Searched, monkeypatch: pytest.MonkeyPatch) -> None:
    source, findings = searched
    for place, name in ((run, "run_trial"), (run, "retrain"), (joint, "learn")):
        monkeypatch.setattr(place, name, partial(pytest.fail, f"{name} again"))
    assert search(replace(TINY_SEARCH, conditioning=True), source, Workers()) == findings


@pytest.mark.parametrize("label", ["trial 3 of 8", "the best again, 2 of", "the best blocks together, step 2"])
def test_a_search_that_was_killed_goes_on(label: str, searched: Searched, tmp_path: Path) -> None:
    source, findings = searched
    own = replace(source, out=tmp_path)
    (tmp_path / "features").symlink_to(source.out / "features")

    def killed(now: str, share: float) -> None:
        if now.startswith(label):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        search(TINY_SEARCH, own, Workers(), killed)
    again = search(TINY_SEARCH, own, Workers())
    for task, expected in zip(again.tasks, findings.tasks, strict=True):
        assert task.retrained == expected.retrained
        assert [trial.value for trial in task.trials] == [trial.value for trial in expected.trials]
    assert again.networks["groups"].scores == findings.networks["groups"].scores
    networks = [load_network(out / "model.safetensors")[0].state_dict() for out in (tmp_path, source.out)]
    assert all(torch.equal(value, networks[1][name]) for name, value in networks[0].items())


def test_ray_searches_too(source: Source, searched: Searched, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ray = fake_ray.install(monkeypatch, processors=1)
    own = replace(source, out=tmp_path)
    (tmp_path / "features").symlink_to(source.out / "features")
    tiny = replace(TINY_SEARCH, trials=1, tasks=("relative_angle",), seeds=1)
    findings = search(tiny, own, Workers(2, ray="auto"))
    assert ray.address == "auto"
    assert findings.tasks[0].trials[0].value == searched[1].tasks[1].trials[0].value


def test_another_search_is_not_gone_on_with(searched: Searched) -> None:
    source, _ = searched
    with pytest.raises(ValueError, match=r"found in .* a search with steps 5, wanted 12: type the same settings"):
        search(replace(TINY_SEARCH, steps=12), source, Workers())
    settings = source.out / "search.json"
    content = settings.read_bytes()
    assert json.loads(content)["steps"] == 5
    try:
        settings.write_text("{")
        with pytest.raises(ValueError, match=r"search\.json is damaged"):
            search(TINY_SEARCH, source, Workers())
    finally:
        settings.write_bytes(content)


def test_a_loss_that_is_no_number_ends_with_a_sentence(
    source: Source, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("caldrive.search.learning.learn", lambda *_: iter([1.0, float("nan")]))
    (tmp_path / "features").symlink_to(source.out / "features")
    with pytest.raises(ValueError, match="found a loss of nan at step 2, wanted a number"):
        search(TINY_SEARCH, replace(source, out=tmp_path), Workers())


def without_optuna(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "optuna", None)


def without_ray(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)


@pytest.mark.parametrize(
    ("prepare", "workers", "sentence"),
    [
        (without_optuna, Workers(), r"type pip install 'caldrive\[search\]'"),
        (without_ray, Workers(2, ray="local"), r"type pip install 'caldrive\[ray\]'"),
        (lambda _: None, Workers(0), "found --workers 0, wanted 1 to 1024"),
    ],
)
def test_what_is_missing_is_said_before_anything_is_written(
    prepare: Callable[[pytest.MonkeyPatch], Any],
    workers: Workers,
    sentence: str,
    source: Source,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    prepare(monkeypatch)
    with pytest.raises((RuntimeError, ValueError), match=sentence):
        search(SearchConfig(), replace(source, out=tmp_path / "new"), workers)
    assert not (tmp_path / "new").exists()


def test_a_search_leaves_no_examples_in_memory(searched: Searched) -> None:
    assert studies.worker_examples.cache_info().currsize == 0
