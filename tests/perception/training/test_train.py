from __future__ import annotations

import json
import platform
import time
from dataclasses import replace
from importlib.util import find_spec
from multiprocessing import get_context
from pathlib import Path
from signal import SIGKILL
from typing import Any

import pytest
import torch
from torch import Tensor

from caldrive.perception.dataset.frames import Frames
from caldrive.perception.evaluation.evaluate import evaluate
from caldrive.perception.images import normalise, to_float
from caldrive.perception.inference.engines import use_bf16
from caldrive.perception.network.checkpoint import CheckpointError, load_network, read_tensors, write_tensors
from caldrive.perception.network.network import Network
from caldrive.perception.training.config import TRAININGS, TrainingConfig
from caldrive.perception.training.distributed import keep_memory
from caldrive.perception.training.multitask import STAGE, Lessons, Segmentation
from caldrive.perception.training.run import anew, descend, learning_rate
from caldrive.perception.training.train import train
from caldrive.recordings.folder import find_episodes, split
from tests.perception.data import BLOCKS, HEIGHT, SHORT, TINY, WIDTH, record


@pytest.fixture(scope="module", autouse=True)
def _one_thread() -> None:
    torch.set_num_threads(1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("episodes"))


def test_learns_where_the_column_stands(folder: Path, tmp_path: Path) -> None:
    config = replace(SHORT, steps=200, batch=6, learning_rate=2e-3, save_every=1000, augment=False, balance=0.0)
    network, info = load_network(train(config, folder, tmp_path, TINY))
    assert info.metrics["center_distance/mae"] < 0.35  # the column wanders evenly over +-1 m: guessing 0 gives 0.5
    assert info.metrics["hazard_stop/iou"] > 0.6  # never seeing one gives 0.43
    frames = Frames(find_episodes(folder), (HEIGHT, WIDTH))
    assert evaluate(network, frames, "fp32")["center_distance/mae"] < 0.35


def test_a_killed_run_resumes_to_the_same_weights(folder: Path, tmp_path: Path) -> None:
    whole = train(SHORT, folder, tmp_path / "whole", TINY)
    train(SHORT, folder, tmp_path / "killed", TINY, stop=lambda step: step == 3)
    assert read_tensors(tmp_path / "killed" / "state.safetensors")[1]["step"] == 2
    resumed = train(SHORT, folder, tmp_path / "killed", TINY)
    assert resumed.read_bytes() == whole.read_bytes()
    files = [model.parent / "metrics.jsonl" for model in (whole, resumed)]
    rows = [[json.loads(line) for line in file.read_text().splitlines()] for file in files]
    assert [r["loss"] for r in rows[0]] == [r["loss"] for r in rows[1]]
    assert [r["step"] for r in rows[1]] == [1, 2, 3, 4, 5, 6]


def test_a_run_is_not_taken_up_by_another_number_of_processes(folder: Path, tmp_path: Path) -> None:
    train(SHORT, folder, tmp_path, TINY, stop=lambda step: step == 3)
    tensors, header = read_tensors(tmp_path / "state.safetensors")
    write_tensors(tmp_path / "state.safetensors", tensors, header | {"processes": 4})
    with pytest.raises(CheckpointError, match="a run of 4 processes, found 1"):
        train(SHORT, folder, tmp_path, TINY)


@pytest.mark.parametrize("segmentation", [False, True])
def test_frames_in_parts_give_the_gradient_of_all_at_once(segmentation: bool) -> None:
    torch.manual_seed(0)
    network = Network(replace(TINY, batch_norm=False))
    head = Segmentation(network.backbone.channels[STAGE]) if segmentation else None
    images, index, command = torch.randn(7, 3, HEIGHT, WIDTH), torch.arange(7)[:, None], torch.zeros(7, 1).long()
    found = []
    for at_once in (None, 3):
        lessons = Lessons(network, head, at_once).eval()
        lessons.zero_grad()
        sum(output.square().mean() for output in lessons(images, index, command).values()).backward()
        found.append([p.grad.clone() for p in lessons.parameters() if p.grad is not None])
    for whole, parts in zip(*found, strict=True):
        torch.testing.assert_close(whole, parts, rtol=1e-4, atol=1e-6)


def test_the_papers_training_adds_nothing_to_the_papers_lesson(tmp_path: Path) -> None:
    data = record(tmp_path / "data", semantic=True)
    paper = replace(
        TRAININGS["paper"], steps=2, batch=2, window=2, at_once=3, validation_share=0.3, precision="fp32", device="cpu"
    )
    path = train(paper, data, tmp_path / "out", replace(TINY, batch_norm=False))
    state = read_tensors(path.parent / "state.safetensors")[0]
    assert not any("segmentation" in name for name in state)
    assert load_network(path)[1].training["others"] == 0.0


