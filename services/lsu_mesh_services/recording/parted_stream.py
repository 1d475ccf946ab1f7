"""The stream of a recorder: into one part of a recording after the other, and beside it to viewers."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import rerun as rr

from lsu_mesh_services.recording.entity_paths import EntityPaths
from lsu_mesh_services.recording.part_files import next_part
from lsu_mesh_services.recording.stream import (
    new_identifier,
    open_file,
    open_server,
    recording_id,
    send_description,
)


class PartedStream:
    """Writes a recording in parts, each of which opens alone: styles and the description of the run are in every one.

    Viewers have a stream of their own, which no new part interrupts.

    Parameters
    ----------
    names, path, described:
        The mesh, a new file, and what the recording tells of the run.
    serve_port:
        Port of the loopback on which viewers may follow; ``None``: no network.
    continues:
        An earlier part of the same recording.

    Raises
    ------
    OSError
        The file exists already or cannot be written.
    """

    def __init__(
        self,
        names: EntityPaths,
        path: Path,
        described: Mapping[str, str],
        serve_port: int | None = None,
        continues: Path | None = None,
    ) -> None:
        self._names = names
        self._first = continues or path
        self._described = described
        self._identifier = (continues and recording_id(continues)) or new_identifier(names.configuration)
        self._style: list[tuple[str, rr.AsComponents]] = []
        self._ending: list[threading.Thread] = []
        self.path = path
        self._file = open_file(names, path, described, self._identifier)
        self._server = None if serve_port is None else open_server(names, self._identifier, serve_port)
        if self._server is not None:
            send_description(self._server, described)

    def log(self, entity: str, archetype: rr.AsComponents, *, static: bool) -> None:
        """Write a style, into this part and every later one."""
        if not static:
            raise ValueError(f"{entity}: rows are sent as columns")
        self._style.append((entity, archetype))
        for stream in self._streams():
            stream.log(entity, archetype, static=True)

    def send_columns(self, entity: str, times: list[rr.TimeColumn], columns: Iterable[rr.ComponentColumn]) -> None:
        """Write rows."""
        for stream in self._streams():
            stream.send_columns(entity, times, columns)

    def flush(self, timeout_sec: float) -> None:
        """Wait until the file has what was written; viewers are not waited for."""
        self._file.flush(timeout_sec=timeout_sec)

    def begin_next(self) -> None:
        """Begin the next part and end this one. Raises ``OSError`` where it cannot be written; this one continues."""
        path = next_part(self._first)
        stream = open_file(self._names, path, self._described, self._identifier)
        for entity, archetype in self._style:
            stream.log(entity, archetype, static=True)
        before, self._file, self.path = self._file, stream, path
        self._ending = [thread for thread in self._ending if thread.is_alive()]
        self._ending.append(_in_background(lambda: _end(before, self._described)))

    def disconnect(self) -> None:
        """End the file, and the streams of viewers."""
        for stream in self._streams():
            stream.disconnect()
        for thread in self._ending:
            thread.join()

    def describe(self) -> None:
        """Write the description of the run again, at the end."""
        send_description(self._file, self._described)

    def _streams(self) -> tuple[rr.RecordingStream, ...]:
        return (self._file,) if self._server is None else (self._file, self._server)


def _end(stream: rr.RecordingStream, described: Mapping[str, str]) -> None:
    send_description(stream, described)
    stream.disconnect()


def _in_background(work: Callable[[], None]) -> threading.Thread:
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    return thread
