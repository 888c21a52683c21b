"""Who drives where: a world by name, and the agent for it."""

from __future__ import annotations

from typing import Any

from caldrive.agents.registry import agent_entry
from caldrive.agents.settings import AgentSettings
from caldrive.datatypes import CameraConfig
from caldrive.interfaces import Agent, World
from caldrive.plugins import is_plugin, load_plugin

WORLDS = ("embedded",)


def make_world(name: str = "embedded", camera: CameraConfig | None = None, **more: Any) -> World:
    """A world by name: `embedded`, or `package.module:Class` or `file.py:Class`, an `interfaces.World`.

    camera: the agent's; None drives without images. more: what only some worlds take, such as a stopwatch. Raises
    ValueError for an unknown name.
    """
    if name == "embedded":
        from caldrive.world.embedded import EmbeddedWorld

        return EmbeddedWorld(camera, **more)
    if not is_plugin(name):
        raise ValueError(
            f"found world {name!r}, wanted {', '.join(WORLDS)} or your own class: type --world FILE.py:CLASS"
        )
    world: World = load_plugin(name, "--world").build(camera=camera, **more)
    return world


def set_up(settings: AgentSettings, world_name: str = "embedded", images: bool = False) -> tuple[World, Agent]:
    """A world, and the agent for it. images: whether an agent that looks at none gets a camera, too.

    Raises ValueError for an unknown agent, controller or world, FileNotFoundError or ValueError for a model that is no
    use.
    """
    entry = agent_entry(settings.agent)
    camera = entry.camera(settings) or (CameraConfig() if images else None)
    world = make_world(world_name, camera)
    return world, entry.make(settings, world.dt, world.truth if entry.privileged else None)
