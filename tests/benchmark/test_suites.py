from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from caldrive.benchmark.suites import COLLISIONS, TRAFFIC_RULES, from_json, suite, to_json
from caldrive.results import InfractionKind
from caldrive.world.roads.route import plan_route
from caldrive.world.roads.towns import load_roads


def test_corl2017_has_25_routes_of_each_task_in_each_weather_of_each_condition() -> None:
    trials = suite("corl2017")
    assert len(trials) == 1200
    assert len({trial.key for trial in trials}) == 1200
    counts = Counter((trial.condition, trial.scenario.task) for trial in trials)
    assert len(counts) == 16
    assert {n for (condition, _), n in counts.items() if "weather" in condition} == {50}
    assert {n for (condition, _), n in counts.items() if "weather" not in condition} == {100}
    weathers = {
        (trial.scenario.town, trial.scenario.weather) for trial in trials if trial.condition == "new town + weather"
    }
    assert weathers == {("town02", 4), ("town02", 14)}


def test_no_episode_is_another_one_under_another_sky() -> None:
    for name, count in (("corl2017", 1200), ("nocrash", 2700)):
        both = [replace(trial.scenario, weather=1, task="") for seed in (0, 1) for trial in suite(name, seed)]
        assert len(set(both)) == 2 * count


def test_nocrash_has_its_own_routes_weathers_and_time_limit() -> None:
    trials = suite("nocrash")
    new = {(trial.scenario.town, trial.scenario.weather) for trial in trials if "weather" in trial.condition}
    assert new == {(town, weather) for town in ("town01", "town02") for weather in (10, 14)}
    known = {(trial.scenario.town, trial.scenario.start, trial.scenario.goal) for trial in suite("corl2017")}
    places = {(trial.scenario.town, trial.scenario.start, trial.scenario.goal) for trial in trials}
    assert Counter(town for town, _, _ in places) == {"town01": 25, "town02": 25}
    assert Counter(place[0] for place in places - known) == {"town01": 5}
    scenario = trials[0].scenario
    route = plan_route(load_roads(scenario.town), scenario.start, scenario.goal)
    assert scenario.time_limit == pytest.approx(route.length / (5 / 3.6) + 20)
    assert {trial.rules for trial in trials} == {"nocrash"}


def test_nocrash_is_driven_three_times_in_other_traffic() -> None:
    trials = suite("nocrash")
    assert [trial.repetition for trial in trials[:900] + trials[-900:]] == [0] * 900 + [2] * 900
    first, second = trials[0], trials[900]
    assert (first.key, second.key) == ("town01-w01-empty-00-s0", "town01-w01-empty-00-s1")
    assert first.scenario == replace(second.scenario, seed=first.scenario.seed)
    assert first.scenario.seed != second.scenario.seed


def test_nocrash_once_is_the_first_of_its_three_seeds() -> None:
    once, whole = suite("nocrash-once"), suite("nocrash")
    assert once == [trial for trial in whole if trial.repetition == 0]
    assert len(once) == 900


def test_nocrash_takes_no_other_time_limit() -> None:
    with pytest.raises(ValueError, match=r"found --time-limit code, wanted none: NoCrash's .* leave it out"):
        suite("nocrash", time_limit="code")


def test_its_first_third_has_seen_every_cell() -> None:
    assert len({(trial.condition, trial.scenario.task) for trial in suite("corl2017")[:400]}) == 16


def test_corl2017_once_has_each_of_its_routes_in_one_weather_and_all_cells_from_the_start() -> None:
    trials, whole = suite("corl2017-once"), suite("corl2017")
    assert {trial.key for trial in trials} <= {trial.key for trial in whole}
    routes = Counter((trial.condition, trial.scenario.task, trial.key[-2:]) for trial in trials)
    assert len(routes) == 400
    assert set(routes.values()) == {1}
    assert len({(trial.condition, trial.scenario.task) for trial in trials[:16]}) == 16
    weathers = Counter(trial.scenario.weather for trial in trials if trial.condition == "new town")
    assert set(weathers) == {1, 3, 6, 8}
    assert set(weathers.values()) <= {24, 28}


