"""Agents by name: what makes each one, which camera it wants, and what its results depend on.

Beside the names in AGENTS, `--agent` takes what an installed package offers in the entry-point group
`caldrive.agents`, `package.module:Class` and `file.py:Class`. Such a class is an `interfaces.Agent`. Its maker is given
`model` (a path or None), `controller` (an `interfaces.Controller`), `cap` (km/h or None) and `dt` (s) where it has
parameters of these names; its attribute `camera` says which camera it wants.
"""

from __future__ import annotations

from typing import Any

from caldrive.agents.compared_rows import COMPARED_AGENTS
from caldrive.agents.rows import OWN_AGENTS, AgentEntry, require_taken
from caldrive.agents.senses import require_senses
from caldrive.agents.settings import AgentSettings
from caldrive.control.presets import controller_source, make_controller
from caldrive.datatypes import CameraConfig
from caldrive.interfaces import Agent, TruthSource
from caldrive.plugins import Plugin, attribute, find_plugin
from caldrive.provenance import file_digest

AGENTS = OWN_AGENTS | COMPARED_AGENTS
OFFERED = ("model", "controller")  # settings that somebody's own class may take


def agent_entry(name: str) -> AgentEntry:
    """The row of an agent. Raises ValueError for an unknown name, and for a class that cannot be loaded."""
    if name in AGENTS:
        return AGENTS[name]
    return _plugin_entry(find_plugin(name, "agent", tuple(AGENTS)))


def _plugin_entry(plugin: Plugin) -> AgentEntry:
    """A row for somebody's own class."""

    taken = [name for name in OFFERED if plugin.takes(name)]
    hint = ", or give its __init__ a parameter of this name"

    def make(settings: AgentSettings, dt: float, truth: TruthSource | None) -> Agent:
        require_taken(plugin.name, taken, settings, hint)
        options: dict[str, Any] = {"model": settings.model, "cap": settings.cap, "dt": dt}
        if "controller" in taken:
            options["controller"] = make_controller(settings.controller, settings.cap, dt)
        agent: Agent = plugin.build(**options)
        if not callable(attribute(agent, "act")):
            raise ValueError(
                f"found that {plugin.name} has no method act, wanted act(observation) that returns a Control: add it"
            )
        return agent

    def provenance(settings: AgentSettings) -> dict[str, Any]:
        require_taken(plugin.name, taken, settings, hint)
        model = {"model": file_digest(settings.model)} if settings.model else {}
        return {"agent_source": plugin.source} | model

    return AgentEntry(make=make, camera=lambda _: _plugin_camera(plugin), provenance=provenance)


def _plugin_camera(plugin: Plugin) -> CameraConfig | None:
    """The camera that a class asks for; without an attribute `camera` the usual one. Raises ValueError for nonsense."""
    camera = attribute(plugin.make, "camera", CameraConfig())
    if not isinstance(camera, CameraConfig | None):
        raise ValueError(
            f"found that {plugin.name} has camera {camera!r}, wanted a CameraConfig or None: "
            "set it to caldrive.CameraConfig(width=200, height=88)"
        )
    return camera


def provenance(settings: AgentSettings) -> dict[str, Any]:
    """What results depend on in the process that drives, beside its settings: digests of the network, of the agent's
    code and of the controller's, and the network's precision; None for what there is not.

    Raises ValueError where no such agent can be made.
    """
    require_senses(settings.blind, settings.truth)
    return {
        "model": None, "precision": None, "agent_source": None,
        "controller_source": controller_source(settings.controller),
        **agent_entry(settings.agent).provenance(settings),
    }  # fmt: skip
