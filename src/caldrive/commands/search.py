"""The verb that searches for better task blocks."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from caldrive.commands.answer import Answer, Configurable
from caldrive.progress import Progress
from caldrive.search.config import SearchConfig


@dataclass(frozen=True, kw_only=True)
class Search(Configurable):
    """Search for better task blocks, by random trials on a finished backbone (Optuna); a search that was stopped goes
    on."""

    data: Path = Path("out/recording")
    """Folder with the recorded episodes."""
    model: Path | None = None
    """The network whose backbone the blocks learn on, a .safetensors file; without it the one in the package."""
    out: Path = Path("out/search")
    """Folder for the trials, the report, and model.safetensors, the network of the best blocks."""
    workers: int = 2
    """Processes that train at the same time, here or with --ray local; a cluster uses all its processors."""
    ray: str | None = None
    """Train with Ray: local, auto for the cluster that this machine belongs to, or a cluster's address. Its machines
    need a common disk."""
    search: Annotated[SearchConfig, arg(name="")] = field(default=SearchConfig(), metadata={"flat": True})

    def run(self, progress: Progress) -> Answer:
        """Does what is missing; answers with the best blocks."""
        from caldrive.agents.rows import model_path
        from caldrive.commands.tables import search_table
        from caldrive.search.examples import Source
        from caldrive.search.report import result_values, write_report
        from caldrive.search.run import Workers, search

        source = Source(
            data=self.data.absolute(), model=model_path(self.model).absolute(), out=self.out.absolute(),
            validation_share=self.search.validation_share, seed=self.search.seed,
        )  # fmt: skip
        findings = search(self.search, source, Workers(self.workers, self.ray), progress)
        page = write_report(findings, source, self.search)
        return Answer(result_values(findings, page), search_table(findings, page))
