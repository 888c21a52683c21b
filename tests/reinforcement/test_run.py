"""A run in processes, as it really learns."""

from __future__ import annotations

import os
import signal
from dataclasses import replace
from functools import partial
from typing import Any

import pytest

from caldrive.reinforcement.environment import make_learning_env, policy_config
from caldrive.reinforcement.run import LearningRun, derived_seed
from tests.reinforcement.data import SHORT


def test_each_environment_has_its_process_and_one_that_dies_is_said_in_one_sentence() -> None:
    config = replace(SHORT, processes=True, tasks=("navigation-dynamic",))
    run = LearningRun(config, policy_config(config, None), partial(make_learning_env, config, None))
    row = run.advance()
    assert row["step"] == 32
    assert abs(row["reward_per_step"]) < 10
    several: Any = run.env.venv
    os.kill(several.processes[1].pid, signal.SIGKILL)
    with pytest.raises(RuntimeError, match="the process of an environment has died"):
        run.advance()
    run.close()
    assert not any(process.is_alive() for process in several.processes)


def test_a_process_that_dies_between_two_updates_is_said_and_never_waited_for() -> None:
    config = replace(SHORT, processes=True, environments=2, save_every=1)  # new episodes begin with each update
    run = LearningRun(config, policy_config(config, None), partial(make_learning_env, config, None))
    several: Any = run.env.venv
    several.processes[0].kill()
    several.processes[0].join()
    with pytest.raises(RuntimeError, match="the process of an environment has died"):
        run.advance()
    run.close()
    assert not any(process.is_alive() for process in several.processes)


def test_what_is_drawn_depends_on_seed_update_and_purpose() -> None:
    seeds = {derived_seed(s, k, why) for s in range(3) for k in range(5) for why in ("weights", "actions", "episodes")}
    assert len(seeds) == 45
    assert derived_seed(1, 2, "actions") == derived_seed(1, 2, "actions")