def test_a_run_may_begin_with_a_trained_network(folder: Path, tmp_path: Path) -> None:
    first = train(SHORT, folder, tmp_path / "first", TINY)
    still = replace(SHORT, steps=1, learning_rate=0.0, initial=str(first))
    second = train(still, folder, tmp_path / "second", TINY)
    before, after = (dict(load_network(path)[0].named_parameters()) for path in (first, second))
    assert torch.equal(before["backbone.stages.0.0.weight"], after["backbone.stages.0.0.weight"])
    bias = "blocks.hazard_stop.groups.0.output.bias"  # calibrated once, not twice
    torch.testing.assert_close(before[bias], after[bias])
    first.unlink()  # what a run began with is needed no more once it has a state
    assert train(still, folder, tmp_path / "second", TINY) == second
    with pytest.raises(CheckpointError, match="there is no checkpoint"):
        train(still, folder, tmp_path / "again", TINY)


def test_blocks_that_are_built_otherwise_begin_anew(folder: Path, tmp_path: Path) -> None:
    first = train(SHORT, folder, tmp_path / "first", TINY)
    still = replace(SHORT, steps=1, learning_rate=0.0, initial=str(first))
    longer = replace(TINY, hazard_stop=replace(TINY.hazard_stop, dilation=2))
    second = load_network(train(still, folder, tmp_path / "second", longer))[0]
    before, after = (dict(network.named_parameters()) for network in (load_network(first)[0], second))
    same = {name for name in before if torch.equal(before[name], after[name])}
    assert {"backbone.stages.0.0.weight", "blocks.relative_angle.groups.0.layer.weight"} <= same
    assert "blocks.hazard_stop.groups.0.layer.weight" not in same
    assert second.blocks["hazard_stop"].config == longer.hazard_stop
    assert anew(TINY, longer) == ["hazard_stop"]
    assert anew(TINY, replace(TINY, red_light=replace(TINY.red_light, dropout=0.9))) == []


def test_a_run_does_not_begin_with_a_network_of_another_kind(folder: Path, tmp_path: Path) -> None:
    first = train(replace(SHORT, steps=1), folder, tmp_path / "first", TINY)
    still = replace(SHORT, steps=1, initial=str(first))
    with pytest.raises(CheckpointError, match="another width or image size"):
        train(still, folder, tmp_path / "third", replace(TINY, width=0.5))


def test_what_the_weights_do_not_depend_on_may_change_under_way(folder: Path, tmp_path: Path) -> None:
    whole = train(SHORT, folder, tmp_path / "whole", TINY)
    train(SHORT, folder, tmp_path / "killed", TINY, stop=lambda step: step == 4)
    other = replace(SHORT, save_every=3, evaluate_every=5, cache_gb=0.0)
    found = (load_network(train(other, folder, tmp_path / "killed", TINY)), load_network(whole))
    weights = [network.state_dict() for network, _ in found]
    assert all(torch.equal(weights[0][name], weights[1][name]) for name in weights[1])


def test_a_network_remembers_what_it_began_with_also_when_it_is_taken_up_without(folder: Path, tmp_path: Path) -> None:
    first = train(replace(SHORT, steps=1), folder, tmp_path / "first", TINY)
    begun = replace(SHORT, initial=str(first))
    train(begun, folder, tmp_path / "second", TINY, stop=lambda step: step == 4)
    done = train(SHORT, folder, tmp_path / "second", TINY)
    assert load_network(done)[1].training["initial"] == first.name


def test_a_killed_run_on_semantic_images_resumes_to_the_same_weights(tmp_path: Path) -> None:
    seen = record(tmp_path / "seen", semantic=True)
    whole = train(SHORT, seen, tmp_path / "whole", TINY)
    train(SHORT, seen, tmp_path / "killed", TINY, stop=lambda step: step == 3)
    assert train(SHORT, seen, tmp_path / "killed", TINY).read_bytes() == whole.read_bytes()
    train(SHORT, seen, tmp_path / "other", TINY, stop=lambda step: step == 2)
    with pytest.raises(CheckpointError, match="other lessons"):
        train(SHORT, record(tmp_path / "unseen"), tmp_path / "other", TINY)


def test_a_state_of_other_settings_is_not_taken_up(folder: Path, tmp_path: Path) -> None:
    train(SHORT, folder, tmp_path, TINY, stop=lambda step: step == 2)
    with pytest.raises(CheckpointError, match=r"run with learning_rate 0\.001, wanted 1\.0"):
        train(replace(SHORT, learning_rate=1.0), folder, tmp_path, TINY)


