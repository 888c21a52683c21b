"""Agents by name: what makes each one, which camera it wants, and what its results depend on.

Beside the names in AGENTS, `--agent` takes what an installed package offers in the entry-point group `caldrive.agents`,
`package.module:Class` and `file.py:Class`. Such a class is an `interfaces.Agent`. Its maker is given `model` (a path or
None), `controller` (an `interfaces.Controller`), `cap` (km/h or None) and `dt` (s) where it has parameters of these
names; its attribute `camera` says which camera it wants.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from caldrive.agents.blind import require_affordances
from caldrive.agents.settings import AgentSettings
from caldrive.control.presets import controller_source, make_controller
from caldrive.datatypes import CameraConfig
from caldrive.interfaces import Agent, Perception, TruthSource
from caldrive.plugins import Plugin, attribute, find_plugin
from caldrive.provenance import file_digest

if TYPE_CHECKING:  # the command line's help waits for neither torch nor SUMO
    from caldrive.agents.cal import CALAgent
    from caldrive.agents.reinforcement.agent import ReinforcementAgent

OFFERED = ("model", "controller")  # settings that an agent may take
MODELS = Path(__file__).parents[1] / "models"
SHIPPED_MODEL, SHIPPED_POLICY = MODELS / "cal.safetensors", MODELS / "rl.safetensors"


@dataclass(frozen=True)
class AgentEntry:
    """A row of the registry."""

    make: Callable[[AgentSettings, float, TruthSource | None], Agent]
    """The agent for settings, the seconds of a step, and, for the privileged only, where the truth comes from."""
    camera: Callable[[AgentSettings], CameraConfig | None]
    """The camera that it wants, None where it looks at no image."""
    provenance: Callable[[AgentSettings], dict[str, Any]]
    """What results depend on beside the settings."""
    privileged: bool = False
    """Whether it knows the truth, and so is no agent under test."""


def model_path(model: Path | None) -> Path:
    """The model asked for, or the package's. Raises FileNotFoundError where there is none."""
    if model is None and not SHIPPED_MODEL.is_file():
        raise FileNotFoundError(
            "found no trained network in this package, wanted one for the agent cal: "
            "type --agent oracle, or make one with `caldrive train` and give it with --model FILE"
        )
    return model or SHIPPED_MODEL


def make_cal(settings: AgentSettings, dt: float, threads: int | None = 1) -> CALAgent:
    """The agent that drives by a network. dt: seconds of a step. threads: how many it may use, None for all cores."""
    from caldrive.agents.cal import CALAgent
    from caldrive.perception.inference.predictor import NetworkPerception

    perception = NetworkPerception(model_path(settings.model), threads=threads)
    return CALAgent(perception, make_controller(settings.controller, settings.cap, dt))


def _cal_camera(settings: AgentSettings) -> CameraConfig:
    from caldrive.perception.network.checkpoint import read_info

    path = model_path(settings.model)
    info = read_info(path)
    if not info.ranges:
        raise ValueError(
            f"found no ranges for 8-bit integers in {path}, without which an image takes many times as long, wanted "
            "those that every training finds: train it again"
        )
    network = info.config
    return CameraConfig(width=network.image_width, height=network.image_height)


def _cal_provenance(settings: AgentSettings) -> dict[str, Any]:
    from caldrive.perception.inference.precision import driving_precision
    from caldrive.perception.network.checkpoint import read_info

    path = model_path(settings.model)
    return {"model": file_digest(path), "precision": driving_precision("auto", read_info(path).ranges)}


def _make_oracle(settings: AgentSettings, dt: float, truth: TruthSource | None) -> CALAgent:
    from caldrive.agents.cal import CALAgent, OraclePerception

    _require_taken("the oracle", ("controller",), settings)
    assert truth is not None
    return CALAgent(OraclePerception(truth), make_controller(settings.controller, settings.cap, dt))


def _oracle_provenance(settings: AgentSettings) -> dict[str, Any]:
    _require_taken("the oracle", ("controller",), settings)
    return {}


