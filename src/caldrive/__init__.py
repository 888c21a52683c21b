"""caldrive: Conditional Affordance Learning for urban driving.

One loop drives. A world shows an image, an agent turns it into six affordances and those into a control,
the world moves on, and a referee who knows the truth writes down how it went:

    from caldrive import CALAgent, CALController, OraclePerception, make_world, run_episode, task_scenarios

    world = make_world()                                       # make_world(camera=CameraConfig()) for images
    agent = CALAgent(OraclePerception(world.truth), CALController())
    for scenario in task_scenarios("town01", "navigation-dynamic"):
        print(run_episode(world, agent, scenario).outcome)

`rollout` is the same loop step by step; `python -m caldrive --help` drives, films and measures from the command line.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # what editors and type checkers read; tests/test_public_names.py holds it to _HOMES
    from caldrive.agents.cal import CALAgent as CALAgent
    from caldrive.agents.cal import OraclePerception as OraclePerception
    from caldrive.control.controller import CALController as CALController
    from caldrive.control.controller import ControlConfig as ControlConfig
    from caldrive.datatypes import Affordances as Affordances
    from caldrive.datatypes import CameraConfig as CameraConfig
    from caldrive.datatypes import Command as Command
    from caldrive.datatypes import Control as Control
    from caldrive.datatypes import Decision as Decision
    from caldrive.datatypes import Observation as Observation
    from caldrive.datatypes import Pose as Pose
    from caldrive.datatypes import Step as Step
    from caldrive.datatypes import Truth as Truth
    from caldrive.driving.drive import drive as drive
    from caldrive.driving.referee import Referee as Referee
    from caldrive.driving.rollout import rollout as rollout
    from caldrive.driving.rollout import run_episode as run_episode
    from caldrive.driving.settings import DriveSettings as DriveSettings
    from caldrive.driving.setup import make_world as make_world
    from caldrive.driving.tasks import task_scenarios as task_scenarios
    from caldrive.interfaces import Agent as Agent
    from caldrive.interfaces import Controller as Controller
    from caldrive.interfaces import Perception as Perception
    from caldrive.interfaces import World as World
    from caldrive.perception.inference.predictor import NetworkPerception as NetworkPerception
    from caldrive.results import EpisodeResult as EpisodeResult
    from caldrive.results import Outcome as Outcome
    from caldrive.scenarios import Scenario as Scenario

__version__ = "0.1.0"

# Loaded when first asked for, so that `caldrive --help` waits for neither torch nor SUMO.
_HOMES = {
    "caldrive.agents.cal": ("CALAgent", "OraclePerception"),
    "caldrive.control.controller": ("CALController", "ControlConfig"),
    "caldrive.datatypes": (
        *("Affordances", "CameraConfig", "Command", "Control", "Decision", "Observation"),
        *("Pose", "Step", "Truth"),
    ),
    "caldrive.driving.drive": ("drive",),
    "caldrive.driving.referee": ("Referee",),
    "caldrive.driving.rollout": ("rollout", "run_episode"),
    "caldrive.driving.settings": ("DriveSettings",),
    "caldrive.driving.setup": ("make_world",),
    "caldrive.driving.tasks": ("task_scenarios",),
    "caldrive.interfaces": ("Agent", "Controller", "Perception", "World"),
    "caldrive.perception.inference.predictor": ("NetworkPerception",),
    "caldrive.results": ("EpisodeResult", "Outcome"),
    "caldrive.scenarios": ("Scenario",),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}

if not TYPE_CHECKING:  # a type checker takes the names from the imports above, and so knows their types
    __all__ = ["__version__", *_HOME]

    def __getattr__(name: str) -> Any:
        """A public name, from the module that it lives in."""
        if name not in _HOME:
            raise AttributeError(f"caldrive has no {name!r}; it has {', '.join(sorted(_HOME))}")
        value = getattr(import_module(_HOME[name]), name)
        globals()[name] = value
        return value
