"""A driver with other senses: blind to an affordance, which is then held at its default, or told the truth of it.

What a blind driver hits says what the affordance is worth, and whether a town punishes inattention; whether one who is
told the truth still fails says which affordance was to blame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from caldrive.affordances import BY_NAME
from caldrive.datatypes import Affordances, Observation
from caldrive.interfaces import Agent, Perception, TruthSource

DEFAULTS = Affordances()  # nobody ahead, no light, no sign, straight on in the middle of the lane


class OtherSenses:
    """A perception that does not see some affordances and knows the truth of others (`interfaces.Perception`).

    truth_source: gives the truth of the present step; needed for `truth` alone.
    """

    def __init__(
        self,
        perception: Perception,
        blind: Sequence[str] = (),
        truth: Sequence[str] = (),
        truth_source: TruthSource | None = None,
    ) -> None:
        self.perception, self.truth, self.truth_source = perception, tuple(truth), truth_source
        self._unseen = {name: getattr(DEFAULTS, name) for name in blind}

    def reset(self) -> None:
        """Start an episode."""
        self.perception.reset()

    def predict(self, observation: Observation) -> Affordances:
        """What the perception sees, but for these. One that is told all need not look."""
        known = dict[str, Any]()
        if self.truth:
            assert self.truth_source is not None
            true = self.truth_source().affordances
            known = {name: getattr(true, name) for name in self.truth}
        seen = DEFAULTS if known.keys() == BY_NAME.keys() else self.perception.predict(observation)
        return replace(seen, **(known | self._unseen))


def with_senses(
    agent: Agent, blind: Sequence[str] = (), truth: Sequence[str] = (), truth_source: TruthSource | None = None
) -> Agent:
    """The agent, which from now on does not see the affordances `blind`, and knows those of `truth`.

    Raises ValueError for an affordance that there is not or that is in both, and for an agent without an attribute
    `perception` (`interfaces.Perception`).
    """
    require_senses(blind, truth)
    if not blind and not truth:
        return agent
    if not has_perception(agent):
        option, word = ("--blind", "be blind") if blind else ("--truth", "be told the truth")
        raise ValueError(
            f"found that {type(agent).__name__} has no perception that could {word}, wanted an attribute "
            f"`perception` with a method predict: add it, or leave {option} out"
        )
    changeable: Any = agent
    changeable.perception = OtherSenses(changeable.perception, blind, truth, truth_source)
    return agent


def has_perception(agent: Agent) -> bool:
    """Whether an agent has an attribute `perception` (`interfaces.Perception`), and so affordances."""
    return callable(getattr(getattr(agent, "perception", None), "predict", None))


def require_senses(blind: Sequence[str], truth: Sequence[str] = ()) -> None:
    """Raises ValueError for an affordance that there is not, and for one that is both unseen and known."""
    for option, names in (("--blind", blind), ("--truth", truth)):
        if unknown := [name for name in names if name not in BY_NAME]:
            raise ValueError(
                f"found affordance {unknown[0]!r}, wanted one of {', '.join(BY_NAME)}: type {option} hazard_stop"
            )
    if both := sorted({*blind} & {*truth}):
        raise ValueError(f"found {both[0]} in --blind and in --truth, wanted it in one of them: leave one out")
