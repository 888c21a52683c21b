"""What is changed in a picture, one thing at a time, and controls that change what is of no concern."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from caldrive.datatypes import SPEED_SIGNS, CameraConfig, Image, LightState
from caldrive.explain.cases import Case
from caldrive.world.rendering.camera import CameraRig, SceneState
from caldrive.world.rendering.repainting import Repainting, sign_with, without_center_lines, without_outlines
from caldrive.world.scene.people import Shown
from caldrive.world.town import Town

SceneEdit = Callable[[Town, SceneState, str], SceneState]  # of a scene, by the id of the thing that is changed


def _unchanged(town: Town, state: SceneState, id: str) -> SceneState:
    return state


def _post(town: Town, id: str) -> list[str]:
    """The ids of all lights on the post of a light: one post stands for all lanes of an approach."""
    foot = next(post.stands_at for post in town.roads.posts if post.id == id)
    return [post.id for post in town.roads.posts if post.stands_at == foot]


def _lamp(shown: LightState) -> SceneEdit:
    def change(town: Town, state: SceneState, id: str) -> SceneState:
        return replace(state, lights={**state.lights, **dict.fromkeys(_post(town, id), shown)})

    return change


def _other_color(town: Town, state: SceneState, id: str) -> SceneState:
    is_green = state.lights[id] is LightState.GREEN
    return _lamp(LightState.RED if is_green else LightState.GREEN)(town, state, id)


def _without_person(town: Town, state: SceneState, id: str) -> SceneState:
    return replace(state, pedestrians=[person for person in state.pedestrians if person.id != id])


def _without_car(town: Town, state: SceneState, id: str) -> SceneState:
    return replace(state, vehicles=[car for car in state.vehicles if car.id != id])


def _only(part: Shown) -> SceneEdit:
    return lambda town, state, id: replace(state, shown={**state.shown, id: part})


def _other_number(town: Town, id: str) -> Repainting:
    """30 becomes 60, 60 becomes 90, and 90 becomes 30."""
    sign = town.signs[int(id)]
    return sign_with(sign.stands_at, SPEED_SIGNS[(SPEED_SIGNS.index(sign.limit) + 1) % len(SPEED_SIGNS)])


@dataclass(frozen=True)
class Intervention:
    """One thing that is changed."""

    situation: str
    """By its name."""
    name: str
    edit: SceneEdit = _unchanged
    """Of what moves or shines, in each frame."""
    paint: Callable[[Town, str], Repainting] | None = None
    """Of what stands still."""
    control: bool = False
    """Whether it changes what is of no concern, and so should change nothing for the network."""
    of_other: bool = False
    """Whether it is done to a thing of the same kind that is of no concern."""

    @property
    def key(self) -> str:
        """Tells it from all others."""
        return f"{self.situation}: {self.name}"

    def thing(self, case: Case) -> str | None:
        """The id of what is changed, None where a case has no such thing."""
        return case.other if self.of_other else case.subject

    def pictures(self, rig: CameraRig, case: Case, camera: CameraConfig, frames: Sequence[int]) -> list[Image]:
        """Some frames of a case, by their numbers, drawn again with the change. Raises ValueError where the case has
        nothing to change."""
        thing = self.thing(case)
        if thing is None:
            raise ValueError(f"found no other thing at a {case.situation.name}, wanted one: leave this control out")
        painted = rig if self.paint is None else rig.repainted(self.paint(rig.town, thing))
        states = [self.edit(rig.town, case.states[frame], thing) for frame in frames]
        return [painted.render(state, [camera])[0] for state in states]


def _control(situation: str, name: str, change: SceneEdit) -> Intervention:
    """Something done to what is of no concern."""
    return Intervention(situation, name, change, control=True, of_other=True)


UNCHANGED = Intervention("", "as it was")
AWAY, NO_SHADOW, ONLY_SHADOW = "the person is away", "the shadow is away", "only the shadow is there"
ONLY_LEGS, ONLY_TORSO, NO_OUTLINES = "only the legs are there", "only the torso is there", "the road has no outlines"
INTERVENTIONS = (
    Intervention("red light", "the lamp is green", _lamp(LightState.GREEN)),
    Intervention("red light", NO_OUTLINES, paint=lambda town, id: without_outlines()),
    Intervention(
        "red light", "the road has no centre line", paint=lambda town, id: without_center_lines(), control=True
    ),
    _control("red light", "another lamp has the other colour", _other_color),
    Intervention("green light", "the lamp is red", _lamp(LightState.RED)),
    _control("green light", "another lamp has the other colour", _other_color),
    Intervention("hazard by a person", AWAY, _without_person),
    Intervention("hazard by a person", NO_SHADOW, _only(Shown.LEGS | Shown.TORSO)),
    Intervention("hazard by a person", ONLY_SHADOW, _only(Shown.SHADOW)),
    Intervention("hazard by a person", ONLY_LEGS, _only(Shown.LEGS)),
    Intervention("hazard by a person", ONLY_TORSO, _only(Shown.TORSO)),
    _control("hazard by a person", "another person is away", _without_person),
    Intervention("hazard by a car", "the car is away", _without_car),
    _control("hazard by a car", "another car is away", _without_car),
    Intervention("car ahead", "the car is away", _without_car),
    _control("car ahead", "another car is away", _without_car),
    Intervention("speed sign", "the sign has the next number", paint=_other_number),
    Intervention("shadow of a person out of view", NO_SHADOW, _only(Shown.LEGS | Shown.TORSO)),
)


def interventions_in(case: Case) -> list[Intervention]:
    """All that can be done to a case."""
    mine = [one for one in INTERVENTIONS if one.situation == case.situation.name]
    return [one for one in mine if one.thing(case) is not None]
