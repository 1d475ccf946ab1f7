"""Bags of ROS 2: their topics, and the messages of one as rows of numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

from lsu_mesh.mesh.config.problem import nearest
from lsu_mesh.mesh.ros2.decoder import Decoder, UnfitMessage, has_header
from lsu_mesh.mesh.ros2.fields import NoSuchField, check_path, numbers_of

EXPECTED = "a file .mcap or .db3, or the folder of a rosbag2"
MAX_FIELDS = 200
"""Fields that are listed of a type."""


class BagError(Exception):
    """A bag cannot be read, or does not hold what is asked for; the message is a whole sentence."""


class Topic(NamedTuple):
    """A topic of a bag."""

    name: str
    type: str
    messages: int


class Row(NamedTuple):
    """A message: its time in nanoseconds, and its fields, None where there is no value."""

    time_ns: int
    values: list[float | None]


class Bag:
    """A bag that is open; use it as a context manager."""

    def __init__(self, path: Path) -> None:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore

        self._path = path
        self.refused: dict[str, int] = {}
        """Messages that were left out, by reason."""
        self.last_refusal = ""
        if path.is_file() and path.suffix not in (".mcap", ".db3"):
            raise BagError(f"{path}: is no bag; expected {EXPECTED}")
        self._reader: Any = _tried(path, lambda: AnyReader([path], default_typestore=get_typestore(Stores.LATEST)))

    def __enter__(self) -> Self:
        _tried(self._path, self._reader.open)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._reader.close()

    def topics(self) -> list[Topic]:
        """All topics by name."""
        found: dict[tuple[str, str], int] = {}
        for one in self._reader.connections:
            key = (one.topic, one.msgtype)
            found[key] = found.get(key, 0) + one.msgcount
        return [Topic(name, type_name, count) for (name, type_name), count in sorted(found.items())]

    def topic(self, name: str) -> Topic:
        """The topic of a name; raises :class:`BagError` with the nearest."""
        found = [one for one in self.topics() if one.name in (name, f"/{name}")]
        if not found:
            names = [one.name for one in self.topics()]
            raise BagError(f"{self._path}: has no topic {name}; {nearest(name, names)}")
        if len(found) > 1:
            types = ", ".join(one.type for one in found)
            raise BagError(f"{self._path}: {name} has messages of several types, {types}; record them again apart")
        return found[0]

    def fields(self, topic: Topic) -> list[str]:
        """Paths to the numbers of a type, those in lists as ``[0]``, at most :data:`MAX_FIELDS`."""
        return numbers_of(self._reader.typestore, topic.type)[:MAX_FIELDS]

    def has_header(self, topic: Topic) -> bool:
        """Whether its messages tell their time."""
        return has_header(self._reader.typestore, topic.type)

    def rows(self, topic: Topic, fields: Sequence[str], *, stamped: bool) -> Iterator[Row]:
        """The messages in the order of the bag; raises :class:`BagError` where a field is none of the type's."""
        store = self._reader.typestore
        for field in fields:
            try:
                check_path(store, topic.type, field)
            except NoSuchField as error:
                hint = f"; {nearest(error.name, error.known)}" if error.known else ""
                raise BagError(f"{self._path}: {error}{hint}") from None
        return self._read(topic, Decoder(store, topic.type, tuple(fields), stamped=stamped))

    def _read(self, topic: Topic, decoder: Decoder) -> Iterator[Row]:
        chosen = [one for one in self._reader.connections if one.topic == topic.name]
        messages = _tried(self._path, lambda: self._reader.messages(connections=chosen))
        while (found := _tried(self._path, lambda: next(messages, None))) is not None:
            _, received_ns, data = found
            try:
                reading = decoder.decode(data)
            except UnfitMessage as unfit:
                self.refused[unfit.reason] = self.refused.get(unfit.reason, 0) + 1
                self.last_refusal = str(unfit)
                continue
            yield Row(received_ns if reading.time_ns is None else reading.time_ns, reading.y)


def _tried(path: Path, work: Callable[[], Any]) -> Any:
    """What ``work`` returns; whatever is wrong with the bag is raised as :class:`BagError`."""
    try:
        return work()
    except FileNotFoundError as error:
        missing = "there is no such bag" if not path.exists() else f"is not whole: {error}"
        raise BagError(f"{path}: {missing}; expected {EXPECTED}") from None
    except Exception as error:  # the readers of three formats and their compressions raise what they like
        raise BagError(f"{path}: cannot be read: {error or type(error).__name__}; expected {EXPECTED}") from None