def test_a_state_of_other_episodes_is_not_taken_up(folder: Path, tmp_path: Path) -> None:
    train(SHORT, folder, tmp_path / "out", TINY, stop=lambda step: step == 2)
    record(tmp_path / "more", n_episodes=5)
    with pytest.raises(CheckpointError, match="other episodes"):
        train(SHORT, tmp_path / "more", tmp_path / "out", TINY)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"step": -1}, "is damaged"),
        ({"step": 7}, "is damaged"),
        ({"step": None}, "is damaged"),
        ({"training": 3}, "is damaged"),
        ({"kind": "network"}, "no training's state, but a network"),
    ],
    ids=str,
)
def test_a_damaged_state_is_not_taken_up(change: dict[str, Any], said: str, folder: Path, tmp_path: Path) -> None:
    train(SHORT, folder, tmp_path, TINY, stop=lambda step: step == 2)
    tensors, header = read_tensors(tmp_path / "state.safetensors")
    write_tensors(tmp_path / "state.safetensors", tensors, header | change)
    with pytest.raises(CheckpointError, match=said):
        train(SHORT, folder, tmp_path, TINY)


@pytest.mark.parametrize("part", ["optimizer", "optimizer.3.exp_avg", "lessons"])
def test_a_state_without_one_of_its_parts_is_not_taken_up(part: str, folder: Path, tmp_path: Path) -> None:
    train(SHORT, folder, tmp_path, TINY, stop=lambda step: step == 2)
    tensors, header = read_tensors(tmp_path / "state.safetensors")
    rest = {name: value for name, value in tensors.items() if not name.startswith(part)}
    write_tensors(tmp_path / "state.safetensors", rest, header)
    with pytest.raises(CheckpointError, match=r"without all of the optimizer|other lessons"):
        train(SHORT, folder, tmp_path, TINY)


@pytest.mark.parametrize("config", [SHORT, BLOCKS], ids=["all", "blocks"])
def test_a_network_that_was_removed_comes_again(config: TrainingConfig, folder: Path, tmp_path: Path) -> None:
    model = train(config, folder, tmp_path, TINY)
    whole = model.read_bytes()
    model.unlink()
    assert train(config, folder, tmp_path, TINY).read_bytes() == whole


def test_a_network_that_was_removed_and_whose_blocks_were_killed_comes_again(folder: Path, tmp_path: Path) -> None:
    def kill(label: str, share: float) -> None:
        if label.startswith("blocks, step 2"):
            raise KeyboardInterrupt

    model = train(BLOCKS, folder, tmp_path, TINY)
    whole = model.read_bytes()
    model.unlink()
    with pytest.raises(KeyboardInterrupt):
        train(BLOCKS, folder, tmp_path, TINY, progress=kill)
    assert model.read_bytes() != whole
    assert train(BLOCKS, folder, tmp_path, TINY).read_bytes() == whole


def test_damaged_metrics_are_named(folder: Path, tmp_path: Path) -> None:
    train(SHORT, folder, tmp_path, TINY, stop=lambda step: step == 2)
    for content in ("{", "[]", '{"loss": 1}', '{"step": 1}', '{"step": "a"}'):
        (tmp_path / "metrics.jsonl").write_text(content + "\n")
        with pytest.raises(CheckpointError, match=r"metrics\.jsonl is damaged"):
            train(SHORT, folder, tmp_path, TINY)


def test_validation_metrics_are_written_and_kept_with_the_network(folder: Path, tmp_path: Path) -> None:
    model = train(replace(SHORT, evaluate_every=3), folder, tmp_path, TINY)
    rows = [json.loads(line) for line in (tmp_path / "metrics.jsonl").read_text().splitlines()]
    assert [row["step"] for row in rows if "validation/loss" in row] == [3, 6]
    assert (tmp_path / "curves.png").read_bytes().startswith(b"\x89PNG")
    network, info = load_network(model)
    held = split(find_episodes(folder), SHORT.validation_share, SHORT.seed)[1]
    assert evaluate(network, Frames(held, (HEIGHT, WIDTH)), "fp32") == info.metrics  # what is stored was measured
    assert info.metrics["loss"] == rows[-1]["validation/loss"]
    assert info.data["validation_frames"] == 80


