"""What a row of the registry is, and the rows of CAL and of the oracle."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from caldrive.agents.settings import AgentSettings
from caldrive.control.presets import make_controller
from caldrive.datatypes import CameraConfig
from caldrive.interfaces import Agent, TruthSource
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
    auxiliary: Callable[[AgentSettings], CameraConfig | None] = lambda _: None
    """The second camera that it wants, None for most."""


def model_path(model: Path | None, agent: str = "cal", option: str = "--model") -> Path:
    """The model asked for by an option, or the package's for an agent. Raises FileNotFoundError where there is none."""
    shipped = MODELS / f"{agent}.safetensors"
    if model is None and not shipped.is_file():
        other = ", or type --agent oracle" if option == "--model" else ""
        raise FileNotFoundError(
            f"found no trained network in this package, wanted one for the agent {agent}: "
            f"make one with `caldrive train --agent {agent}` and give it with {option} FILE{other}"
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


def make_cal(settings: AgentSettings, dt: float, threads: int | None = 1) -> CALAgent:
    """The agent that drives by a network. dt: seconds of a step. threads: how many it may use, None for all cores."""
    from caldrive.agents.cal import CALAgent
    from caldrive.perception.inference.predictor import NetworkPerception

    perception = NetworkPerception(model_path(settings.model), threads=threads)
    return CALAgent(perception, make_controller(settings.controller, settings.cap, dt))


def cal_camera(settings: AgentSettings) -> CameraConfig:
    """The camera of the agent cal. Raises ValueError where its network would take many times as long as it should."""
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


def cal_provenance(settings: AgentSettings) -> dict[str, Any]:
    """What the results of the agent cal depend on. Raises ValueError for settings that it does not take."""
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


OWN_AGENTS: dict[str, AgentEntry] = {
    "cal": AgentEntry(
        make=lambda settings, dt, _: make_cal(settings, dt), camera=cal_camera, provenance=cal_provenance
    ),
    "oracle": AgentEntry(make=_make_oracle, camera=lambda _: None, provenance=_oracle_provenance, privileged=True),
}
