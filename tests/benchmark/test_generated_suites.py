"""Suites of generated towns: as many trials as they should have, in towns that nothing else uses."""

from __future__ import annotations

from collections import Counter, defaultdict

import pytest

from caldrive.benchmark.generated_suites import GENERATED_SUITES
from caldrive.benchmark.suites import SUITES, suite
from caldrive.driving.tasks import TASKS, scaled_traffic
from caldrive.scenarios import HELD_OUT_FROM, generated_town
from caldrive.world.roads.packed_networks import packed_names
from caldrive.world.roads.route import plan_route
from caldrive.world.roads.towns import load_roads


def is_held_out(town: str) -> bool:
    generated = generated_town(town)
    return generated is not None and generated.is_held_out


def test_unseen_drives_each_task_once_in_100_towns_and_in_all_weathers() -> None:
    trials = suite("unseen")
    assert len({trial.key for trial in trials}) == len(trials) == 400
    assert Counter(trial.scenario.task for trial in trials) == dict.fromkeys(TASKS, 100)
    assert len({trial.scenario.town for trial in trials}) == 100
    weathers = defaultdict(set)
    for trial in trials:
        weathers[trial.scenario.task].add(trial.scenario.weather)
    assert set(map(frozenset, weathers.values())) == {frozenset(range(1, 15))}
    assert trials[2].key == "unseen-000-w05-navigation"


def test_unseen_wide_navigates_in_40_towns() -> None:
    trials = suite("unseen-wide")
    assert Counter(trial.scenario.task for trial in trials) == {"navigation": 40, "navigation-dynamic": 40}
    assert {trial.condition for trial in trials} == {"unseen-wide"}


def test_only_the_unseen_suites_drive_in_held_out_towns_and_they_ship_with_the_package() -> None:
    held_out = {name: set(filter(is_held_out, (trial.scenario.town for trial in suite(name)))) for name in SUITES}
    assert {name for name, towns in held_out.items() if towns} == {"unseen", "unseen-wide"}
    assert held_out["unseen"] | held_out["unseen-wide"] == packed_names()
    assert (
        min(town.seed for name in ("unseen", "unseen-wide") for town in GENERATED_SUITES[name].towns) == HELD_OUT_FROM
    )


def test_traffic_is_as_dense_as_in_town01() -> None:
    assert scaled_traffic(load_roads("town01").road_length) == (20, 50)
    for trial in suite("unseen"):
        cars, people = trial.scenario.n_vehicles, trial.scenario.n_pedestrians
        if trial.scenario.task == "navigation-dynamic":
            assert 5 <= cars <= 30
            assert people == pytest.approx(2.5 * cars, abs=2)
        else:
            assert (cars, people) == (0, 0)


@pytest.mark.parametrize("k", [0, 57])
def test_the_kept_routes_lead_through_their_towns(k: int) -> None:
    for trial in suite("unseen")[4 * k : 4 * k + 4]:
        scenario = trial.scenario
        route = plan_route(load_roads(scenario.town), scenario.start, scenario.goal)
        assert scenario.time_limit == pytest.approx(route.time_limit, abs=0.01)


def test_another_seed_gives_other_traffic_on_the_same_routes() -> None:
    first, second = suite("unseen", seed=0)[3].scenario, suite("unseen", seed=1)[3].scenario
    assert (first.start, first.goal) == (second.start, second.goal)
    assert first.seed != second.seed