def test_each_frame_passes_the_backbone_once(folder: Path) -> None:
    network, passed = Network(TINY).eval(), []
    frames = Frames(find_episodes(folder), (HEIGHT, WIDTH))
    network.backbone.convolutions()[0].register_forward_hook(lambda module, args, output: passed.append(len(args[0])))
    starts = frames.starts(4)[:8]
    batch = frames.batch(starts, 4, network.span - 1)
    outputs = Lessons(network)(normalise(to_float(batch.images)), batch.index, batch.command)
    assert outputs["hazard_stop"].shape == (32, 2)
    assert passed == [11]  # eight windows of four that begin one frame apart


def test_windows_give_what_single_frames_give(folder: Path) -> None:
    torch.manual_seed(0)
    network = Network(TINY).eval()
    frames = Frames(find_episodes(folder), (HEIGHT, WIDTH))

    def outputs(start: int, window: int) -> dict[str, Tensor]:
        batch = frames.batch(frames.starts(1)[[start]], window, network.span - 1)
        return Lessons(network)(normalise(to_float(batch.images)), batch.index, batch.command)

    with torch.no_grad():
        together, alone = outputs(2, 5), outputs(5, 1)
    for name in together:
        torch.testing.assert_close(together[name][3:4], alone[name], rtol=1e-4, atol=1e-5)


def test_the_rate_warms_up_and_falls() -> None:
    config = TrainingConfig(steps=100, warm_up=10, learning_rate=1.0, final_rate=0.1)
    rates = [learning_rate(step, config) for step in range(100)]
    assert rates[0] == pytest.approx(0.1)
    assert max(rates) == rates[10] == 1.0
    assert rates[99] == pytest.approx(0.1, abs=0.01)
    assert rates[10:] == sorted(rates[10:], reverse=True)


@pytest.mark.parametrize(("rate", "clip"), [(0.0, 5.0), (0.01, 5.0), (0.01, 0.5)])
def test_a_step_is_as_long_as_the_rate_and_its_gradient_no_longer_than_the_clip(rate: float, clip: float) -> None:
    weight = torch.nn.Parameter(torch.zeros(2))
    optimizer = torch.optim.Adam([weight], lr=1.0)
    descend(optimizer, (torch.tensor([3.0, -4.0]) * weight).sum(), rate, clip)
    assert weight.detach().tolist() == pytest.approx([-rate, rate])  # Adam's first step is the gradient's sign
    assert optimizer.state[weight]["exp_avg"].norm() == pytest.approx(0.1 * clip, rel=1e-3)  # of a gradient of 5
    assert weight.grad is None


def test_an_unknown_precision_is_named() -> None:
    with pytest.raises(ValueError, match="auto, fp32 or bf16"):
        use_bf16("int8", "cpu")


def test_tensorboard_finds_the_figures_where_it_is_installed(folder: Path, tmp_path: Path) -> None:
    train(SHORT, folder, tmp_path, TINY)
    assert (tmp_path / "tensorboard").is_dir() == (find_spec("tensorboard") is not None)


@pytest.mark.parametrize(
    ("able", "pays"),
    [
        ({"cpu_name": "Intel Xeon", "avx512_bf16": True, "amx_bf16": False}, False),
        ({"cpu_name": "Intel Xeon", "avx512_bf16": True, "amx_bf16": True}, True),
        ({"cpu_name": "AMD EPYC", "avx512_bf16": True}, True),
        ({"architecture": "aarch64"}, False),
    ],
)
def test_bfloat16_is_used_where_it_is_faster(
    able: dict[str, object], pays: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: able)
    assert use_bf16("auto", "cpu") is pays
    assert use_bf16("bf16", "cpu")
    assert use_bf16("auto", "cuda")


def test_memory_is_kept_where_the_system_can() -> None:
    name, version = platform.libc_ver()
    if name == "glibc" and tuple(map(int, version.split("."))) < (2, 35):
        pytest.skip("glibc's malloc kept blocks of 32 MiB at most before 2.35")
    assert keep_memory() is (name == "glibc")


def _train_slowly(data: Path, out: Path) -> None:
    torch.set_num_threads(1)

    def slow(step: int) -> bool:
        time.sleep(0.2 if step > 2 else 0.0)
        return False

    train(SHORT, data, out, TINY, stop=slow)


def test_a_training_killed_at_any_moment_resumes_to_the_same_weights(folder: Path, tmp_path: Path) -> None:
    whole, killed = train(SHORT, folder, tmp_path / "whole", TINY), tmp_path / "killed"
    process = get_context("spawn").Process(target=_train_slowly, args=(folder, killed))
    process.start()
    while not (killed / "state.safetensors").is_file() and process.is_alive():
        time.sleep(0.02)
    process.kill()
    process.join()
    assert process.exitcode == -SIGKILL
    assert not (killed / "model.safetensors").exists()
    assert train(SHORT, folder, killed, TINY).read_bytes() == whole.read_bytes()
