"""The verb that serves the embedded world to CARLA's client."""

from __future__ import annotations

from dataclasses import dataclass

from caldrive.carla_bridge.server.settings import ServerSettings
from caldrive.commands.answer import Answer, Output
from caldrive.progress import Progress


@dataclass(frozen=True, kw_only=True)
class ServeCarla(ServerSettings, Output):
    """Let CARLA's client drive in the embedded world, until Ctrl-C."""

    def run(self, progress: Progress) -> Answer:
        """Serves; answers when it is stopped."""
        try:
            from caldrive.carla_bridge.server.serve import make_server
        except ModuleNotFoundError as error:
            if error.name != "msgpack":
                raise
            raise RuntimeError(
                "found no msgpack, wanted it to speak with CARLA's client: type pip install 'caldrive[serve]'"
            ) from error
        progress(f"loading {self.town}", 0.0)
        server = make_server(self)
        try:
            progress("getting ready to draw", 0.5)
            server.warm_up()
            progress(f"serving {self.town}", 1.0)
            server.log(f"CARLA's client may connect to {self.host}:{self.port} ({self.town}); Ctrl-C ends it")
            server.run()
        finally:
            server.close()
        return Answer({"port": self.port}, "served")