def policy_path(model: Path | None) -> Path:
    """The policy asked for, or the package's. Raises FileNotFoundError where there is none."""
    if model is None and not SHIPPED_POLICY.is_file():
        raise FileNotFoundError(
            "found no policy in this package, wanted one for the agent rl: "
            "train one as docs/own/learner.md says, and give it with --model FILE"
        )
    return model or SHIPPED_POLICY


def _make_rl(settings: AgentSettings, _: float, truth: TruthSource | None) -> ReinforcementAgent:
    """The agent that drives by a policy; one that sees affordances has CAL's network for them, or the truth."""
    from caldrive.agents.reinforcement.agent import load_agent

    _require_taken("the agent rl", ("model",), settings)
    return load_agent(policy_path(settings.model), lambda: _affordance_source(truth))


def _affordance_source(truth: TruthSource | None) -> Perception:
    from caldrive.agents.cal import OraclePerception
    from caldrive.perception.inference.predictor import NetworkPerception

    return NetworkPerception(model_path(None), threads=1) if truth is None else OraclePerception(truth)


def _rl_camera(settings: AgentSettings) -> CameraConfig:
    from caldrive.agents.reinforcement.agent import policy_camera
    from caldrive.agents.reinforcement.checkpoint import read_policy_info

    info = read_policy_info(policy_path(settings.model))
    if info.policy.sees == "affordances":
        return _cal_camera(AgentSettings())
    return policy_camera(info.encoder.image_size if info.encoder else None)


def _rl_provenance(settings: AgentSettings) -> dict[str, Any]:
    """The policy's, and where it sees by CAL's network that one's, too."""
    from caldrive.agents.reinforcement.checkpoint import read_policy_info
    from caldrive.perception.inference.precision import driving_precision

    _require_taken("the agent rl", ("model",), settings)
    path = policy_path(settings.model)
    info, model = read_policy_info(path), file_digest(path)
    if info.policy.sees == "affordances":
        network = _cal_provenance(AgentSettings())
        return network | {"model": f"{model} {network['model']}"}
    precision = driving_precision("auto", info.encoder.ranges) if info.encoder else None
    return {"model": model, "precision": precision}


def _rl_oracle_provenance(settings: AgentSettings) -> dict[str, Any]:
    from caldrive.agents.reinforcement.checkpoint import read_policy_info

    _require_taken("the agent rl-oracle", ("model",), settings)
    path = policy_path(settings.model)
    if (sees := read_policy_info(path).policy.sees) != "affordances":
        raise ValueError(f"found in {path} a policy that sees {sees}, wanted one on affordances: type --agent rl")
    return {"model": file_digest(path)}


AGENTS: dict[str, AgentEntry] = {
    "cal": AgentEntry(
        make=lambda settings, dt, _: make_cal(settings, dt), camera=_cal_camera, provenance=_cal_provenance
    ),
    "rl": AgentEntry(make=_make_rl, camera=_rl_camera, provenance=_rl_provenance),
    "oracle": AgentEntry(make=_make_oracle, camera=lambda _: None, provenance=_oracle_provenance, privileged=True),
    "rl-oracle": AgentEntry(make=_make_rl, camera=lambda _: None, provenance=_rl_oracle_provenance, privileged=True),
}


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
        _require_taken(plugin.name, taken, settings, hint)
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
        _require_taken(plugin.name, taken, settings, hint)
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


def _require_taken(agent: str, taken: Sequence[str], settings: AgentSettings, hint: str = "") -> None:
    """Raises ValueError where settings name a model or a controller that an agent would never see. taken: what it
    takes; hint: what else to do."""
    usual = AgentSettings()
    for name in OFFERED:
        if getattr(settings, name) != getattr(usual, name) and name not in taken:
            raise ValueError(
                f"found --{name} {getattr(settings, name)}, but {agent} takes none: leave --{name} out{hint}"
            )


def provenance(settings: AgentSettings) -> dict[str, Any]:
    """What results depend on in the process that drives, beside its settings: digests of the network, of the agent's
    code and of the controller's, and the network's precision; None for what there is not.

    Raises ValueError where no such agent can be made.
    """
    require_affordances(settings.blind)
    return {
        "model": None, "precision": None, "agent_source": None,
        "controller_source": controller_source(settings.controller),
        **agent_entry(settings.agent).provenance(settings),
    }  # fmt: skip
