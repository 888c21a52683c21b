"""Films episodes: each step becomes a frame of the video."""

from __future__ import annotations

from caldrive.datatypes import Image, Scenario, Step
from caldrive.driving.hud import CAMERA, PANEL, Hud, with_outcome
from caldrive.driving.minimap import MiniMap
from caldrive.driving.referee import Referee
from caldrive.driving.video import VideoWriter
from caldrive.results import EpisodeResult
from caldrive.world.embedded import EmbeddedWorld
from caldrive.world.weather import weather

LAST_FRAMES = 15  # that the outcome stays on the screen


def caption(scenario: Scenario, number: int, of: int) -> str:
    """One line that says where and under which conditions the car drives."""
    sky = weather(scenario.weather)
    town = scenario.town.rsplit("/", 1)[-1]
    count = f"   episode {number} of {of}" if of > 1 else ""
    return f"{town}   {scenario.task}   weather {sky.id} {sky.name}{count}"


class EpisodeFilm:
    """Films one episode in a world, and what its referee counts.

    truth: whether the true affordances are shown beside those the agent goes by.
    """

    def __init__(self, video: VideoWriter, world: EmbeddedWorld, referee: Referee, text: str, truth: bool) -> None:
        self.video, self.world, self.referee, self.text, self.truth = video, world, referee, text, truth
        self._hud: Hud | None = None  # drawn for a route, which is known after the world's reset
        self._last: Image | None = None

    def add(self, step: Step) -> None:
        """Film the world as it stands at a step."""
        if self._hud is None:
            scenario = self.referee.scenario
            minimap = MiniMap(self.world.roads, self.world.route, scenario.goal, PANEL)
            self._hud = Hud(self.text, scenario.time_limit, minimap, self.truth)
        [view] = self.world.images([CAMERA])
        self._last = self._hud.draw(view, step, self.referee.infractions)
        self.video.add(self._last)

    def end(self, result: EpisodeResult) -> None:
        """Hold the last frame, with the outcome across it."""
        if self._last is not None:
            self.video.add(with_outcome(self._last, result), times=LAST_FRAMES)
