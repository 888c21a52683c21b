"""The blueprint library: CARLA's ids and attributes, so that programs find what they look for.

Sizes of vehicles are those of the real ones, rounded; how a vehicle looks is up to the embedded world.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

BOOL, INT, FLOAT, STRING, COLOR = 1, 2, 3, 4, 5
Attribute = tuple[str, int, str, list[str], bool, bool]
"""Id, type, value, recommended values, whether a client may change it, and whether to these only."""
Size = tuple[float, float, float]
"""Length, width and height in m."""


@dataclass(frozen=True)
class Blueprint:
    """What an actor may be made from."""

    uid: int
    id: str
    attributes: tuple[Attribute, ...]

    def layout(self) -> tuple[Any, ...]:
        """As it goes to a client."""
        return self.uid, self.id, self.id.replace(".", ","), self.attributes


CARS_1 = (
    ("audi.a2", 3.7, 1.8, 1.55), ("audi.etron", 4.9, 2.0, 1.65), ("audi.tt", 4.2, 2.0, 1.4),
    ("bmw.grandtourer", 4.6, 2.2, 1.65), ("chevrolet.impala", 5.4, 2.0, 1.4), ("citroen.c3", 4.0, 1.85, 1.6),
    ("dodge.charger_police", 5.0, 2.0, 1.55), ("ford.mustang", 4.7, 1.9, 1.3),
    ("jeep.wrangler_rubicon", 3.9, 1.9, 1.9), ("lincoln.mkz_2017", 4.9, 2.1, 1.5), ("mercedes.coupe", 5.0, 2.15, 1.65),
    ("micro.microlino", 2.2, 1.5, 1.4), ("mini.cooper_s", 3.8, 2.0, 1.5), ("nissan.micra", 3.6, 1.85, 1.5),
    ("nissan.patrol", 4.6, 1.95, 1.85), ("seat.leon", 4.2, 1.8, 1.5), ("tesla.model3", 4.8, 2.15, 1.5),
    ("toyota.prius", 4.5, 2.0, 1.55),
)  # fmt: skip
CARS_2 = (
    ("dodge.charger_2020", 5.0, 1.9, 1.55), ("dodge.charger_police_2020", 5.2, 1.95, 1.65),
    ("ford.crown", 5.35, 1.8, 1.6), ("lincoln.mkz_2020", 4.9, 1.85, 1.5), ("mercedes.coupe_2020", 4.7, 1.8, 1.45),
    ("mini.cooper_s_2021", 4.55, 2.1, 1.8), ("nissan.patrol_2021", 5.55, 2.0, 2.05),
)  # fmt: skip
TRUCKS = (
    ("carlamotors.carlacola", 5.2, 2.6, 2.5), ("carlamotors.european_hgv", 7.9, 2.9, 3.5),
    ("carlamotors.firetruck", 8.5, 2.9, 3.8), ("tesla.cybertruck", 6.3, 2.4, 2.1),
)  # fmt: skip
VANS = (
    ("ford.ambulance", 6.35, 2.35, 2.4), ("mercedes.sprinter", 5.9, 2.0, 2.55), ("volkswagen.t2", 4.5, 2.05, 2.05),
    ("volkswagen.t2_2021", 4.4, 1.8, 2.0),
)  # fmt: skip
BUSES = (("mitsubishi.fusorosa", 10.3, 3.95, 4.25),)
MOTORCYCLES = (
    ("harley-davidson.low_rider", 2.35, 0.75, 1.3), ("kawasaki.ninja", 2.05, 0.8, 1.2), ("vespa.zx125", 1.8, 0.85, 1.2),
    ("yamaha.yzf", 2.2, 0.85, 1.25),
)  # fmt: skip
BICYCLES = (
    ("bh.crossbike", 1.5, 0.85, 1.1), ("diamondback.century", 1.65, 0.55, 1.0), ("gazelle.omafiets", 1.85, 0.65, 1.2),
)  # fmt: skip
SPECIAL = {
    "dodge.charger_police": "emergency", "dodge.charger_police_2020": "emergency", "ford.ambulance": "emergency",
    "carlamotors.firetruck": "emergency", "ford.crown": "taxi", "audi.etron": "electric",
    "micro.microlino": "electric", "tesla.model3": "electric", "toyota.prius": "electric",
    "tesla.cybertruck": "electric",
}  # fmt: skip
WITH_LIGHTS = {
    "carlamotors.firetruck", "ford.ambulance", "mercedes.sprinter", "volkswagen.t2_2021", "mitsubishi.fusorosa",
    *(row[0] for row in CARS_2),
}  # fmt: skip
PAINTS = ["180,44,44", "42,78,154", "230,230,226", "43,45,49"]
N_WALKERS = 52
_PROPS = {  # names by about their sizes
    (0.4, 0.4, 0.7): "trafficcone01 trafficcone02", (0.4, 0.4, 0.6): "constructioncone",
    (0.4, 1.2, 1.1): "streetbarrier warningconstruction", (0.1, 1.5, 0.9): "chainbarrier",
    (0.1, 0.1, 0.9): "chainbarrierend", (0.4, 0.9, 1.0): "warningaccident", (2.8, 2.4, 3.5): "trafficwarning",
    (1.2, 2.4, 0.1): "ironplank", (2.4, 1.5, 0.1): "dirtdebris01", (1.8, 1.5, 0.1): "dirtdebris02",
    (1.5, 1.2, 0.1): "dirtdebris03", (0.6, 0.6, 0.9): "barrel",
    (0.6, 0.6, 1.0): "bin trashcan01 trashcan02 trashcan03 trashcan04 trashcan05", (2.4, 1.6, 1.6): "container",
    (1.2, 1.2, 1.8): "clothcontainer", (1.5, 1.5, 1.8): "glasscontainer", (0.6, 0.6, 0.5): "box01",
    (0.5, 0.5, 0.4): "box02", (0.4, 0.4, 0.3): "box03", (0.5, 0.5, 0.5): "trashbag",
    (2.0, 1.2, 1.2): "platformgarbage01", (0.6, 1.6, 0.9): "bench01 bench02 bench03", (1.6, 1.6, 0.8): "table",
    (0.9, 0.9, 0.7): "plastictable", (0.5, 0.5, 0.9): "plasticchair", (1.5, 4.0, 2.6): "busstop busstoplb",
    (2.5, 2.5, 2.8): "kiosk_01", (1.5, 2.5, 2.3): "foodcart", (0.8, 1.0, 1.9): "vendingmachine",
    (0.8, 0.9, 1.6): "atm", (0.5, 0.5, 1.2): "mailbox", (0.3, 1.4, 2.4): "advertisement",
    (0.1, 0.7, 2.5): "streetsign streetsign01 streetsign04", (0.5, 0.5, 1.0): "streetfountain",
    (4.0, 4.0, 2.0): "fountain", (0.8, 0.8, 0.9): "plantpot01 plantpot02 plantpot03",
    (0.5, 0.5, 0.6): "plantpot04 plantpot05 plantpot06 plantpot07 plantpot08", (1.0, 0.6, 1.0): "shoppingcart",
    (0.4, 0.4, 1.0): "shoppingtrolley", (0.5, 0.2, 0.4): "briefcase", (0.5, 0.3, 0.7): "travelcase",
    (0.4, 1.1, 0.2): "guitarcase", (1.2, 1.2, 1.2): "haybale haybalelb",
}  # fmt: skip
PROPS: dict[str, Size] = {f"static.prop.{name}": size for size, names in _PROPS.items() for name in names.split()}
CAMERAS = ("rgb", "depth", "semantic_segmentation", "instance_segmentation")
NOT_DRAWN = ("dvs", "optical_flow", "normals", "cosmos_visualization")
VOLUME = "static.trigger.friction"
REFUSED = (
    *(f"sensor.camera.{kind}" for kind in NOT_DRAWN), "sensor.other.rss", "sensor.other.v2x", "sensor.other.v2x_custom",
)  # fmt: skip
_LENS = {
    "lens_circle_falloff": "5.0", "lens_circle_multiplier": "0.0", "lens_k": "-1.0", "lens_kcube": "0.0",
    "lens_x_size": "0.08", "lens_y_size": "0.08",
}  # fmt: skip
_EXPOSURE = {
    "gamma": "2.2", "motion_blur_intensity": "0.45", "motion_blur_max_distortion": "0.35",
    "motion_blur_min_object_screen_size": "0.1", "lens_flare_intensity": "0.1", "bloom_intensity": "0.675",
    "exposure_compensation": "0.0", "shutter_speed": "200.0", "iso": "100.0", "fstop": "1.4",
    "exposure_min_bright": "10.0", "exposure_max_bright": "12.0", "exposure_speed_up": "3.0",
    "exposure_speed_down": "1.0", "calibration_constant": "16.0", "focal_distance": "1000.0", "blur_amount": "1.0",
    "blur_radius": "0.0", "min_fstop": "1.2", "slope": "0.88", "toe": "0.55", "shoulder": "0.26", "black_clip": "0.0",
    "white_clip": "0.04", "temp": "6500.0", "tint": "0.0", "chromatic_aberration_intensity": "0.0",
    "chromatic_aberration_offset": "0.0",
}  # fmt: skip


def _free(name: str, kind: int, *values: str) -> Attribute:
    """An attribute that a client may change; the first value is the usual one."""
    return name, kind, values[0], list(values), True, False


def _fixed(name: str, kind: int, value: str) -> Attribute:
    return name, kind, value, [], False, False


def _floats(values: dict[str, str]) -> list[Attribute]:
    return [_free(name, FLOAT, value) for name, value in values.items()]


def _names(role: str) -> list[Attribute]:
    return [_free("role_name", STRING, role, "autopilot", "hero", "ego_vehicle"), _free("ros_name", STRING, "")]


def _vehicle(name: str, base: str, generation: int) -> list[Attribute]:
    wheels = 2 if base in ("motorcycle", "bicycle") else 4
    return [
        *_names("autopilot"), _free("color", COLOR, *PAINTS), _free("driver_id", INT, "0"),
        _free("sticky_control", BOOL, "true"), _free("terramechanics", BOOL, "false"),
        _fixed("object_type", STRING, ""), _fixed("base_type", STRING, base),
        _fixed("special_type", STRING, SPECIAL.get(name, "")), _fixed("number_of_wheels", INT, str(wheels)),
        _fixed("generation", INT, str(generation)),
        _fixed("has_lights", BOOL, str(name in WITH_LIGHTS).lower()), _fixed("has_dynamic_doors", BOOL, "false"),
    ]  # fmt: skip


def _walker(k: int) -> list[Attribute]:
    return [
        *_names("pedestrian"), _free("is_invincible", BOOL, "true"), _free("speed", FLOAT, "0.0", "1.4", "3.0"),
        _fixed("gender", STRING, "female" if k % 2 else "male"), _fixed("age", STRING, "adult"),
        _fixed("generation", INT, str(1 + k % 2)),
    ]  # fmt: skip


def _camera(kind: str) -> list[Attribute]:
    attributes = [
        *_names("front"), _free("image_size_x", INT, "800"), _free("image_size_y", INT, "600"),
        _free("fov", FLOAT, "90.0"), _free("sensor_tick", FLOAT, "0.0"), *_floats(_LENS),
    ]  # fmt: skip
    if kind != "rgb":
        return attributes
    mode = ("exposure_mode", STRING, "histogram", ["histogram", "manual"], True, True)
    more = [_free("enable_postprocess_effects", BOOL, "true"), mode, _free("blade_count", INT, "5")]
    return [*attributes, *more, *_floats(_EXPOSURE)]


_SENSORS: dict[str, dict[str, str]] = {
    "sensor.other.collision": {}, "sensor.other.lane_invasion": {},
    "sensor.other.obstacle": {"distance": "5.0", "hit_radius": "0.5"},
    "sensor.other.gnss": {
        f"noise_{axis}_{what}": "0.0" for axis in ("lat", "lon", "alt") for what in ("bias", "stddev")
    },
    "sensor.other.imu": {
        f"noise_{what}_{axis}": "0.0" for what in ("accel_stddev", "gyro_stddev", "gyro_bias") for axis in "xyz"
    },
    "sensor.lidar.ray_cast_semantic": {
        "range": "10.0", "rotation_frequency": "10.0", "upper_fov": "10.0", "lower_fov": "-30.0",
        "horizontal_fov": "360.0",
    },
    "sensor.other.rss": {},
    **{f"sensor.other.{kind}": {"transmit_power": "21.5", "receiver_sensitivity": "-99.0", "frequency_ghz": "5.9"}
       for kind in ("v2x", "v2x_custom")},
    "sensor.lidar.ray_cast": {
        "range": "10.0", "rotation_frequency": "10.0", "upper_fov": "10.0", "lower_fov": "-30.0",
        "horizontal_fov": "360.0", "atmosphere_attenuation_rate": "0.004", "dropoff_general_rate": "0.45",
        "dropoff_intensity_limit": "0.8", "dropoff_zero_intensity": "0.4", "noise_stddev": "0.0",
    },
    "sensor.other.radar": {"horizontal_fov": "30.0", "vertical_fov": "30.0", "range": "100.0"},
}  # fmt: skip


def _sensor(id: str) -> list[Attribute]:
    attributes = [*_names("front"), *_floats(_SENSORS[id])]
    if id not in ("sensor.other.collision", "sensor.other.lane_invasion", "sensor.other.rss"):
        attributes.append(_free("sensor_tick", FLOAT, "0.0"))
    if id in ("sensor.other.radar", "sensor.lidar.ray_cast", "sensor.other.gnss", "sensor.other.imu"):
        attributes.append(_free("noise_seed", INT, "0"))
    if id.startswith("sensor.lidar."):
        attributes += [_free("channels", INT, "32"), _free("points_per_second", INT, "56000")]
    if id == "sensor.other.radar":
        attributes.append(_free("points_per_second", INT, "1500"))
    if id == "sensor.other.obstacle":
        attributes += [_free("only_dynamics", BOOL, "false"), _free("debug_linetrace", BOOL, "false")]
    return attributes


def _all() -> dict[str, list[Attribute]]:
    found: dict[str, list[Attribute]] = {}
    for base, generation, rows in (
        ("car", 1, CARS_1), ("car", 2, CARS_2), ("truck", 2, TRUCKS), ("van", 2, VANS), ("bus", 2, BUSES),
        ("motorcycle", 1, MOTORCYCLES), ("bicycle", 1, BICYCLES),
    ):  # fmt: skip
        found |= {f"vehicle.{name}": _vehicle(name, base, generation) for name, *_ in rows}
    found |= {f"walker.pedestrian.{k:04}": _walker(k) for k in range(1, N_WALKERS + 1)}
    found["controller.ai.walker"] = _names("default")
    found |= {f"sensor.camera.{kind}": _camera(kind) for kind in (*CAMERAS, *NOT_DRAWN)}
    found |= {id: _sensor(id) for id in _SENSORS}
    found |= {id: _names("prop") for id in PROPS}
    found[VOLUME] = [*_names("trigger"), *_floats({"friction": "3.5", **{f"extent_{axis}": "100.0" for axis in "xyz"}})]
    return found


def usual_attributes(id: str) -> dict[str, str]:
    """Of an actor that is made without a wish, by name."""
    return {name: value for name, _, value, *_ in BLUEPRINTS[id].attributes}


BLUEPRINTS = {id: Blueprint(uid, id, tuple(rows)) for uid, (id, rows) in enumerate(_all().items(), 1)}
SIZES: dict[str, Size] = {
    **{f"vehicle.{row[0]}": row[1:] for row in (*CARS_1, *CARS_2, *TRUCKS, *VANS, *BUSES, *MOTORCYCLES, *BICYCLES)},
    **PROPS,
}
