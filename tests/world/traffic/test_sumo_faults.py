"""What SUMO refuses ends in one sentence, and leaves no simulation running."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import libsumo
import numpy as np
import pytest

from caldrive.datatypes import VehicleState
from caldrive.scenarios import Scenario
from caldrive.world.embedded import EmbeddedWorld
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.traffic import sumo_process
from caldrive.world.traffic.sumo_process import stop_sumo
from caldrive.world.traffic.traffic_lights import TrafficLights
from caldrive.world.traffic.vehicles import EGO, Traffic
from caldrive.world.truth.label_rig import LabelRig


@pytest.fixture(autouse=True)
def _no_sumo_is_left() -> Iterator[None]:
    yield
    stop_sumo()


def start(roads: RoadNetwork, n: int = 2) -> tuple[Traffic, VehicleState]:
    """A few cars, and the ego among them."""
    ego = VehicleState(roads.driveable[0].line.pose_at(10.0), length=4.2, width=1.8, id="ego")
    lights = TrafficLights(roads, np.random.default_rng(0))
    return Traffic(roads, n=n, seed=0, dt=0.1, ego=ego, lights=lights), ego


def test_a_network_that_is_gone_is_named_and_the_next_traffic_starts(town02: RoadNetwork, tmp_path: Path) -> None:
    gone = replace(town02, network=tmp_path / "gone.net.xml")
    with pytest.raises(RuntimeError, match=r"found that SUMO cannot let cars drive in town02 .*--cars 0"):
        start(gone)
    assert not libsumo.isLoaded()
    traffic, _ = start(town02)
    assert len(traffic.cars) == 2


def test_a_kind_of_car_that_sumo_does_not_know_is_refused(
    town02: RoadNetwork, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "none.add.xml").write_text("<additional/>")
    monkeypatch.setattr(sumo_process, "DRIVERS", tmp_path / "none.add.xml")
    with pytest.raises(RuntimeError, match=r"found that SUMO cannot let cars drive in town02 .*driver"):
        start(town02)
    assert not libsumo.isLoaded()


def test_more_cars_than_fit_start_no_simulation(town02: RoadNetwork) -> None:
    with pytest.raises(ValueError, match="ask for fewer with --cars"):
        start(town02, n=10_000)
    assert not libsumo.isLoaded()


def test_what_fails_on_the_way_is_one_sentence_too(town02: RoadNetwork) -> None:
    traffic, ego = start(town02)
    libsumo.vehicle.remove(EGO)
    with pytest.raises(RuntimeError, match=r"found that SUMO cannot let cars drive in town02 .*ego"):
        traffic.step(0.1, ego, ())


def a_scenario(roads: RoadNetwork) -> Scenario:
    line = max(roads.driveable, key=lambda lane: lane.line.length).line
    return Scenario("town02", weather=1, start=line.pose_at(5.0), goal=line.pose_at(30.0), n_vehicles=2, seed=2)


@pytest.mark.parametrize("broken", [LabelRig, EmbeddedWorld])
def test_a_world_that_fails_to_start_leaves_no_simulation(
    broken: type[LabelRig | EmbeddedWorld], town02: RoadNetwork, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("found no room")

    monkeypatch.setattr(broken, "truth" if broken is LabelRig else "_observe", fail)
    with pytest.raises(RuntimeError, match="found no room"):
        EmbeddedWorld().reset(a_scenario(town02))
    assert not libsumo.isLoaded()
