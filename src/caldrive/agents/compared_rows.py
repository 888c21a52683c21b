"""The rows of the systems that CAL is compared with: conditional imitation learning, the modular pipeline and
reinforcement learning."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from caldrive.agents.rows import AgentEntry, cal_camera, cal_provenance, model_path, require_taken
from caldrive.agents.settings import AgentSettings
from caldrive.datatypes import CameraConfig
from caldrive.interfaces import Agent, Perception, TruthSource
from caldrive.provenance import file_digest

AVOID_STOPPING, AUXILIARY = "avoid-stopping", "auxiliary-camera"
CIL_VARIANTS = {AVOID_STOPPING: "with the released agent's forced-stop fix"}
MP_VARIANTS = {AUXILIARY: "with the paper's second camera, which looks to the left in left turns"}


def _require_variant(agent: str, variants: Mapping[str, str], settings: AgentSettings) -> None:
    """Raises ValueError where settings name a way of driving that an agent does not have."""
    if settings.variant is not None and settings.variant not in variants:
        raise ValueError(
            f"found --variant {settings.variant}, wanted one of {', '.join(variants)} for the agent {agent}: "
            f"type --variant {next(iter(variants))}, or leave it out"
        )


def _make_cil(settings: AgentSettings, dt: float, truth: TruthSource | None) -> Agent:
    from caldrive.agents.conditional_imitation.agent import ImitationAgent, rules_for

    avoid_stopping = settings.variant == AVOID_STOPPING
    return ImitationAgent(model_path(settings.model, "cil"), rules_for(settings.cap), avoid_stopping=avoid_stopping)


def _cil_camera(settings: AgentSettings) -> CameraConfig:
    from caldrive.agents.conditional_imitation.checkpoint import read_imitation_info

    network = read_imitation_info(model_path(settings.model, "cil")).config
    return CameraConfig(width=network.image_width, height=network.image_height)


def _cil_provenance(settings: AgentSettings) -> dict[str, Any]:
    from caldrive.agents.conditional_imitation.checkpoint import read_imitation_info
    from caldrive.perception.inference.precision import driving_precision

    require_taken("the agent cil", ("model", "variant"), settings)
    _require_variant("cil", CIL_VARIANTS, settings)
    path = model_path(settings.model, "cil")
    return {"model": file_digest(path), "precision": driving_precision("auto", read_imitation_info(path).ranges)}


def _make_mp(settings: AgentSettings, dt: float, truth: TruthSource | None) -> Agent:
    from caldrive.agents.modular_pipeline.agent import ModularPipelineAgent
    from caldrive.agents.modular_pipeline.segmenter import NetworkSegmenter

    segmenter = NetworkSegmenter(model_path(settings.model, "mp"))
    return ModularPipelineAgent(
        segmenter, _mp_camera(settings), segmenter.network.config.class_size, dt, settings.cap,
        auxiliary=settings.variant == AUXILIARY,
    )  # fmt: skip


def _mp_camera(settings: AgentSettings) -> CameraConfig:
    from caldrive.agents.modular_pipeline.checkpoint import read_segmentation_info

    network = read_segmentation_info(model_path(settings.model, "mp")).config
    return CameraConfig(width=network.image_width, height=network.image_height)


def _mp_auxiliary(settings: AgentSettings) -> CameraConfig | None:
    from caldrive.agents.modular_pipeline.agent import auxiliary_camera

    return auxiliary_camera(_mp_camera(settings)) if settings.variant == AUXILIARY else None


def _mp_provenance(settings: AgentSettings) -> dict[str, Any]:
    from caldrive.agents.modular_pipeline.checkpoint import read_segmentation_info
    from caldrive.perception.inference.precision import driving_precision

    require_taken("the agent mp", ("model", "variant"), settings)
    _require_variant("mp", MP_VARIANTS, settings)
    path = model_path(settings.model, "mp")
    return {"model": file_digest(path), "precision": driving_precision("auto", read_segmentation_info(path).ranges)}


def _make_rl(settings: AgentSettings, dt: float, truth: TruthSource | None) -> Agent:
    """The agent that drives by a policy; one that sees affordances has CAL's network for them, or the truth."""
    from caldrive.agents.reinforcement.agent import load_agent

    return load_agent(model_path(settings.model, "rl"), lambda: _affordance_source(truth), settings.cap)


def _affordance_source(truth: TruthSource | None) -> Perception:
    from caldrive.agents.cal import OraclePerception
    from caldrive.perception.inference.predictor import NetworkPerception

    return NetworkPerception(model_path(None), threads=1) if truth is None else OraclePerception(truth)


def _rl_camera(settings: AgentSettings) -> CameraConfig:
    from caldrive.agents.reinforcement.agent import policy_camera
    from caldrive.agents.reinforcement.checkpoint import read_policy_info

    info = read_policy_info(model_path(settings.model, "rl"))
    if info.policy.sees == "affordances":
        return cal_camera(AgentSettings())
    return policy_camera(info.encoder.image_size if info.encoder else None)


def _rl_provenance(settings: AgentSettings) -> dict[str, Any]:
    """The policy's, and where it sees by CAL's network that one's, too."""
    from caldrive.agents.reinforcement.checkpoint import read_policy_info
    from caldrive.perception.inference.precision import driving_precision

    require_taken("the agent rl", ("model",), settings)
    path = model_path(settings.model, "rl")
    info, model = read_policy_info(path), file_digest(path)
    if info.policy.sees == "affordances":
        network = cal_provenance(AgentSettings())
        if info.perception not in (None, network["model"]):
            raise ValueError(
                f"found in {path} a policy that learnt from the affordances of network {info.perception}, wanted that "
                f"of {model_path(None)} ({network['model']}): train it with --preset predicted and no --perception"
            )
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


COMPARED_AGENTS: dict[str, AgentEntry] = {
    "cil": AgentEntry(
        make=_make_cil,
        camera=_cil_camera,
        provenance=_cil_provenance,
        variants=CIL_VARIANTS,
    ),
    "mp": AgentEntry(
        make=_make_mp,
        camera=_mp_camera,
        provenance=_mp_provenance,
        variants=MP_VARIANTS,
        auxiliary=_mp_auxiliary,
    ),
    "rl": AgentEntry(make=_make_rl, camera=_rl_camera, provenance=_rl_provenance),
    "rl-oracle": AgentEntry(make=_make_rl, camera=lambda _: None, provenance=_rl_oracle_provenance, privileged=True),
}
