"""Messages as numbers: decoded by ``rosbags``, the wanted fields taken out, the stamp in whole nanoseconds."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from numbers import Integral
from typing import TYPE_CHECKING, Any, NamedTuple

from lsu_mesh.mesh.ros2.fields import compile_path, parse_path
from lsu_mesh.mesh.ros2.graph import HUMBLE_HASH
from lsu_mesh.mesh.ros2.settings import Distro
from lsu_mesh.mesh.ros2.validity import IsInvalid, rule_of

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

HEADER, TIME = "std_msgs/msg/Header", "builtin_interfaces/msg/Time"
NS = 10**9


class UnfitMessage(Exception):
    """A message cannot be used; ``reason`` is a short name to count by."""

    def __init__(self, reason: str, text: str) -> None:
        super().__init__(text)
        self.reason = reason


class Reading(NamedTuple):
    """What a message measures: its outputs, None where it has no value, and when; None without a stamp."""

    y: list[float | None]
    time_ns: int | None


@lru_cache
def types_of(distro: Distro) -> Typestore:
    """The message types of a release of ROS 2."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores[f"ROS2_{distro.upper()}"])


def type_hash_of(distro: Distro, type_name: str) -> str:
    """The hash by which peers know that they mean the same fields."""
    return HUMBLE_HASH if distro == "humble" else types_of(distro).hash_rihs01(type_name)


def has_header(store: Typestore, type_name: str) -> bool:
    """Whether messages of a type begin with a header, which has their time."""
    fields: Any = store.fielddefs[type_name][1]
    return any(name == "header" and about == HEADER for name, (_, about) in fields)


class Decoder:
    """Of one type: the fields of ``paths`` as numbers, and the stamp of the header where ``stamped``.

    The store knows the type, and the paths were checked by :func:`lsu_mesh.mesh.ros2.fields.check_path`.
    """

    def __init__(self, store: Typestore, type_name: str, paths: tuple[str, ...], *, stamped: bool) -> None:
        self._store = store
        self._type = type_name
        self._fields = [(path, compile_path(path), _rule(type_name, path)) for path in paths]
        self._stamped = stamped

    def decode(self, payload: bytes) -> Reading:
        """Raises :class:`UnfitMessage` where the bytes are no such message, or its stamp or a field cannot be used."""
        return self.read(self.message(payload))

    def message(self, payload: bytes) -> Any:
        """The whole message; raises :class:`UnfitMessage`."""
        from rosbags.serde.errors import SerdeError

        try:
            return self._store.deserialize_cdr(payload, self._type)
        except SerdeError as error:
            raise UnfitMessage("decoding", f"{len(payload)} bytes are no {self._type}: {error}") from None

    def read(self, message: Any) -> Reading:
        """What a decoded message says; raises :class:`UnfitMessage`."""
        y = [_value(message, path, get, is_invalid) for path, get, is_invalid in self._fields]
        return Reading(y, stamp_ns(message) if self._stamped else None)


def stamp_ns(message: Any) -> int:
    """The time of a message's header in nanoseconds since 1970; raises :class:`UnfitMessage`."""
    stamp = message.header.stamp
    if not 0 <= stamp.nanosec < NS:
        raise UnfitMessage("stamp", f"the stamp has {stamp.nanosec} ns beside its seconds; expected less than 1e9")
    if stamp.sec < 0:
        raise UnfitMessage("stamp", f"the stamp is of {stamp.sec} s, before 1970")
    if stamp.sec == 0 and stamp.nanosec == 0:
        text = 'the stamp is 0: the sender does not set it; set stamp = "receive" and time_error'
        raise UnfitMessage("stamp", text)
    return int(stamp.sec) * NS + int(stamp.nanosec)


def _rule(type_name: str, path: str) -> IsInvalid | None:
    steps = parse_path(path)
    assert steps is not None
    return rule_of(type_name, str(steps[0]))


def _value(message: Any, path: str, get: Callable[[Any], Any], is_invalid: IsInvalid | None) -> float | None:
    try:
        found = get(message)
    except IndexError:
        raise UnfitMessage("fields", f"{path}: the list of this message is shorter") from None
    value = float(found)
    if isinstance(found, Integral) and int(value) != int(found):
        raise UnfitMessage("fields", f"{path}: {found} is no double, and would be rounded")
    if not math.isfinite(value) or (is_invalid is not None and is_invalid(message, value)):
        return None
    return value
