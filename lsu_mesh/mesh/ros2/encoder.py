"""What is told to ROS 2: points and diagnostics as bytes, and the identifier of a publisher."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

POINT, DIAGNOSTICS = "geometry_msgs/msg/PointStamped", "diagnostic_msgs/msg/DiagnosticArray"
DIAGNOSTICS_TOPIC = "/diagnostics"
LEVELS = {"OK": 0, "WARN": 1, "ERROR": 2, "STALE": 3}
"""Of diagnostic_msgs/msg/DiagnosticStatus."""
NS, LAST_S = 10**9, 2**31 - 1
"""A stamp of ROS 2 ends in 2038."""


class Status(NamedTuple):
    """One entry of a diagnostic array."""

    level: str
    name: str
    message: str
    hardware_id: str
    values: Mapping[str, str]


def gid_of(token: str) -> bytes:
    """The identifier of a publisher: 128 bits of XXH3 over its token, the low half first, as rmw_zenoh makes it."""
    import xxhash

    return xxhash.xxh3_128_intdigest(token.encode()).to_bytes(16, "little")


def is_tellable(time_ns: int) -> bool:
    """Whether a stamp of ROS 2 can say a time."""
    return 0 <= time_ns < (LAST_S + 1) * NS


class Encoder:
    """Serialises messages of one release of ROS 2."""

    def __init__(self, store: Typestore) -> None:
        self._store = store

    def point(self, time_ns: int, frame_id: str, xyz: Sequence[float]) -> bytes:
        """A ``PointStamped``; coordinates that are not given are 0."""
        x, y, z = (*xyz, 0.0, 0.0)[:3]
        point = self._made("geometry_msgs/msg/Point", x=x, y=y, z=z)
        return self._bytes(POINT, header=self._header(time_ns, frame_id), point=point)

    def diagnostics(self, time_ns: int, statuses: Sequence[Status]) -> bytes:
        """A ``DiagnosticArray``."""
        array = [
            self._made(
                "diagnostic_msgs/msg/DiagnosticStatus",
                level=LEVELS[one.level],
                name=one.name,
                message=one.message,
                hardware_id=one.hardware_id,
                values=[self._made("diagnostic_msgs/msg/KeyValue", key=k, value=v) for k, v in one.values.items()],
            )
            for one in statuses
        ]
        return self._bytes(DIAGNOSTICS, header=self._header(time_ns, ""), status=array)

    def _header(self, time_ns: int, frame_id: str) -> Any:
        seconds, rest = divmod(time_ns, NS)
        stamp = self._made("builtin_interfaces/msg/Time", sec=seconds, nanosec=rest)
        return self._made("std_msgs/msg/Header", stamp=stamp, frame_id=frame_id)

    def _made(self, type_name: str, **fields: Any) -> Any:
        return self._store.types[type_name](**fields)

    def _bytes(self, type_name: str, **fields: Any) -> bytes:
        return bytes(self._store.serialize_cdr(self._made(type_name, **fields), type_name))
