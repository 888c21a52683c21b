"""The verbs that explain: whom to blame for a benchmark's failures, and where the network looks."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import tyro
from tyro.conf import UseAppendAction

from caldrive.commands.answer import Answer, Configurable, Output
from caldrive.driving.settings import EpisodeSettings, PictureSettings
from caldrive.progress import Progress

if TYPE_CHECKING:  # it loads numpy, for which --help does not wait
    from caldrive.scenarios import Scenario


@dataclass(frozen=True, kw_only=True)
class Blame(Output):
    """Drive a benchmark's failures again with affordances replaced by the truth: which of them is to blame."""

    folder: tyro.conf.Positional[Path]
    """A benchmark's folder."""
    out: Path | None = None
    """Folder for what is driven; without it `blame` in the benchmark's folder, where caldrive report finds it."""
    workers: int = 2
    """Processes that drive at the same time, here or with --ray local; a cluster uses all its processors."""
    ray: str | None = None
    """Drive with Ray: local, auto for the cluster that this machine belongs to, or a cluster's address."""

    def run(self, progress: Progress) -> Answer:
        """Drives what is missing; answers with how many failures each affordance is to blame for."""
        from caldrive.commands.explain_tables import blame_table
        from caldrive.explain.blame import FOLDER, blame

        found, run = blame(self.folder, self.out or self.folder / FOLDER, self.workers, self.ray, progress)
        values = asdict(found) | {
            "episodes": len(run.results), "rest": found.rest, "blame": {key: found.of(key) for key in found.failures},
            "shares": found.shares(),
        }  # fmt: skip
        return Answer(values, blame_table(found, run.name, len(run.results)))


@dataclass(frozen=True, kw_only=True)
class AttentionSettings:
    """What attention is drawn of."""

    affordance: UseAppendAction[tuple[str, ...]] = ()
    """An affordance to draw the attention of, or one of its classes, such as speed_sign=60; may be given again. Without
    it hazard_stop and red_light."""
    method: Literal["hirescam", "gradcam"] = "hirescam"
    """hirescam: what counted at each place, of 8 x 8 pixels; gradcam: as in the paper, of 16 x 16."""

    @property
    def affordances(self) -> tuple[str, ...]:
        """Those that are drawn."""
        return self.affordance or ("hazard_stop", "red_light")


@dataclass(frozen=True, kw_only=True)
class ExplainDrive(AttentionSettings, EpisodeSettings, Configurable):
    """Drive an episode, and film where the network looks, whoever drives."""

    out: Path = Path("out/attention.mp4")
    """The video."""

    def run(self, progress: Progress) -> Answer:
        """Drives; answers with the video."""
        from caldrive.explain.attention_video import drive_attention

        frames = drive_attention(self, self.affordances, self.method, self.out, progress)
        return Answer({"video": str(self.out), "frames": frames}, f"attention in {frames} frames: {self.out}")


@dataclass(frozen=True, kw_only=True)
class ExplainPictures(AttentionSettings, PictureSettings, Output):
    """Film where the network looks in your own video or pictures, or draw it in one."""

    out: Path = Path("out/attention.mp4")
    """The video; or a .png file, a still of the last picture, beside it as it is."""

    def run(self, progress: Progress) -> Answer:
        """Looks at the pictures; answers with the video or the still."""
        from caldrive.explain.attention_still import ENDING, draw_still
        from caldrive.explain.attention_video import see_attention

        if self.out.suffix.lower() == ENDING:
            draw_still(self, self.affordances, self.method)
            return Answer({"still": str(self.out)}, f"attention in the last picture: {self.out}")

        frames = see_attention(self, self.affordances, self.method, progress)
        return Answer({"video": str(self.out), "frames": frames}, f"attention in {frames} pictures: {self.out}")


