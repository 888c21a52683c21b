"""The verb that looks at a CARLA server before anybody drives there."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from caldrive.commands.answer import Answer, Output
from caldrive.progress import Progress


@dataclass(frozen=True, kw_only=True)
class CheckCarla(Output):
    """Look at a CARLA server that runs: whether all is as caldrive understands it."""

    host: str = "127.0.0.1"
    """The machine where CARLA runs."""
    port: int = 2000
    """Its port."""

    def run(self, progress: Progress) -> Answer:
        """Looks; answers with a row for each thing, and 1 where one is not as it should be."""
        from caldrive.carla_bridge.client.checklist import LOOKS, checklist
        from caldrive.commands.tables import checks_table

        checks = []
        for check in checklist(self.host, self.port):
            checks.append(check)
            progress(check.what, len(checks) / (len(LOOKS) + 3))
        rows = [asdict(check) for check in checks]
        return Answer({"checks": rows}, checks_table(checks), int(not all(check.ok for check in checks)))
