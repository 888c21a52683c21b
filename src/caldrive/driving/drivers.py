"""Who drives: an agent by name, in a world with the camera that it needs."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

from caldrive.config import CameraConfig, ControlConfig
from caldrive.control.controller import Controller
from caldrive.control.presets import DEFAULT, PAPER
from caldrive.datatypes import Scenario
from caldrive.driving.agent import CALAgent, OraclePerception
from caldrive.driving.limits import MOST_SEED, require_within
from caldrive.driving.settings import DriverSettings
from caldrive.driving.tasks import scenarios
from caldrive.world.embedded import EmbeddedWorld

AGENTS = ("cal", "oracle")
PRESETS = {"default": DEFAULT, "paper": PAPER}
SHIPPED_MODEL = Path(__file__).parents[1] / "models" / "cal.safetensors"


def model_path(model: Path | None) -> Path:
    """The model asked for, or the package's. Raises FileNotFoundError where there is none."""
    if model is None and not SHIPPED_MODEL.is_file():
        raise FileNotFoundError(
            "found no trained network in this package, wanted one for the agent cal: "
            "type --agent oracle, or make one with `caldrive train` and give it with --model FILE"
        )
    return model or SHIPPED_MODEL


def require_agent(name: str) -> None:
    """Raises ValueError for an unknown agent."""
    if name not in AGENTS:
        raise ValueError(f"found agent {name!r}, wanted one of {', '.join(AGENTS)}: type --agent oracle")


def controller_config(preset: str, cap: float | None) -> ControlConfig:
    """A preset by name, with a cap in km/h. Raises ValueError for an unknown preset or a cap that cannot be."""
    if preset not in PRESETS:
        raise ValueError(f"found preset {preset!r}, wanted one of {', '.join(PRESETS)}: type --preset default")
    if cap is not None:
        require_within("--cap", cap, 1.0, 200.0, 20)
    return replace(PRESETS[preset], cap=cap)


def oracle(camera: CameraConfig | None, config: ControlConfig) -> tuple[EmbeddedWorld, CALAgent]:
    """A world and the agent that knows its truth."""
    world = EmbeddedWorld(camera)
    return world, CALAgent(OraclePerception(world.truth), Controller(config, world.dt))


def network_agent(model: Path | None, config: ControlConfig, threads: int | None = 1) -> tuple[CALAgent, CameraConfig]:
    """The agent that drives by a network, and the camera that it needs."""
    from caldrive.perception.predictor import NetworkPerception

    perception = NetworkPerception(model_path(model), threads=threads)
    size = perception.network.config
    camera = CameraConfig(width=size.image_width, height=size.image_height)
    return CALAgent(perception, Controller(config, EmbeddedWorld.dt)), camera


def set_up(settings: DriverSettings, images: bool = False) -> tuple[EmbeddedWorld, CALAgent]:
    """A world and the agent for it. images: whether the oracle, too, gets a camera.

    Raises ValueError for an unknown agent or preset, FileNotFoundError or ValueError for a model that is no use.
    """
    require_agent(settings.agent)
    config = controller_config(settings.preset, settings.cap)
    if settings.agent == "oracle":
        return oracle(CameraConfig() if images else None, config)
    agent, camera = network_agent(settings.model, config)
    return EmbeddedWorld(camera), agent


def _check(settings: DriverSettings, n: int) -> None:
    for option, number in (("--cars", settings.cars), ("--people", settings.people)):
        if number is not None:
            require_within(option, number, 0, math.inf, 0)
    require_within("--episodes", n, 1, 100_000, 1)
    require_within("--seed", settings.seed, 0, MOST_SEED, 0)
    if settings.seconds is not None:
        require_within("--seconds", settings.seconds, 0.1, math.inf, 60)


def chosen_scenarios(settings: DriverSettings, n: int) -> list[Scenario]:
    """n of the task's scenarios, from settings.route on. Raises ValueError for figures that cannot be."""
    _check(settings, n)
    found = scenarios(
        settings.town, settings.task, settings.weather, cars=settings.cars, people=settings.people, seed=settings.seed
    )
    require_within("--route", settings.route, 0, len(found) - 1, 0)
    chosen = [found[(settings.route + k) % len(found)] for k in range(n)]
    if settings.seconds is None:
        return chosen
    return [replace(one, time_limit=min(one.time_limit, settings.seconds)) for one in chosen]