@dataclass(frozen=True, kw_only=True)
class ExplainRecording(Output):
    """Where the network looks in frames of a recording in which it matters, and how true that is, in numbers."""

    folder: tyro.conf.Positional[Path] = Path("out/recording")
    """Folder with the recorded episodes."""
    model: Path | None = None
    """The network, a .safetensors file; without it the one in the package."""
    held_out: bool = False
    """Only those episodes that training on this folder kept for validation."""
    examples: int = 4
    """Frames of each situation on the sheet."""
    measured: int = 0
    """Frames of each situation that are measured, which takes several seconds each; 0 measures none."""
    method: Literal["hirescam", "gradcam"] = "hirescam"
    """hirescam: what counted at each place, of 8 x 8 pixels; gradcam: as in the paper, of 16 x 16."""
    seed: int = 0
    """Decides which frames."""
    out: Path = Path("out/attention.png")
    """The sheet, a PNG file."""

    def run(self, progress: Progress) -> Answer:
        """Draws the sheet; answers with the figures."""
        from caldrive.agents.rows import model_path
        from caldrive.checks import require_within, require_writable_file
        from caldrive.commands.explain_tables import attention_table
        from caldrive.explain.recorded import contact_sheet, figures
        from caldrive.explain.situations import find_examples
        from caldrive.files import write_whole
        from caldrive.perception.network.checkpoint import load_network

        require_writable_file(self.out, "--out", ".png")
        require_within("--examples", self.examples, 1, 100, 4)
        require_within("--measured", self.measured, 0, 10_000, 20)
        network, info = load_network(model_path(self.model))
        keys = info.data.get("validation_episodes", []) if self.held_out else None
        wanted = max(self.examples, self.measured)
        found = find_examples(self.folder, wanted, network.span - 1, self.seed, keys)
        shown = {name: chosen[: self.examples] for name, chosen in found.items()}
        write_whole(self.out, contact_sheet(network, shown, self.method))
        measured = {name: chosen[: self.measured] for name, chosen in found.items()}
        results = figures(network, measured, self.method, self.seed, progress) if self.measured else []
        values = {"out": str(self.out), "figures": [asdict(one) for one in results]}
        return Answer(values, attention_table(results, self.out))


@dataclass(frozen=True, kw_only=True)
class ExplainCounterfactuals(Output):
    """Change one thing in what the oracle's drives show (a lamp, a person, a car, a sign, the road's outlines) and see
    the prediction change; and test the paper's three observations on attention."""

    town: str = "town01"
    """town01, town02, random:SEED, random-wide:SEED or an OpenDRIVE file."""
    weather: UseAppendAction[tuple[int, ...]] = ()
    """One of CARLA's weathers, 1 to 14; may be given again. Without it those of the training: 1, 3, 6 and 8."""
    episodes: int = 20
    """Episodes to drive, in these weathers in turn."""
    cases: int = 40
    """About so many moments of each situation: of each episode its share, rounded up."""
    cars: int | None = None
    """Other cars; without it what the benchmark's dynamic task prescribes."""
    people: int | None = None
    """Pedestrians; likewise."""
    seconds: float | None = None
    """Ends every episode after so many simulated seconds."""
    seed: int = 0
    """Decides everything random."""
    model: Path | None = None
    """The network, a .safetensors file; without it the one in the package."""
    method: Literal["hirescam", "gradcam"] = "hirescam"
    """hirescam: what counted at each place, of 8 x 8 pixels; gradcam: as in the paper, of 16 x 16."""
    workers: int = 2
    """Episodes that are driven at the same time."""
    out: Path = Path("out/counterfactuals")
    """Folder for what is found in each episode, and the sheet of examples, sheet.png."""

    def run(self, progress: Progress) -> Answer:
        """Drives and changes; answers with the effects and the verdicts."""
        from caldrive.agents.rows import model_path
        from caldrive.checks import require_within
        from caldrive.commands.explain_tables import study_table
        from caldrive.explain.activation_maps import require_captum
        from caldrive.explain.counterfactual_episode import StudyConfig
        from caldrive.explain.counterfactual_study import study
        from caldrive.perception.network.checkpoint import read_info
        from caldrive.provenance import code_version

        require_within("--cases", self.cases, 1, 1000, 40)
        require_captum()  # before the drive, not after it
        path = model_path(self.model)
        read_info(path)  # likewise: whether it is a network
        config = StudyConfig(path, tuple(self.scenarios()), self.cases, self.method, self.seed)
        found = study(config, self.out, self.workers, progress)
        values = {
            "code": code_version(), "sheet": str(found.sheet), "found": found.found,
            "effects": [asdict(one) for one in found.effects],
            "observations": [asdict(one) | {"verdict": one.verdict} for one in found.findings],
            "at_the_wheel": asdict(found.gap),
        }  # fmt: skip
        return Answer(values, study_table(found))

    def scenarios(self) -> list[Scenario]:
        """What is driven: the dynamic task's routes in turn. Raises ValueError for numbers that cannot be."""
        from caldrive.benchmark.suites import TRAINING_WEATHERS
        from caldrive.checks import require_within
        from caldrive.driving.choice import chosen_scenarios

        weathers = self.weather or TRAINING_WEATHERS
        for weather in weathers:
            require_within("--weather", weather, 1, 14, 1)
        require_within("--episodes", self.episodes, 1, 1000, 20)
        settings = EpisodeSettings(
            town=self.town, task="navigation-dynamic", cars=self.cars, people=self.people, seconds=self.seconds,
            seed=self.seed,
        )  # fmt: skip
        routes = chosen_scenarios(settings, self.episodes)
        return [
            replace(scenario, weather=weathers[k % len(weathers)], seed=self.seed + k)
            for k, scenario in enumerate(routes)
        ]
