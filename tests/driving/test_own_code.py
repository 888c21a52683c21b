from __future__ import annotations

from typing import Any

import pytest

from caldrive.agents.cal import CALAgent, OraclePerception
from caldrive.control.controller import CALController
from caldrive.control.presets import DEFAULT
from caldrive.datatypes import Control, Observation, Pose, Truth
from caldrive.driving.own_code import OwnCodeError, truth_of
from caldrive.driving.rollout import run_episode
from caldrive.scenarios import Scenario
from tests.command_line import refusal
from tests.fakes import StraightRoad

SCENARIO = Scenario("straight", 1, Pose(0, 0, 0), Pose(100, 0, 0), time_limit=5)


class Idle:
    def reset(self) -> None: ...

    def act(self, observation: Observation) -> Control:
        return Control()


def fails(*_: object) -> Any:
    raise KeyError("nothing of the kind")


@pytest.mark.parametrize(
    ("method", "does", "message"),
    [
        ("reset", lambda _: None, "found that StraightRoad returned None at its reset, wanted an Observation"),
        ("step", lambda _: None, "found that StraightRoad returned None at step 1, wanted an Observation"),
        ("truth", lambda: None, "found that the truth of StraightRoad is None, wanted a Truth"),
        ("reset", fails, "found that StraightRoad failed at its reset (KeyError: 'nothing of the kind'"),
        ("step", fails, "found that StraightRoad failed at step 1 (KeyError"),
        ("truth", fails, "found that StraightRoad failed in its truth (KeyError"),
        ("step", lambda _: Observation("now", None, 0.0, 3), "has time 'now' at step 1, wanted a number"),  # type: ignore[arg-type]
        ("truth", lambda: Truth(0.0, None, None), "has ego None, wanted a VehicleState"),  # type: ignore[arg-type]
    ],
)
@pytest.mark.parametrize("knows", [False, True], ids=["idle", "oracle"])
def test_a_world_that_fails_or_returns_something_else_is_named(
    method: str, does: Any, message: str, knows: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = StraightRoad()
    monkeypatch.setattr(world, method, does)
    oracle = CALAgent(OraclePerception(lambda: truth_of(world)), CALController(DEFAULT, world.dt))
    with pytest.raises(OwnCodeError) as error:
        run_episode(world, oracle if knows else Idle(), SCENARIO)
    assert message in str(error.value)


def test_an_error_of_our_own_world_stays_what_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(StraightRoad, "__module__", "caldrive.world")
    monkeypatch.setattr(StraightRoad, "reset", fails)
    with pytest.raises(KeyError):
        run_episode(StraightRoad(), Idle(), SCENARIO)


@pytest.mark.parametrize("dt", [0, -1, "0.1", float("nan"), 1e308, None], ids=str)
def test_a_world_whose_step_has_no_length_is_refused(
    dt: object, tmp_path: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    value = repr(dt) if isinstance(dt, str) else f"float('{dt}')" if dt is not None else None
    methods = "".join(f" def {name}(self, *_): pass\n" for name in ("reset", "step", "truth", "close"))
    (tmp_path / "own.py").write_text(f"class Own:\n dt = {value}\n{methods}")
    way = ("--from", "0,0", "--to", "9,0", "--out", str(tmp_path / "out"))
    assert "Own has" in refusal(capsys, "drive", "--agent", "oracle", "--world", f"{tmp_path}/own.py:Own", *way)
