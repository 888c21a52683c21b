"""Agents by name: what makes each one, which camera it wants, and what its results depend on.

Beside the names in AGENTS, `--agent` takes what an installed package offers in the entry-point group `caldrive.agents`,
`package.module:Class` and `file.py:Class`. Such a class is an `interfaces.Agent`; its maker is given `model`, `cap` and
`dt` where it has parameters of these names.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from caldrive.agents.settings import AgentSettings
from caldrive.control.presets import controller_source, make_controller
from caldrive.datatypes import CameraConfig
from caldrive.interfaces import Agent, TruthSource
from caldrive.plugins import Plugin, from_entry_point, is_plugin, load_plugin, offered
from caldrive.provenance import file_digest

if TYPE_CHECKING:  # the command line's help waits for neither torch nor SUMO
    from caldrive.agents.cal import CALAgent

SHIPPED_MODEL = Path(__file__).parents[1] / "models" / "cal.safetensors"
GROUP = "caldrive.agents"


@dataclass(frozen=True)
class AgentEntry:
    """A row of the registry.

    make: the agent for settings, the seconds of a step, and, for the privileged only, where the truth comes from.
    camera: the camera that it wants, None where it looks at no image. provenance: what results depend on beside the
    settings. privileged: it knows the truth, and is no agent under test.
    """

    make: Callable[[AgentSettings, float, TruthSource | None], Agent]
    camera: Callable[[AgentSettings], CameraConfig | None]
    provenance: Callable[[AgentSettings], dict[str, Any]]
    privileged: bool = False


def model_path(model: Path | None) -> Path:
    """The model asked for, or the package's. Raises FileNotFoundError where there is none."""
    if model is None and not SHIPPED_MODEL.is_file():
        raise FileNotFoundError(
            "found no trained network in this package, wanted one for the agent cal: "
            "type --agent oracle, or make one with `caldrive train` and give it with --model FILE"
        )
    return model or SHIPPED_MODEL


def make_cal(settings: AgentSettings, dt: float, threads: int | None = 1) -> CALAgent:
    """The agent that drives by a network. threads: how many it may use."""
    from caldrive.agents.cal import CALAgent
    from caldrive.perception.inference.predictor import NetworkPerception

    perception = NetworkPerception(model_path(settings.model), threads=threads)
    return CALAgent(perception, make_controller(settings.controller, settings.cap, dt))


def _cal_camera(settings: AgentSettings) -> CameraConfig:
    from caldrive.perception.network.checkpoint import read_info

    network = read_info(model_path(settings.model)).config
    return CameraConfig(width=network.image_width, height=network.image_height)


def _cal_provenance(settings: AgentSettings) -> dict[str, Any]:
    from caldrive.perception.inference.engines import driving_precision
    from caldrive.perception.network.checkpoint import read_info

    path = model_path(settings.model)
    return {"model": file_digest(path), "precision": driving_precision("auto", read_info(path))}


def _make_oracle(settings: AgentSettings, dt: float, truth: TruthSource | None) -> CALAgent:
    from caldrive.agents.cal import CALAgent, OraclePerception

    assert truth is not None
    return CALAgent(OraclePerception(truth), make_controller(settings.controller, settings.cap, dt))


AGENTS: dict[str, AgentEntry] = {
    "cal": AgentEntry(lambda settings, dt, _: make_cal(settings, dt), _cal_camera, _cal_provenance),
    "oracle": AgentEntry(_make_oracle, lambda _: None, lambda _: {}, privileged=True),
}


def agent_entry(name: str) -> AgentEntry:
    """The row of an agent. Raises ValueError for an unknown name, and for a class that cannot be loaded."""
    if name in AGENTS:
        return AGENTS[name]
    plugin = load_plugin(name, "--agent") if is_plugin(name) else from_entry_point(GROUP, name)
    if plugin is None:
        known = ", ".join([*AGENTS, *offered(GROUP)])
        raise ValueError(
            f"found agent {name!r}, wanted one of {known}, or your own class: "
            "type --agent oracle, or --agent FILE.py:CLASS"
        )
    return _plugin_entry(plugin)


def _plugin_entry(plugin: Plugin) -> AgentEntry:
    """A row for somebody's own class. Its attribute `camera` says which camera it wants."""

    def make(settings: AgentSettings, dt: float, truth: TruthSource | None) -> Agent:
        agent: Agent = plugin.build(model=settings.model, cap=settings.cap, dt=dt)
        if not callable(getattr(agent, "act", None)):
            raise ValueError(
                f"found that {plugin.name} has no method act, wanted act(observation) that returns a Control: add it"
            )
        return agent

    def provenance(settings: AgentSettings) -> dict[str, Any]:
        model = {"model": file_digest(settings.model)} if settings.model and plugin.takes("model") else {}
        return {"agent_source": plugin.source} | model

    return AgentEntry(make, lambda _: getattr(plugin.make, "camera", CameraConfig()), provenance)


def provenance(settings: AgentSettings) -> dict[str, Any]:
    """What results depend on in the process that drives, beside its settings."""
    found = {"model": None, "precision": None, "agent_source": None}
    return (
        found
        | {"controller_source": controller_source(settings.controller)}
        | agent_entry(settings.agent).provenance(settings)
    )