def test_only_the_dynamic_task_has_others_on_the_road() -> None:
    traffic = {
        (trial.scenario.town, trial.scenario.task): (trial.scenario.n_vehicles, trial.scenario.n_pedestrians)
        for trial in suite("corl2017")
    }
    assert traffic["town01", "navigation-dynamic"] == (20, 50)
    assert traffic["town02", "navigation-dynamic"] == (15, 50)
    assert {n for (_, task), n in traffic.items() if task != "navigation-dynamic"} == {(0, 0)}


@pytest.mark.parametrize(("name", "fatal"), [("nocrash", COLLISIONS), ("traffic-school", TRAFFIC_RULES)])
def test_nocrash_ends_at_collisions_and_traffic_school_at_every_offence(
    name: str, fatal: tuple[InfractionKind, ...]
) -> None:
    trials = suite(name)
    assert {trial.fatal for trial in trials} == {fatal}
    dense = {(s.town, s.n_vehicles, s.n_pedestrians) for s in (trial.scenario for trial in trials) if s.task == "dense"}
    assert dense == {("town01", 100, 250), ("town02", 70, 150)}


def test_the_authors_time_limit_is_longer() -> None:
    short, long = (suite("quick", time_limit=name)[0].scenario.time_limit for name in ("paper", "code"))
    assert long == pytest.approx(2 * short + 10)


def test_a_suite_of_ones_own_is_read_from_a_file(tmp_path: Path) -> None:
    mine, path = suite("quick", seed=3)[3:7], tmp_path / "mine.json"
    path.write_text(to_json(mine))
    assert suite(str(path)) == mine


def test_files_that_are_no_suites_are_named(tmp_path: Path) -> None:
    path = tmp_path / "suite.json"
    with pytest.raises(ValueError, match=r"no suite .*suite\.json"):
        from_json(path)
    for content in ("", "{}", "[]", '[{"key": "a"}]', to_json(suite("quick")[:1] * 2), '[{"key": 1, "fatal": ["x"]}]'):
        path.write_text(content)
        with pytest.raises(ValueError, match=r"suite\.json"):
            from_json(path)
    with pytest.raises(ValueError, match="type --suite quick"):
        suite("corl")


@pytest.mark.parametrize("key", ["../../precious", "/tmp/a", "", ".", "a/b", "a" * 101])
def test_a_key_that_could_not_name_a_file_is_refused(key: str, tmp_path: Path) -> None:
    rows = json.loads(to_json(suite("quick")[:1]))
    (tmp_path / "own.json").write_text(json.dumps([rows[0] | {"key": key}]))
    with pytest.raises(ValueError, match=r"found key .*wanted letters"):
        suite(str(tmp_path / "own.json"))


@pytest.mark.parametrize(
    "change",
    [
        {"n_vehicles": -5},
        {"n_vehicles": "many"},
        {"weather": 1.5},
        {"time_limit": 0},
        {"start": [1, 2, 3]},
        {"cars": 3},
        {"seed": 2**70},
        {"town": "a\0.xodr"},
    ],
    ids=str,
)
def test_a_scenario_that_cannot_be_is_refused(change: dict[str, Any], tmp_path: Path) -> None:
    rows = json.loads(to_json(suite("quick")[:1]))
    (tmp_path / "own.json").write_text(json.dumps([rows[0] | {"scenario": rows[0]["scenario"] | change}]))
    with pytest.raises(ValueError, match=r"own\.json is no suite"):
        suite(str(tmp_path / "own.json"))


def test_other_towns_stand_for_a_suites() -> None:
    here, there = suite("quick"), suite("quick", towns={"town01": "town02"})
    assert [trial.key for trial in there] == [trial.key for trial in here]
    assert {trial.scenario.town for trial in there} == {"town02"}
    assert here != there
