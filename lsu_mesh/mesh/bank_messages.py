"""The messages of banks: one message holds the data of all instances of a step.

Arrays are MessagePack ``bin``: float64, little-endian, row after row, a row per instance; statuses are a byte each. All
other fields are those of :mod:`lsu_mesh.mesh.messages`, and so is the way in which they are read.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.mesh.messages import (
    VERSION,
    Base,
    Count,
    Guarantee,
    Message,
    Names,
    PointRule,
    Refused,
    Text,
    Used,
    read,
)
from lsu_mesh.mesh.unknown_fields import TooManyFields, without_unknown

MAX_INSTANCES = 100_000
"""Most instances of a bank."""
MAX_BANK_PAYLOAD = 1 << 26
"""Largest payload in bytes of a bank's message that is looked at."""
STATUSES = ("ok", "predicted", "inconsistent", "restarted")
"""What the bytes 0 … 3 of ``statuses`` stand for."""
OK, PREDICTED, INCONSISTENT, RESTARTED = range(len(STATUSES))

Instances = Annotated[int, Meta(ge=1, le=MAX_INSTANCES)]


class BankMessage(Message, frozen=True, kw_only=True):
    """Common fields of the messages of a bank."""

    instances: Instances
    """N; instance i is row i of every array, from 0 on."""

    def matrix(self, field: str) -> Matrix:
        """An array field (N, …), a row per instance; it is read-only."""
        found: Matrix = _numbers(field, getattr(self, field)).reshape(self.instances, -1)
        return found

    def _check_rows(self, *fields: str) -> None:
        """Each of these fields holds as many numbers for every instance."""
        for field in fields:
            size = len(getattr(self, field))
            if size % (8 * self.instances):
                raise ValueError(f"{field} has {size} bytes, no whole number of float64 for {self.instances} instances")


class BankTruth(BankMessage, frozen=True, kw_only=True):
    """True states x_k of the instances of a simulated plant."""

    topic = "bank_truth"
    x: bytes

    def __post_init__(self) -> None:
        Message.__post_init__(self)
        self._check_rows("x")
        _check_finite("x", self.x)


class BankMeasurement(BankMessage, frozen=True, kw_only=True):
    """Measured outputs of one sensor, of all instances; NaN is a missing entry."""

    topic = "bank_measurement"
    step: Count = 0
    """k; 0, or nothing: the mesh puts it on the step of its time."""
    y: bytes
    time_ns: Count
    time_error_ns: Count | None = None
    """Half-width of what is not known of ``time_ns``; nil in a message with a step: measured at that step's time."""

    def __post_init__(self) -> None:
        Message.__post_init__(self)
        self._check_rows("y")
        if np.isinf(_numbers("y", self.y)).any():
            raise ValueError("y holds a number that is not finite")


class BankSets(BankMessage, frozen=True, kw_only=True):
    """Sets of all instances at step ``step``; ``statuses`` says of each whether it is one to believe."""

    lower: bytes
    upper: bytes
    point: bytes
    statuses: bytes
    """A byte per instance: 0 ``ok``, 1 ``predicted``, 2 ``inconsistent``, 3 ``restarted``."""
    guarantee: Guarantee
    """Of all instances whose status is not ``inconsistent``."""
    base: Base
    used: Used
    missing: Names
    algorithm: Count
    """Number of the arithmetic of its kind or policy."""

    def __post_init__(self) -> None:
        Message.__post_init__(self)
        self._check_rows("lower", "upper", "point")
        lower, upper = _numbers("lower", self.lower), _numbers("upper", self.upper)
        if not len(self.lower) == len(self.upper) == len(self.point) or not self.lower:
            sizes = f"{len(self.lower)}, {len(self.upper)} and {len(self.point)}"
            raise ValueError(f"lower, upper and point have {sizes} bytes")
        for name in ("lower", "upper", "point"):
            _check_finite(name, getattr(self, name))
        if (lower > upper).any():
            raise ValueError("lower > upper")
        if len(self.statuses) != self.instances or max(self.statuses) >= len(STATUSES):
            raise ValueError(f"statuses are {self.instances} bytes from 0 to {len(STATUSES) - 1}")

    @property
    def status_codes(self) -> NDArray[np.uint8]:
        """Statuses (N,) as numbers."""
        return np.frombuffer(self.statuses, dtype=np.uint8)


