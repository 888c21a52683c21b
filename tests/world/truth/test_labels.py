"""The true affordances of scenes made by hand, against the table of observation areas in supplement 2.1."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from caldrive.control.controller import CALController
from caldrive.control.presets import DEFAULT
from caldrive.datatypes import (
    Affordances,
    Command,
    Control,
    LightState,
    PedestrianState,
    Points,
    Pose,
    Sign,
    TrafficLight,
    VehicleState,
)
from caldrive.geometry import Polyline, moved, to_world
from caldrive.world.traffic.ego import EgoState, VehicleConfig, advance
from caldrive.world.truth.labels import label, light_area

CAR = VehicleConfig()
BUMPER = CAR.length / 2 - CAR.front_axle  # m from the front axle to the front bumper
IN_LANE = Pose(-CAR.front_axle, 0.0, 0.0)  # the front axle at the origin
STRAIGHT: Points = np.array([(-20.0, 0.0), (200.0, 0.0)])
# Vertices of the table as (near, far, right, left) ahead of the front axle.
A1, A2, A3 = (7.4, 14.0, -5.8, -0.8), (0.0, 8.2, -2.0, 2.0), (0.0, 50.0, -1.6, 1.6)
CM = 0.01


def ego_at(pose: Pose, speed: float = 5.0) -> VehicleState:
    return VehicleState(pose, speed, length=CAR.length, width=CAR.width, id="ego")


@dataclass(frozen=True)
class Scene:
    """Things by their places ahead of and left of the front axle of an ego at `pose`."""

    pose: Pose = IN_LANE
    route: Points = field(default_factory=STRAIGHT.copy)
    vehicles: Sequence[VehicleState] = ()
    pedestrians: Sequence[PedestrianState] = ()
    lights: Sequence[TrafficLight] = ()
    signs: Sequence[Sign] = ()
    speed: float = 5.0

    @property
    def label(self) -> Affordances:
        return label(
            ego_at(self.pose, self.speed),
            CAR.front_axle,
            Polyline(self.route),
            vehicles=self.vehicles,
            pedestrians=self.pedestrians,
            lights=self.lights,
            signs=self.signs,
        )


def car(x: float, y: float, heading: float = 0.0, length: float = 4.5) -> VehicleState:
    return VehicleState(Pose(x, y, heading), speed=0.0, length=length, width=1.8)


def person(x: float, y: float) -> PedestrianState:
    return PedestrianState(Pose(x, y, 0.0))


def light(x: float, y: float, state: LightState = LightState.RED, heading: float = 0.0) -> TrafficLight:
    return TrafficLight("light", Pose(x, y, heading), state, ((x, 2.0), (x, -2.0)))


def sign(x: float, y: float, limit: int = 60, heading: float = 0.0) -> Sign:
    return Sign(Pose(x, y, heading), limit)


def edges(area: tuple[float, float, float, float]) -> list[tuple[float, float, bool]]:
    """Places 1 cm inside and outside each side and each corner of an area: x, y, whether it is inside."""
    near, far, right, left = area
    xs = [(near - CM, False), (near + CM, True), ((near + far) / 2, True), (far - CM, True), (far + CM, False)]
    ys = [(right - CM, False), (right + CM, True), ((right + left) / 2, True), (left - CM, True), (left + CM, False)]
    return [(x, y, a and b) for x, a in xs for y, b in ys]


@pytest.mark.parametrize(("x", "y", "inside"), edges(A1))
def test_lights_and_signs_count_within_a1(x: float, y: float, inside: bool) -> None:
    assert Scene(lights=[light(x, y)]).label.red_light == float(inside)
    assert Scene(signs=[sign(x, y, 90)]).label.speed_sign == (90 if inside else None)


@pytest.mark.parametrize(("x", "y", "inside"), edges(A2))
def test_cars_and_people_are_a_hazard_within_a2(x: float, y: float, inside: bool) -> None:
    assert Scene(vehicles=[car(x, y)]).label.hazard_stop == float(inside)
    assert Scene(pedestrians=[person(x, y)]).label.hazard_stop == float(inside)


@pytest.mark.parametrize(("x", "y", "inside"), edges(A3))
def test_a_car_is_ahead_when_its_centre_is_within_a3(x: float, y: float, inside: bool) -> None:
    assert (Scene(vehicles=[car(x, y)]).label.vehicle_distance < 50.0) is inside


def test_on_an_empty_road_every_label_is_its_default() -> None:
    assert Scene().label == Affordances()
    assert Affordances().vehicle_distance == 50.0


def test_people_are_no_cars_ahead_and_cars_no_lights() -> None:
    true = Scene(pedestrians=[person(20, 0)], vehicles=[car(10, -3)]).label
    assert true == Affordances()


@pytest.mark.parametrize(("state", "red"), [(LightState.RED, 1), (LightState.YELLOW, 1), (LightState.GREEN, 0)])
def test_yellow_counts_as_red_and_green_does_not(state: LightState, red: int) -> None:
    assert Scene(lights=[light(10, -3, state)]).label.red_light == red


@pytest.mark.parametrize(
    ("degrees", "counts"), [(0, True), (40, True), (-40, True), (50, False), (90, False), (180, False)]
)
def test_lights_and_signs_count_only_for_the_traffic_that_they_face(degrees: float, counts: bool) -> None:
    heading = math.radians(degrees)
    assert Scene(lights=[light(10, -3, heading=heading)]).label.red_light == float(counts)
    assert (Scene(signs=[sign(10, -3, heading=heading)]).label.speed_sign == 60) is counts


@pytest.mark.parametrize(("speed", "near"), [(0.0, 5.0), (3.0, 6.35), (5.0, 7.4), (20.0, 7.4)])
def test_for_a_slow_car_lights_count_nearer_and_signs_do_not(speed: float, near: float) -> None:
    assert Scene(lights=[light(near + CM, -3)], speed=speed).label.red_light == 1.0
    assert Scene(lights=[light(near - CM, -3)], speed=speed).label.red_light == 0.0
    assert Scene(signs=[sign(7.4 - CM, -3)], speed=speed).label.speed_sign is None


@given(st.floats(0.0, 4.3), st.floats(0.0, 6.6))
def test_who_brakes_for_a_light_below_15_kmh_stands_with_the_light_in_the_area(speed: float, further: float) -> None:
    state, controller = EgoState(IN_LANE, speed), CALController(DEFAULT)
    at = min(light_area(speed).near + 0.2 * speed + further, 14.0 - CM)  # seen for long enough to react
    for _ in range(30):
        ego = ego_at(state.pose, state.speed)
        true = label(ego, CAR.front_axle, Polyline(STRAIGHT), lights=[light(at, -3)])
        assert true.red_light == 1.0
        late = Control() if state.pose == IN_LANE else controller.step(true, state.speed, Command.STRAIGHT).control
        state = advance(state, late, 0.1, CAR)


def test_a_green_light_does_not_hide_a_red_one() -> None:
    assert Scene(lights=[light(8, -3, LightState.GREEN), light(12, -3)]).label.red_light == 1.0


def test_the_nearest_sign_wins() -> None:
    assert Scene(signs=[sign(12, -2, 30), sign(8, -5, 90), sign(13, -1, 60)]).label.speed_sign == 90
    assert Scene(signs=[sign(12, -2, 30), sign(7, -5, 90)]).label.speed_sign == 30


@pytest.mark.parametrize(("gap", "length"), [(0.5, 4.2), (10.0, 4.9), (40.0, 4.2)])
def test_the_distance_runs_from_bumper_to_bumper(gap: float, length: float) -> None:
    true = Scene(vehicles=[car(BUMPER + gap + length / 2, 0.0, length=length)]).label
    assert true.vehicle_distance == pytest.approx(gap)


def test_the_distance_to_a_slanted_car_runs_to_its_closest_corner() -> None:
    slant = math.radians(30)
    reach = 4.5 / 2 * math.cos(slant) + 1.8 / 2 * math.sin(slant)
    corner = 4.5 / 2 * math.sin(slant) - 1.8 / 2 * math.cos(slant)
    assert abs(corner) < CAR.width / 2, "the corner lies straight before the bumper"
    true = Scene(vehicles=[car(20.0, 0.0, slant)]).label
    assert true.vehicle_distance == pytest.approx(20.0 - reach - BUMPER)


def test_the_closest_car_ahead_counts_and_touching_boxes_are_0_apart() -> None:
    assert Scene(vehicles=[car(30, 0), car(15, 1), car(8, 3)]).label.vehicle_distance == pytest.approx(
        15 - 2.25 - BUMPER
    )
    assert Scene(vehicles=[car(2, 0)]).label.vehicle_distance == 0.0


@pytest.mark.parametrize("left", [0.7, -0.7])
def test_left_of_the_line_the_distance_is_negative_and_right_of_it_positive(left: float) -> None:
    assert Scene(Pose(0, left, 0)).label.center_distance == pytest.approx(-left)


@pytest.mark.parametrize("turn", [0.2, -0.2])
def test_a_car_turned_left_has_a_negative_angle_and_turned_right_a_positive_one(turn: float) -> None:
    assert Scene(Pose(0, 0, turn)).label.relative_angle == pytest.approx(-turn)


def test_position_is_that_of_the_front_axle_not_of_the_centre() -> None:
    true = Scene(Pose(0, 0, 0.3)).label
    assert true.center_distance == pytest.approx(-CAR.front_axle * math.sin(0.3))


@pytest.mark.parametrize(("left", "wanted"), [(3.0, -2.0), (-3.0, 2.0), (1.99, -1.99)])
def test_the_distance_to_the_line_ends_at_2_m(left: float, wanted: float) -> None:
    assert Scene(Pose(0, left, 0)).label.center_distance == pytest.approx(wanted)


@pytest.mark.parametrize("side", [1, -1], ids=["left", "right"])
def test_a_car_that_goes_straight_into_a_bend_must_steer_to_its_inside(side: int) -> None:
    radius = 15.0
    angles = np.linspace(0, math.pi / 2, 400)
    bend = np.stack((radius * np.sin(angles), side * radius * (1 - np.cos(angles))), axis=1)
    true = Scene(Pose(4.0 - CAR.front_axle, 0, 0), bend).label
    assert true.relative_angle == pytest.approx(side * math.atan(4.0 / radius), abs=0.01)
    assert true.center_distance == pytest.approx(side * (math.hypot(4.0, radius) - radius), abs=0.01)


@pytest.mark.parametrize("side", [1, -1], ids=["left", "right"])
def test_a_car_on_a_bend_along_its_tangent_is_on_the_line(side: int) -> None:
    radius, along = 15.0, 0.6
    angles = np.linspace(0, math.pi / 2, 400)
    bend = np.stack((radius * np.sin(angles), side * radius * (1 - np.cos(angles))), axis=1)
    axle = Pose(radius * math.sin(along), side * radius * (1 - math.cos(along)), side * along)
    true = Scene(moved(axle, forward=-CAR.front_axle), bend).label
    assert (true.relative_angle, true.center_distance) == pytest.approx((0.0, 0.0), abs=0.01)


def test_where_the_route_crosses_itself_the_known_progress_decides() -> None:
    loop = np.array([(-20, 0), (40, 0), (40, 40), (0, 40), (0, -40)], dtype=float)
    ego = ego_at(Pose(-CAR.front_axle, 0.3, 0.0))
    assert label(ego, CAR.front_axle, Polyline(loop), near=20.0).center_distance == pytest.approx(-0.3)
    second = label(ego, CAR.front_axle, Polyline(loop), near=179.7)
    assert second.relative_angle == pytest.approx(-math.pi / 2, abs=0.02)


def left_turn(radius: float = 8.0) -> Points:
    angles = np.linspace(0, math.pi / 2, 30)
    arc = np.stack((radius * np.sin(angles), radius * (1 - np.cos(angles))), axis=1)
    return np.concatenate(([(-20.0, 0.0)], arc, [(radius, 40.0)]))


def test_in_a_turn_a_car_that_waits_in_the_opposite_lane_is_not_in_the_way() -> None:
    axle = Pose(8 * math.sin(0.3), 8 * (1 - math.cos(0.3)), 0.3)
    ego, waiting = moved(axle, forward=-CAR.front_axle), car(14.0, 4.0, math.pi)
    onward = to_world(axle, np.array([(-20.0, 0.0), (60.0, 0.0)]))
    assert Scene(ego, onward, vehicles=[waiting]).label.vehicle_distance == pytest.approx(9.0, abs=1.0)
    assert Scene(ego, left_turn(), vehicles=[waiting]).label.vehicle_distance == 50.0


def test_in_a_turn_a_car_on_the_route_is_in_the_way() -> None:
    axle = Pose(8 * math.sin(0.8), 8 * (1 - math.cos(0.8)), 0.8)
    true = Scene(moved(axle, forward=-CAR.front_axle), left_turn(), vehicles=[car(7.9, 6.0, 1.4)]).label
    assert true.hazard_stop == 1.0
    assert 0.5 < true.vehicle_distance < 1.5


def test_on_a_straight_road_a_car_that_reaches_into_the_lane_is_in_the_way() -> None:
    parked = car(6.0, -1.9)
    across = car(6.0, 1.9, math.pi / 2)
    assert Scene(vehicles=[parked]).label.hazard_stop == 1.0
    assert Scene(vehicles=[across]).label.hazard_stop == 1.0


place = st.tuples(st.floats(-5, 60), st.floats(-8, 8), st.floats(-math.pi, math.pi))


def moved_by(frame: Pose, pose: Pose) -> Pose:
    (x, y), turn = to_world(frame, np.array([pose.x, pose.y])), frame.heading
    return Pose(float(x), float(y), pose.heading + turn)


@given(
    st.builds(Pose, st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-math.pi, math.pi)),
    st.lists(place, max_size=4),
    st.lists(place, max_size=4),
    st.lists(place, max_size=4),
    st.floats(-1.9, 1.9),
    st.floats(-1, 1),
)
def test_labels_do_not_change_when_everything_is_moved_and_turned_alike(
    frame: Pose,
    cars: list[tuple[float, float, float]],
    people: list[tuple[float, float, float]],
    posts: list[tuple[float, float, float]],
    left: float,
    turn: float,
) -> None:
    # Places are rounded, since a thing on the very border of an area may fall to either side.
    round_ = [[Pose(round(x) + 0.13, round(y) + 0.17, h) for x, y, h in some] for some in (cars, people, posts)]
    here = Scene(
        pose=Pose(-CAR.front_axle, round(left, 1) + 0.01, 0.0),
        route=np.array([(-20.0, 0.0), (30.0, 0.0), (60.0, 25.0)]),
        vehicles=[VehicleState(pose) for pose in round_[0]],
        pedestrians=[PedestrianState(pose) for pose in round_[1]],
        lights=[light(pose.x, pose.y, heading=turn) for pose in round_[2]],
        signs=[sign(pose.x, pose.y, heading=turn) for pose in round_[2]],
    )
    there = Scene(
        pose=moved_by(frame, here.pose),
        route=to_world(frame, here.route),
        vehicles=[replace(car, pose=moved_by(frame, car.pose)) for car in here.vehicles],
        pedestrians=[replace(person, pose=moved_by(frame, person.pose)) for person in here.pedestrians],
        lights=[replace(light, pose=moved_by(frame, light.pose)) for light in here.lights],
        signs=[replace(sign, pose=moved_by(frame, sign.pose)) for sign in here.signs],
    )
    a, b = here.label, there.label
    assert (a.hazard_stop, a.red_light, a.speed_sign) == (b.hazard_stop, b.red_light, b.speed_sign)
    assert b.vehicle_distance == pytest.approx(a.vehicle_distance, abs=1e-6)
    assert (b.relative_angle, b.center_distance) == pytest.approx((a.relative_angle, a.center_distance), abs=1e-6)
