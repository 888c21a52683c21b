"""The connection to a CARLA server: its map, its clock, and what is put back when a drive is over.

CARLA answers one client at a time with a step, and keeps what a client leaves behind. So everything of ours carries a
name by which the next connection finds and removes it, even if the process that made it was killed.
"""

from __future__ import annotations

import hashlib
import socket
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from caldrive.carla_bridge.client.library import carla_module
from caldrive.datatypes import DT
from caldrive.files import write_whole
from caldrive.scenarios import TOWNS, generated_town
from caldrive.user_cache import own_folders

OURS = "caldrive"  # the role name of all that is spawned
PATIENCE, LOADING = 20.0, 120.0  # s to wait for an answer, and for a map
FIRST_PATIENCE = 5.0  # s for the first answer of a server, and for a sign of life
SUBSTEPS = 10  # of a step, 0.01 s each, as CARLA's physics wants them
STILL = 1.0  # s without a step, after which nobody steps the server
BEGIN = 1.0  # s of a new server's clock at which driving begins


class Connection:
    """A client of the server at a host and port. carla: the client library; world: CARLA's world.

    Raises RuntimeError where no server of the client's version answers.
    """

    def __init__(self, host: str, port: int) -> None:
        self.carla, self._address = carla_module(), f"{host}:{port}"
        self._before: Any = None  # the settings that it had
        self._spawned: list[Any] = []
        self._manager: Any = None
        with self.answers():
            # One thread hands out all messages: in the order in which they come.
            self.client = self.carla.Client(host, port, 1)
            self.client.set_timeout(FIRST_PATIENCE)
            self._check_version()
            self.client.set_timeout(PATIENCE)
            self.world = self.client.get_world()

    def _check_version(self) -> None:
        wanted, found = self.client.get_client_version(), self.client.get_server_version()
        if _release(wanted) != _release(found):
            raise RuntimeError(
                f"found CARLA {found} at {self._address}, wanted {wanted}, the client's version: start CARLA {wanted}"
            )

    @contextmanager
    def answers(self) -> Iterator[None]:
        """Says in a sentence that the server does not answer. Raises RuntimeError."""
        try:
            yield
        except RuntimeError as error:
            if "time-out" not in str(error) and "rpc::" not in str(error):
                raise
            raise RuntimeError(
                f"found no answer from CARLA at {self._address}, wanted a server there: start it (CarlaUE4.sh, or "
                "caldrive serve-carla), or give another --host and --port"
            ) from error

    def is_alive(self) -> bool:
        """Whether the server still answers."""
        self.client.set_timeout(FIRST_PATIENCE)
        try:
            self.client.get_server_version()
        except RuntimeError:
            return False
        self.client.set_timeout(PATIENCE)
        return True

    @property
    def map_name(self) -> str:
        """The map's, without its folder: Town01."""
        return str(self.world.get_map().name.rpartition("/")[2])

    def map_names(self) -> list[str]:
        """Those that the server has."""
        with self.answers():
            return sorted({path.rpartition("/")[2] for path in self.client.get_available_maps()})

    def load_map(self, name: str) -> None:
        """Loads a map, if it is not there already. Raises ValueError where the server has none of this name."""
        with self.answers():
            if self.map_name == name:
                return
            names = self.map_names()
            if name not in names and generated_town(name) is None:
                raise ValueError(
                    f"found no map {name!r} on the server, wanted one of {', '.join(names)}: give another --town"
                )
            self._end_manager()  # it knows the old map
            self.client.set_timeout(LOADING)
            self.world = self.client.load_world(name, False)
            self.client.set_timeout(PATIENCE)

    def town_of(self, town: str) -> str:
        """Loads the map of a scenario's town and returns the town as `load_town` takes it: caldrive's own by name, an
        OpenDRIVE file by its path, and another from the OpenDRIVE that the server gives. Raises ValueError as above."""
        self.load_map(Path(town).stem if town.endswith(".xodr") else town)
        if town in TOWNS or generated_town(town) or town.endswith(".xodr"):
            return town
        return str(self.map_file())

    def map_file(self) -> Path:
        """The map as an OpenDRIVE file, kept in the user's cache. Raises RuntimeError where there is no room."""
        with self.answers():
            content = self.world.get_map().to_opendrive().encode()
        name = Path("carla", hashlib.sha256(content).hexdigest()[:16], f"{self.map_name}.xodr")
        for folder in own_folders():
            with suppress(OSError):  # full, read-only, a file in the way: the next one may do
                if not (folder / name).is_file():
                    write_whole(folder / name, content)
                return folder / name
        raise RuntimeError("found no folder to keep the map in, wanted one: set XDG_CACHE_HOME to a folder of yours")

    def synchronise(self) -> int:
        """Lets the server step when it is told to, from now on, and removes what an earlier drive left; returns how
        many actors that were. Raises RuntimeError where another client steps it."""
        if self._before is not None:
            return 0
        with self.answers():
            was_left_waiting = self._waits_for_a_client()
            self._before, settings = self.world.get_settings(), self.world.get_settings()
            settings.synchronous_mode, settings.fixed_delta_seconds = True, DT
            settings.no_rendering_mode = False  # else cameras say nothing
            settings.max_substeps, settings.max_substep_delta_time = SUBSTEPS, DT / SUBSTEPS
            self.world.apply_settings(settings)
            self.tick()  # before it a server that a killed process left waiting shows nobody
            if was_left_waiting:  # a process that was killed cannot put that back
                self._before.synchronous_mode, self._before.fixed_delta_seconds = False, None
            if left := self.left_behind():
                self._remove(left)
                self.tick()
            while self.time < BEGIN:  # the client asks for some steps of its own, and not always as many
                self.tick()
            return len(left)

    def _waits_for_a_client(self) -> bool:
        """Whether the server is in synchronous mode, and nobody steps it. Raises RuntimeError where somebody does."""
        if not self.world.get_settings().synchronous_mode:
            return False
        frames = []
        for _ in range(2):
            time.sleep(STILL)  # the first time until the latest frame has come
            frames.append(self.world.get_snapshot().frame)
        if frames[0] != frames[1]:
            raise RuntimeError(
                f"found another client that steps CARLA at {self._address}, wanted it alone: end that program, or give "
                "another server's --port"
            )
        return True

    def left_behind(self) -> list[int]:
        """The numbers of what is there under our name, of this connection or of a process that was killed."""
        return [one.id for one in self.world.get_actors() if one.attributes.get("role_name") == OURS]

    @property
    def time(self) -> float:
        """s of the server's clock."""
        return float(self.world.get_snapshot().timestamp.elapsed_seconds)

    def tick(self) -> int:
        """A step of the world; returns its frame."""
        with self.answers():
            return int(self.world.tick(PATIENCE))

    def blueprint(self, name: str, **attributes: Any) -> Any:
        """What an actor of ours is made from."""
        found = self.world.get_blueprint_library().find(name)
        for key, value in {"role_name": OURS, **attributes}.items():
            if found.has_attribute(key):
                found.set_attribute(key, str(value))
        return found

    def spawn(self, blueprint: Any, place: Any, carrier: Any = None) -> Any:
        """An actor at a transform of CARLA's, relative to a carrier's where there is one; None where there is no
        room."""
        actor = self.world.try_spawn_actor(blueprint, place, carrier)
        if actor is not None:
            self._spawned.append(actor)
        return actor

    def traffic_manager(self, seed: int) -> Any:
        """CARLA's traffic manager, which steps with the world and draws from a seed."""
        if self._manager is None:
            with socket.socket() as probe:  # another client may have the usual port
                probe.bind(("", 0))
                port = probe.getsockname()[1]
            self._manager = self.client.get_trafficmanager(port)
            self._manager.set_synchronous_mode(True)
        self._manager.set_random_device_seed(seed)
        return self._manager

    def clear(self) -> None:
        """Removes all that was spawned, the last first."""
        spawned, self._spawned = self._spawned[::-1], []
        for actor in spawned:
            if getattr(actor, "is_listening", False):
                actor.stop()
        self._remove([actor.id for actor in spawned])
        if spawned:
            self.tick()  # until then they are still counted

    def _remove(self, ids: Sequence[int]) -> None:
        if ids:
            self.client.apply_batch_sync([self.carla.command.DestroyActor(id) for id in ids], False)

    def _end_manager(self) -> None:
        manager, self._manager = self._manager, None
        if manager is not None:
            manager.set_synchronous_mode(False)
            manager.shut_down()

    def close(self) -> None:
        """Removes all that was spawned and puts the settings back, if the server still hears it."""
        for work in (self.clear, self._end_manager, self._put_back) if self.is_alive() else ():
            with suppress(RuntimeError):  # it has gone meanwhile, and all with it
                work()

    @property
    def has_manager(self) -> bool:
        """Whether CARLA's traffic manager drives cars through it."""
        return self._manager is not None

    def _put_back(self) -> None:
        if self._before is not None:
            self.world.apply_settings(self._before)


def served_town(host: str, port: int, town: str) -> str:
    """The town to plan routes in for a server: caldrive's own where it serves those, else the OpenDRIVE file of its map
    of this name, as Town01 is for town01. Raises ValueError where it has none, RuntimeError where no server answers."""
    if town.endswith(".xodr") or generated_town(town):
        return town
    connection = Connection(host, port)
    try:
        names = connection.map_names()
        if town in TOWNS and town in names:
            return town
        return connection.town_of(next((name for name in names if name.lower() == town.lower()), town))
    finally:
        connection.close()


def _release(version: str) -> list[str]:
    """0.9.16 of 0.9.16-dirty."""
    return version.replace("-", ".").split(".")[:3]