class BankPosterior(BankSets, frozen=True, kw_only=True):
    """Supports of the posteriors of all instances, with their provenance."""

    topic = "bank_posterior"
    kind: Text
    support: Literal["orthotope", "parallelotope", "hull"]
    """What the sets are: the boxes ``lower … upper``; ``center + generators ξ``; or something inside the boxes."""
    center: bytes | None = None
    generators: bytes | None = None
    """Of parallelotopes: n and n² numbers per instance, the rows of the matrix one after the other."""
    log_volume: bytes
    """A float64 per instance; NaN where a set is flat, or inconsistent."""
    volume_of: Literal["support", "hull"]
    epoch: Count
    """How often instances were reset since the process started; ``restarted`` names them."""
    point_rule: PointRule

    def __post_init__(self) -> None:
        BankSets.__post_init__(self)
        if len(self.log_volume) != 8 * self.instances or np.isinf(_numbers("log_volume", self.log_volume)).any():
            raise ValueError("log_volume is one number per instance, finite or NaN")
        own, n = (self.center, self.generators), len(self.lower) // (8 * self.instances)
        if any((part is not None) != (self.support == "parallelotope") for part in own):
            raise ValueError("center and generators come with parallelotopes, and with nothing else")
        for name, data, width in (("center", own[0], n), ("generators", own[1], n * n)):
            if data is not None:
                if len(data) != 8 * width * self.instances:
                    raise ValueError(f"{name} has {len(data)} bytes, expected {8 * width} per instance")
                _check_finite(name, data)


class BankFused(BankSets, frozen=True, kw_only=True):
    """Boxes that hold the states by all sources together, instance by instance."""

    topic = "bank_fused"
    policy: Text
    faults: Count


BANK_TYPES: dict[str, type[BankMessage]] = {
    kind.topic: kind for kind in (BankTruth, BankMeasurement, BankPosterior, BankFused)
}
_DECODERS: dict[str, msgspec.msgpack.Decoder[Any]] = {
    topic: msgspec.msgpack.Decoder(kind, strict=True) for topic, kind in BANK_TYPES.items()
}


class _Version(msgspec.Struct):
    v: int


_VERSION_DECODER = msgspec.msgpack.Decoder(_Version)


def read_any(topic: str, payload: bytes) -> tuple[Message, tuple[str, ...]]:
    """The message in ``payload``, of a bank or not, and the names of its unknown fields, which were ignored.

    Raises :class:`lsu_mesh.mesh.messages.Refused` and nothing else.
    """
    if topic not in BANK_TYPES:
        return read(topic, payload)
    if len(payload) > MAX_BANK_PAYLOAD:
        raise Refused("size", f"{len(payload)} bytes, the limit is {MAX_BANK_PAYLOAD}")
    try:
        try:
            return _DECODERS[topic].decode(payload), ()
        except msgspec.ValidationError as refusal:
            known, unknown = without_unknown(payload, BANK_TYPES[topic])
            version = _VERSION_DECODER.decode(known).v
            if version != VERSION:
                raise Refused("version", f"version {version}, this peer speaks {VERSION}") from None
            if not unknown:
                raise refusal from None
            return _DECODERS[topic].decode(known), unknown
    except (msgspec.ValidationError, TooManyFields) as error:
        raise Refused("content", str(error)) from None
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError, OverflowError, MemoryError) as error:
        raise Refused("format", f"{type(error).__name__}: {error}") from None


def packed(array: NDArray[np.float64]) -> bytes:
    """The bytes of an array for a field: float64, little-endian, in row order."""
    return np.ascontiguousarray(array, dtype="<f8").tobytes()


def _numbers(name: str, data: bytes) -> Vector:
    if len(data) % 8:
        raise ValueError(f"{name} has {len(data)} bytes, no whole number of float64")
    return np.frombuffer(data, dtype="<f8")


def _check_finite(name: str, data: bytes) -> None:
    if not np.isfinite(_numbers(name, data)).all():
        raise ValueError(f"{name} holds a number that is not finite")
