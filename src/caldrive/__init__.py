"""caldrive: Conditional Affordance Learning for urban driving.

One loop carries everything. A world shows an image, an agent turns it into six affordances and those into a control,
the world moves on, and a referee who knows the truth writes down how it went:

    from caldrive import CALAgent, CALController, EmbeddedWorld, OraclePerception, run_episode, scenarios

    world = EmbeddedWorld()                                    # EmbeddedWorld(CameraConfig()) for images
    agent = CALAgent(OraclePerception(world.truth), CALController())
    for scenario in scenarios("town01", "navigation-dynamic"):
        print(run_episode(world, agent, scenario).outcome)

`rollout` is the same loop step by step; `python -m caldrive --help` drives, films and measures from the command line.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

# Loaded when first asked for, so that `caldrive --help` waits for neither torch nor SUMO.
_HOMES = {
    "caldrive.agents.cal": ("CALAgent", "OraclePerception"),
    "caldrive.control.controller": ("ControlConfig", "CALController"),
    "caldrive.datatypes": (
        *("Affordances", "CameraConfig", "Command", "Control", "Decision", "Observation"),
        *("Pose", "Step", "Truth"),
    ),
    "caldrive.driving.drive": ("drive",),
    "caldrive.driving.referee": ("Referee",),
    "caldrive.driving.rollout": ("rollout", "run_episode"),
    "caldrive.driving.settings": ("DriveSettings",),
    "caldrive.driving.tasks": ("scenarios",),
    "caldrive.perception.inference.predictor": ("NetworkPerception",),
    "caldrive.results": ("EpisodeResult", "Outcome"),
    "caldrive.scenarios": ("Scenario",),
    "caldrive.world.embedded": ("EmbeddedWorld",),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}
__all__ = ["__version__", *_HOME]


def __getattr__(name: str) -> Any:
    """A public name, from the module that it lives in."""
    if name not in _HOME:
        raise AttributeError(f"caldrive has no {name!r}; it has {', '.join(sorted(_HOME))}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value
