"""Who drives, as the command line, TOML files and Python say it. Apart from the registry, so that --help is quick."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tyro.conf import UseAppendAction


@dataclass(frozen=True, kw_only=True)
class AgentSettings:
    """Who drives."""

    agent: str = "cal"
    """Who drives: cal sees the camera image only, oracle knows the truth; cil imitates; mp segments the image and plans
    by rules; rl learnt by trial and error, rl-oracle drives its policy by the truth; or your own: package.module:Class
    or file.py:Class."""
    model: Path | None = None
    """The network of the agent, a .safetensors file; without it the one in the package, if there is one. Your own class
    may take it, too."""
    variant: str | None = None
    """Another way in which the agent can drive: avoid-stopping for cil, auxiliary-camera for mp."""
    controller: str = "default"
    """default, paper (the laws as printed), a .toml file of constants, package.module:Class or file.py:Class."""
    cap: float | None = None
    """A speed in km/h that no limit exceeds; the paper's comparison drives with 20."""
    blind: UseAppendAction[tuple[str, ...]] = ()
    """An affordance that the driver does not see, such as hazard_stop: it stays at its default. May be given again."""
    truth: UseAppendAction[tuple[str, ...]] = ()
    """An affordance that the driver knows instead of seeing it: who is told so is no longer under test. May be given
    again."""
