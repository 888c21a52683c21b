"""A drive's channels as one MCAP file, which Foxglove, Lichtblick and Rerun open; needs the extra `record`."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from importlib import import_module
from pathlib import Path
from types import TracebackType
from typing import Any

from caldrive.files import temporary_path
from caldrive.visualization.channels import FIELDS, Content, Values

ENDING = ".mcap"
MAGIC = b"\x89MCAP0\r\n"  # at both ends of a file
CHUNK = 1 << 20  # bytes that are compressed together, and are in memory until then


def require_mcap() -> None:
    """Raises RuntimeError where the libraries for MCAP files are not installed."""
    try:
        for name in ("mcap.writer", "mcap_protobuf.schema", "caldrive.visualization.foxglove_messages"):
            import_module(name)
    except ImportError as error:
        raise RuntimeError(
            f"found no {error.name or 'library for MCAP files'}, wanted it for --record: "
            "type pip install 'caldrive[record]'"
        ) from error


class McapFile:
    """A `channels.Writer` of a file. The same messages give the same bytes.

    Use it in a `with` block: the file appears whole at the block's end, and not at all after an error. keeps: whether
    what was written until the disk was full appears nevertheless. Raises RuntimeError where the libraries are missing,
    OSError where the file cannot be written.
    """

    def __init__(self, path: Path, keeps: bool = False) -> None:
        require_mcap()
        self.path, self._keeps = path, keeps
        self._whole, self._is_cut = 0, False  # bytes of whole chunks in the file; whether it ends there
        self._temporary = temporary_path(path)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def write(self, topic: str, time: float, content: Content) -> None:
        """A message of a channel."""
        from caldrive.visualization.foxglove_messages import message, nanoseconds

        with self._cut_where_it_is_full():
            data, now = message(content, time), nanoseconds(time)
            self._add(topic, now, content, data)

    def _add(self, topic: str, now: int, content: Content, data: Any) -> None:
        if topic not in self._channels:
            self._channels[topic] = self._open_channel(topic, type(data), content)
        self._writer.add_message(self._channels[topic], now, data.SerializeToString(deterministic=True), now)
        if self._file.tell() > self._whole:
            self._flush()

    def _flush(self) -> None:
        self._file.flush()
        self._whole = self._file.tell()

    @contextmanager
    def _cut_where_it_is_full(self) -> Iterator[None]:
        try:
            yield
        except OSError as failure:  # it comes without the name
            if self._keeps:
                self._cut()
            raise OSError(failure.errno, failure.strerror, str(self.path)) from failure

    def _cut(self) -> None:
        """Ends the file after its last whole chunk, without an index."""
        from mcap.data_stream import RecordBuilder
        from mcap.records import DataEnd, Footer

        end = RecordBuilder()
        DataEnd(0).write(end)
        Footer(0, 0, 0).write(end)
        self._file.raw.close()  # else the rest would be written now
        with suppress(OSError), self._temporary.open("r+b") as file:  # readers also take a file without an end
            file.truncate(self._whole)
            file.seek(self._whole)
            file.write(end.end() + MAGIC)  # type: ignore[no-untyped-call]
        os.replace(self._temporary, self.path)
        self._is_cut = True

    def _open_channel(self, topic: str, schema: Any, content: Content) -> int:
        """The number of a new channel, whose metadata say the units of its fields."""
        from mcap_protobuf.schema import register_schema

        name = schema.DESCRIPTOR.full_name
        if name not in self._schemas:
            self._schemas[name] = register_schema(self._writer, schema)
        units = FIELDS[content.kind] if isinstance(content, Values) else {}
        number: int = self._writer.register_channel(topic, "protobuf", self._schemas[name], dict(units))
        return number

    def __enter__(self) -> McapFile:
        from mcap.writer import Writer

        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._file = self._temporary.open("wb")
        self._writer: Any = Writer(self._file, chunk_size=CHUNK)
        self._writer.start(library="caldrive")
        self._flush()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        try:
            with closing(self._file), self._cut_where_it_is_full():
                if kind is None and not self._is_cut:
                    self._writer.finish()
                    self._file.flush()
            if kind is None and not self._is_cut:
                os.replace(self._temporary, self.path)
        except OSError as failure:  # from a full disk it comes without the name
            raise OSError(failure.errno, failure.strerror, str(self.path)) from failure
        finally:
            self._temporary.unlink(missing_ok=True)
