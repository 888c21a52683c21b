"""The package's own agents, a row each: what makes one, which camera it wants, and what its results depend on."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from caldrive.agents.settings import AgentSettings
from caldrive.control.presets import make_controller
from caldrive.datatypes import CameraConfig
from caldrive.interfaces import Agent, Perception, TruthSource
from caldrive.provenance import file_digest

if TYPE_CHECKING:  # the command line's help waits for neither torch nor SUMO
    from caldrive.agents.cal import CALAgent

MODELS = Path(__file__).parents[1] / "models"
SHIPPED_MODEL = MODELS / "cal.safetensors"


@dataclass(frozen=True)
class AgentEntry:
    """A row of the registry."""

    make: Callable[[AgentSettings, float, TruthSource | None], Agent]
    """The agent for settings, the seconds of a step, and, for the privileged only, where the truth comes from."""
    camera: Callable[[AgentSettings], CameraConfig | None]
    """The camera that it wants, None where it looks at no image."""
    provenance: Callable[[AgentSettings], dict[str, Any]]
    """What results depend on beside the settings. Raises ValueError for settings that it does not take."""
    privileged: bool = False
    """Whether it knows the truth, and so is no agent under test."""
    variants: Mapping[str, str] = field(default_factory=dict)
    """Other ways in which it can drive, with a word on each."""


def model_path(model: Path | None, agent: str = "cal") -> Path:
    """The model asked for, or the package's for an agent. Raises FileNotFoundError where there is none."""
    shipped = MODELS / f"{agent}.safetensors"
    if model is None and not shipped.is_file():
        raise FileNotFoundError(
            f"found no trained network in this package, wanted one for the agent {agent}: "
            f"type --agent oracle, or make one with `caldrive train --agent {agent}` and give it with --model FILE"
        )
    return model or shipped


def require_taken(agent: str, taken: Sequence[str], settings: AgentSettings, hint: str = "") -> None:
    """Raises ValueError where settings name a model, a controller or a variant that an agent would never see. taken:
    what it takes; hint: what else to do."""
    usual = AgentSettings()
    for name in ("model", "controller", "variant"):
        if getattr(settings, name) != getattr(usual, name) and name not in taken:
            raise ValueError(
                f"found --{name} {getattr(settings, name)}, but {agent} takes none: leave --{name} out{hint}"
            )


def _require_variant(agent: str, settings: AgentSettings) -> None:
    """Raises ValueError where settings name a way of driving that an agent does not have."""
    variants = AGENTS[agent].variants
    if settings.variant is not None and settings.variant not in variants:
        raise ValueError(
            f"found --variant {settings.variant}, wanted one of {', '.join(variants)} for the agent {agent}: "
            f"type --variant {next(iter(variants))}, or leave it out"
        )


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

    require_taken("the agent cal", ("model", "controller"), settings)
    path = model_path(settings.model)
    return {"model": file_digest(path), "precision": driving_precision("auto", read_info(path).ranges)}


def _make_oracle(settings: AgentSettings, dt: float, truth: TruthSource | None) -> CALAgent:
    from caldrive.agents.cal import CALAgent, OraclePerception

    require_taken("the oracle", ("controller",), settings)
    assert truth is not None
    return CALAgent(OraclePerception(truth), make_controller(settings.controller, settings.cap, dt))


def _oracle_provenance(settings: AgentSettings) -> dict[str, Any]:
    require_taken("the oracle", ("controller",), settings)
    return {}


def _make_cil(settings: AgentSettings, dt: float, truth: TruthSource | None) -> Agent:
    from caldrive.agents.conditional_imitation.agent import ImitationAgent, rules_for

    avoid_stopping = settings.variant == "avoid-stopping"
    return ImitationAgent(model_path(settings.model, "cil"), rules_for(settings.cap), avoid_stopping=avoid_stopping)


def _cil_camera(settings: AgentSettings) -> CameraConfig:
    from caldrive.agents.conditional_imitation.checkpoint import read_imitation_info

    network = read_imitation_info(model_path(settings.model, "cil")).config
    return CameraConfig(width=network.image_width, height=network.image_height)


def _cil_provenance(settings: AgentSettings) -> dict[str, Any]:
    from caldrive.agents.conditional_imitation.checkpoint import read_imitation_info
    from caldrive.perception.inference.precision import driving_precision

    require_taken("the agent cil", ("model", "variant"), settings)
    _require_variant("cil", settings)
    path = model_path(settings.model, "cil")
    return {"model": file_digest(path), "precision": driving_precision("auto", read_imitation_info(path).ranges)}


def _make_rl(settings: AgentSettings, dt: float, truth: TruthSource | None) -> Agent:
    """The agent that drives by a policy; one that sees affordances has CAL's network for them, or the truth."""
    from caldrive.agents.reinforcement.agent import load_agent

    return load_agent(model_path(settings.model, "rl"), lambda: _affordance_source(truth))


def _affordance_source(truth: TruthSource | None) -> Perception:
    from caldrive.agents.cal import OraclePerception
    from caldrive.perception.inference.predictor import NetworkPerception

    return NetworkPerception(model_path(None), threads=1) if truth is None else OraclePerception(truth)


def _rl_camera(settings: AgentSettings) -> CameraConfig:
    from caldrive.agents.reinforcement.agent import policy_camera
    from caldrive.agents.reinforcement.checkpoint import read_policy_info

    info = read_policy_info(model_path(settings.model, "rl"))
    if info.policy.sees == "affordances":
        return _cal_camera(AgentSettings())
    return policy_camera(info.encoder.image_size if info.encoder else None)


def _rl_provenance(settings: AgentSettings) -> dict[str, Any]:
    """The policy's, and where it sees by CAL's network that one's, too."""
    from caldrive.agents.reinforcement.checkpoint import read_policy_info
    from caldrive.perception.inference.precision import driving_precision

    require_taken("the agent rl", ("model",), settings)
    path = model_path(settings.model, "rl")
    info, model = read_policy_info(path), file_digest(path)
    if info.policy.sees == "affordances":
        network = _cal_provenance(AgentSettings())
        return network | {"model": f"{model} {network['model']}"}
    precision = driving_precision("auto", info.encoder.ranges) if info.encoder else None
    return {"model": model, "precision": precision}


def _rl_oracle_provenance(settings: AgentSettings) -> dict[str, Any]:
    from caldrive.agents.reinforcement.checkpoint import read_policy_info

    require_taken("the agent rl-oracle", ("model",), settings)
    path = model_path(settings.model, "rl")
    if (sees := read_policy_info(path).policy.sees) != "affordances":
        raise ValueError(f"found in {path} a policy that sees {sees}, wanted one on affordances: type --agent rl")
    return {"model": file_digest(path)}


AGENTS: dict[str, AgentEntry] = {
    "cal": AgentEntry(
        make=lambda settings, dt, _: make_cal(settings, dt), camera=_cal_camera, provenance=_cal_provenance
    ),
    "oracle": AgentEntry(make=_make_oracle, camera=lambda _: None, provenance=_oracle_provenance, privileged=True),
    "cil": AgentEntry(
        make=_make_cil,
        camera=_cil_camera,
        provenance=_cil_provenance,
        variants={"avoid-stopping": "with the released agent's forced-stop fix"},
    ),
    "rl": AgentEntry(make=_make_rl, camera=_rl_camera, provenance=_rl_provenance),
    "rl-oracle": AgentEntry(make=_make_rl, camera=lambda _: None, provenance=_rl_oracle_provenance, privileged=True),
}
