"""Who drives where: a world by name, and the agent for it."""

from __future__ import annotations

from numbers import Real
from typing import Any

from caldrive.agents.registry import agent_entry
from caldrive.agents.senses import with_senses
from caldrive.agents.settings import AgentSettings
from caldrive.datatypes import CameraConfig
from caldrive.driving.own_code import truth_of
from caldrive.driving.settings import WorldSettings
from caldrive.interfaces import Agent, World
from caldrive.plugins import attribute, find_plugin

WORLDS = ("embedded", "carla")
LONGEST_STEP = 1.0  # s
WORLD_METHODS = ("reset", "step", "truth", "close")  # of `interfaces.World`


def make_world(name: str = "embedded", camera: CameraConfig | None = None, **more: Any) -> World:
    """A world by name: `embedded`, `carla`, or an `interfaces.World`: `package.module:Class`, `file.py:Class` or an
    entry point.

    camera: the agent's; None drives without images. more: what only some worlds take, such as a stopwatch, a second
    camera (auxiliary), or CARLA's host and port. Raises ValueError for an unknown name, a class that is no World, and
    one that takes no second camera where one is asked for.
    """
    if name == "embedded":
        from caldrive.world.embedded import EmbeddedWorld

        return EmbeddedWorld(camera, **more)
    if name == "carla":
        from caldrive.carla_bridge.client.world import CarlaWorld

        return CarlaWorld(camera, **more)
    plugin = find_plugin(name, "world", WORLDS)
    if more.get("auxiliary") and not plugin.takes("auxiliary"):
        raise ValueError(
            f"found that {plugin.name} takes no second camera, wanted a parameter auxiliary: add it, or leave "
            "--variant out"
        )
    world: World = plugin.build(camera=camera, **more)
    _check_world(world, plugin.name)
    return world


def _check_world(world: World, name: str) -> None:
    """Raises ValueError where somebody's object is no world."""
    missing = [method for method in WORLD_METHODS if not callable(attribute(world, method))]
    missing += ["dt"] * (attribute(world, "dt") is None)
    if missing:
        raise ValueError(
            f"found that {name} has no {missing[0]}, wanted a world with dt, {', '.join(WORLD_METHODS)}: add it "
            "(caldrive.interfaces.World says what each does)"
        )
    dt: object = world.dt  # it may be anything
    if not isinstance(dt, Real) or not 0 < float(dt) <= LONGEST_STEP:
        raise ValueError(
            f"found that {name} has dt {dt!r}, wanted the seconds of one step, more than 0 and at most "
            f"{LONGEST_STEP}: set it to 0.1"
        )


def set_up(settings: AgentSettings, images: bool = False) -> tuple[World, Agent]:
    """A world, and the agent for it. settings: a `DriverSettings` says in which world, others mean the embedded one.
    images: whether an agent that looks at none gets a camera, too.

    Raises ValueError for an unknown agent, controller or world, and for settings that the agent does not take,
    FileNotFoundError or ValueError for a model that is no use.
    """
    entry = agent_entry(settings.agent)
    entry.provenance(settings)  # refuses what the agent would not hear of
    camera = entry.camera(settings) or (CameraConfig() if images else None)
    auxiliary = entry.auxiliary(settings)
    where = settings if isinstance(settings, WorldSettings) else WorldSettings()
    world = make_world(where.world, camera, **where.address, **({"auxiliary": auxiliary} if auxiliary else {}))
    try:
        knows = (lambda: truth_of(world)) if entry.privileged or settings.truth else None
        agent = entry.make(settings, world.dt, knows if entry.privileged else None)
        return world, with_senses(agent, settings.blind, settings.truth, knows)
    except BaseException:
        world.close()
        raise


def planned_town(world: WorldSettings, town: str) -> str:
    """The town as routes are planned in it, which for CARLA's maps is a file. Raises ValueError where the server has no
    such map, RuntimeError where none answers."""
    if world.world != "carla":
        return town
    from caldrive.carla_bridge.client.connection import served_town

    return served_town(world.host, world.port, town)


def require_embedded(world: WorldSettings) -> None:
    """Raises ValueError where a cluster is to drive in another world than the embedded one."""
    if world.world != "embedded":
        raise ValueError(
            f"found --ray with --world {world.world}, wanted the embedded world, which every machine has: leave --ray "
            "out"
        )
