"""The messages of the mesh: MessagePack maps, typed with msgspec, decoded strictly.

Every message carries the common fields of :class:`Message`. Matrices are lists of rows. Nothing that is not finite,
ordered and of one dimension gets past :func:`decode`. Fields that are unknown here are ignored, and :func:`read` names
them. Fields that came later than the first release have a default, so that older payloads are read for ever.
"""

from __future__ import annotations

import math
import operator
import re
from typing import Annotated, Any, ClassVar, Literal

import msgspec
from msgspec import Meta, Struct

from lsu_mesh.mesh.unknown_fields import TooManyFields, without_unknown

VERSION = 1
MAX_PAYLOAD = 1 << 20
"""Largest payload in bytes that is looked at."""

Count = Annotated[int, Meta(ge=0, le=2**63 - 1)]
Numbers = Annotated[list[float], Meta(max_length=4096)]
Rows = Annotated[list[Numbers], Meta(max_length=4096)]
Text = Annotated[str, Meta(max_length=4096)]
Reference = tuple[Text, Text, Text, Count]
"""``[topic, src, boot, seq]`` of a message that was used."""
Mark = tuple[Text, Text, Count]
"""``[src, boot, epoch]``: an epoch that a set descends from."""
Guarantee = Literal["declared", "learned", "none"]
"""Whether a set holds the state under the declared bounds, under bounds that explain the data, or not surely at all."""

Descent = Annotated[list[Mark], Meta(max_length=4096)]
"""Epochs of others whose sets went into a set, directly or through others."""

_BOOT = re.compile(r"[0-9a-f]{16}")


class Refused(Exception):
    """A payload is not a message of this protocol; ``reason`` is a short word to count it by.

    A datum that is refused for its time names its ``source`` and by how many ``seconds`` it is late (below 0: early).
    """

    def __init__(self, reason: str, text: str, *, source: str = "", seconds: float | None = None) -> None:
        super().__init__(text)
        self.reason = reason
        self.source = source
        self.seconds = seconds


class _Strict(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    pass


class _Version(Struct):
    """What every version of every message has."""

    v: int


class OrthotopeMessage(_Strict, frozen=True, kw_only=True, tag_field="type", tag="orthotope"):
    """Box ``lower ≤ x ≤ upper``."""

    lower: Numbers
    upper: Numbers

    def __post_init__(self) -> None:
        _check_box(self.lower, self.upper)


class ParallelotopeMessage(_Strict, frozen=True, kw_only=True, tag_field="type", tag="parallelotope"):
    """``center + generators ξ``, ``|ξ| ≤ 1``, generators square."""

    center: Numbers
    generators: Rows

    def __post_init__(self) -> None:
        _check_matrix("generators", self.generators, len(self.center), len(self.center))
        _check_finite("center", self.center)


class ZonotopeMessage(_Strict, frozen=True, kw_only=True, tag_field="type", tag="zonotope"):
    """``center + generators ξ``, ``|ξ| ≤ 1``."""

    center: Numbers
    generators: Rows

    def __post_init__(self) -> None:
        _check_finite("center", self.center)
        _check_matrix("generators", self.generators, len(self.center), None)


class ConstrainedZonotopeMessage(_Strict, frozen=True, kw_only=True, tag_field="type", tag="constrained_zonotope"):
    """``center + generators ξ``, ``|ξ| ≤ 1``, ``A ξ = b``."""

    center: Numbers
    generators: Rows
    A: Rows
    b: Numbers

    def __post_init__(self) -> None:
        _check_finite("center", self.center)
        _check_finite("b", self.b)
        _check_matrix("generators", self.generators, len(self.center), None)
        columns = len(self.generators[0]) if self.generators else 0
        _check_matrix("A", self.A, len(self.b), columns)


class IntersectionMessage(_Strict, frozen=True, kw_only=True, tag_field="type", tag="intersection"):
    """Intersection of the parts (no intersections among them)."""

    parts: Annotated[
        list[OrthotopeMessage | ParallelotopeMessage | ZonotopeMessage | ConstrainedZonotopeMessage],
        Meta(min_length=1, max_length=64),
    ]

    def __post_init__(self) -> None:
        if len({dimension(part) for part in self.parts}) != 1:
            raise ValueError("parts differ in dimension")


SupportMessage = (
    OrthotopeMessage | ParallelotopeMessage | ZonotopeMessage | ConstrainedZonotopeMessage | IntersectionMessage
)


class Bounds(_Strict, frozen=True, kw_only=True):
    """Noise half-widths in force at a step."""

    rho: Numbers
    r: Numbers

    def __post_init__(self) -> None:
        for name, values in (("rho", self.rho), ("r", self.r)):
            _check_finite(name, values)
            if any(value < 0 for value in values):
                raise ValueError(f"{name} has a negative half-width")


class Message(_Strict, frozen=True, kw_only=True):
    """Common fields of every message."""

    topic: ClassVar[str]

    v: int
    src: Text
    boot: str
    seq: Count
    step: Count
    sent_ns: Count
    origin_ns: Count
    model: Annotated[str, Meta(max_length=64)]

    def __post_init__(self) -> None:
        if self.v != VERSION:
            raise ValueError(f"version {self.v}, this peer speaks {VERSION}")
        if _BOOT.fullmatch(self.boot) is None:
            raise ValueError("boot is not 16 hexadecimal characters")

    @property
    def name(self) -> str:
        """Name of the peer, the part of ``src`` behind the role."""
        return self.src.rpartition("/")[2]

    @property
    def reference(self) -> Reference:
        """What the provenance of others calls this message."""
        return (self.topic, self.src, self.boot, self.seq)


class Truth(Message, frozen=True, kw_only=True):
    """True state x_k of a simulated plant."""

    topic = "truth"
    x: Numbers

    def __post_init__(self) -> None:
        Message.__post_init__(self)
        _check_finite("x", self.x)


class Input(Message, frozen=True, kw_only=True):
    """Input u_k, which drives step k to k+1."""

    topic = "input"
    u: Numbers
    time_ns: Count | None = None
    """When it began to act, nanoseconds since 1970, up to ``input_delay`` after its step; nil: it does not say."""

    def __post_init__(self) -> None:
        Message.__post_init__(self)
        _check_finite("u", self.u)


class Measurement(Message, frozen=True, kw_only=True):
    """Measured outputs of one sensor; nil is a missing entry."""

    topic = "measurement"
    step: Count = 0
    """k; 0, or nothing: the mesh puts it on the step of its time."""
    y: Annotated[list[float | None], Meta(max_length=4096)]
    time_ns: Count
    time_error_ns: Count | None = None
    """Half-width of what is not known of ``time_ns``; nil (an older peer) in a message with a step: measured at that
    step's own time, and ``time_ns`` is not read."""

    def __post_init__(self) -> None:
        Message.__post_init__(self)
        _check_finite("y", [value for value in self.y if value is not None])


Base = Reference | Literal["prior", "reach", "domain", "sources"]
"""What a set was made from: a message, the prior, the prior carried through all inputs, the domain, ``used`` alone."""
Used = Annotated[list[Reference], Meta(max_length=4096)]
"""Every message brought to a set since its base, in the order applied."""
Names = Annotated[list[Text], Meta(max_length=4096)]
PointRule = Literal["mean", "nearest", "centre"]


class Prediction(Message, frozen=True, kw_only=True):
    """Support of the state predictor of step ``step`` and interval of its outputs."""

    topic = "prediction"
    support: SupportMessage
    lower: Numbers
    upper: Numbers
    y_lower: Numbers
    y_upper: Numbers
    y_point: Numbers
    epoch: Count
    guarantee: Guarantee
    descent: Descent = []
    base: Base | None = None
    """The posterior of the step before that it was made from; nil: an older peer does not say."""
    used: Used = []
    """What was brought to ``base`` since: the input of the step before, where it was known."""
    bounds: Bounds | None = None
    missing: Names = []
    """What was not known: ``["input"]`` where the input box stood in for the input."""
    algorithm: Count | None = None
    """Number of the arithmetic of its filter; nil is 1."""
    point_rule: PointRule | None = None
    """How the state was chosen of which ``y_point`` is the output; nil: the centre of the hull, as older peers do."""

    def __post_init__(self) -> None:
        Message.__post_init__(self)
        _check_box(self.lower, self.upper)
        _check_dimension(self.support, self.lower)
        _check_box(self.y_lower, self.y_upper)
        _check_finite("y_point", self.y_point)


class Posterior(Message, frozen=True, kw_only=True):
    """Support of a filter's posterior at step ``step``, with its provenance."""

    topic = "posterior"
    kind: Text
    support: SupportMessage
    lower: Numbers
    upper: Numbers
    point: Numbers
    log_volume: float | None
    volume_of: Literal["support", "hull"]
    status: Literal["ok", "predicted", "inconsistent", "restarted"]
    revision: Count
    epoch: Count
    guarantee: Guarantee
    base: Base
    used: Used
    bounds: Bounds
    missing: Names
    cause: Text | None = None
    descent: Descent = []
    gain: float | None = None
    """Gain of the step's Bayesian transfers in nats; nil where none was used, or where the set became flat."""
    gain_of: Literal["support", "hull"] | None = None
    """Whose volumes ``gain`` compares; nil: an older peer does not say."""
    point_rule: PointRule | None = None
    """How ``point`` was chosen; nil: the centre of the hull, as older peers do."""
    algorithm: Count | None = None
    """Number of the arithmetic of its kind or policy, raised whenever its bits change; nil is 1."""
    mean: Numbers | None = None
    covariance: Rows | None = None
    """Density beside the set from which ``point`` is taken by the rule ``mean``, and the next densities are made; nil:
    there is none."""

    def __post_init__(self) -> None:
        Message.__post_init__(self)
        _check_box(self.lower, self.upper)
        _check_dimension(self.support, self.lower)
        _check_finite("point", self.point)
        if len(self.point) != len(self.lower):
            raise ValueError(f"point has {len(self.point)} entries, lower {len(self.lower)}")
        if self.log_volume is not None:
            _check_finite("log_volume", [self.log_volume])
        if self.gain is not None:
            _check_finite("gain", [self.gain])
        self._check_density()

    def _check_density(self) -> None:
        if (self.mean is None) != (self.covariance is None):
            raise ValueError("mean and covariance come together")
        if self.mean is not None and self.covariance is not None:
            if len(self.mean) != len(self.lower):
                raise ValueError(f"mean has {len(self.mean)} entries, lower {len(self.lower)}")
            _check_finite("mean", self.mean)
            _check_matrix("covariance", self.covariance, len(self.lower), len(self.lower))


class Smoothed(Message, frozen=True, kw_only=True):
    """Support of the state ``lag`` steps back, given all data up to then: ``step`` is that of the state."""

    topic = "smoothed"
    support: SupportMessage
    lower: Numbers
    upper: Numbers
    lag: Count
    """Steps from the state to the newest data."""
    base: Reference
    """The posterior of step ``step + lag``, whose filter holds this set too."""
    revision: Count
    """Of ``base``; like the two below."""
    epoch: Count
    guarantee: Guarantee
    algorithm: Count

    def __post_init__(self) -> None:
        Message.__post_init__(self)
        _check_box(self.lower, self.upper)
        _check_dimension(self.support, self.lower)


class Rejection(_Strict, frozen=True, kw_only=True):
    """A source that was left out of a fused set, and why."""

    source: Text
    reason: Text


class Fused(Posterior, frozen=True, kw_only=True):
    """Support that holds the state by all accepted sources together."""

    topic = "fused"
    policy: Text
    """A name of ``POLICIES``; admission refuses one that this peer does not know."""
    faults: Count
    rejected: Annotated[list[Rejection], Meta(max_length=4096)]
    quarantined: Annotated[list[Text], Meta(max_length=4096)]


class Suggestion(Message, frozen=True, kw_only=True):
    """Noise bounds that explain the data of steps first … last; ``step`` is ``last``."""

    topic = "bounds"
    rho: Numbers
    r: Annotated[dict[Text, Numbers], Meta(max_length=4096)]
    """By sensor."""
    factor: float
    """By what the bounds in force must be multiplied to explain the data."""
    margin: float
    first: Count
    last: Count
    explained: bool
    """Whether the bounds in force explain the data."""
    adopt_at: Count | None = None
    """From this step on filters that adopt go by these bounds; nil where they are only told."""

    def __post_init__(self) -> None:
        Message.__post_init__(self)
        Bounds(rho=self.rho, r=[width for widths in self.r.values() for width in widths])
        _check_finite("factor and margin", [self.factor, self.margin])


class Health(Message, frozen=True, kw_only=True):
    """How a peer does, once a second."""

    topic = "health"
    role: Text
    level: Literal["OK", "WARN", "ERROR", "STALE"]
    reasons: Annotated[list[Text], Meta(max_length=256)]
    counters: Annotated[dict[Text, float], Meta(max_length=4096)]
    started_ns: Count | None = None
    """When the process started, nanoseconds since 1970."""
    host: Text | None = None
    """Name of the machine that it runs on."""

    def __post_init__(self) -> None:
        Message.__post_init__(self)
        _check_finite("counters", list(self.counters.values()))


class Event(Message, frozen=True, kw_only=True):
    """Something that a person should know of, with what it is about."""

    topic = "event"
    level: Literal["INFO", "WARN", "ERROR"]
    code: Annotated[str, Meta(max_length=64)]
    text: Text
    about: Annotated[dict[Text, str | int | float | None], Meta(max_length=64)]

    def __post_init__(self) -> None:
        Message.__post_init__(self)
        _check_finite("about", [value for value in self.about.values() if isinstance(value, float)])


TYPES: dict[str, type[Message]] = {
    kind.topic: kind
    for kind in (Truth, Input, Measurement, Prediction, Posterior, Smoothed, Fused, Suggestion, Health, Event)
}
_DECODERS: dict[str, msgspec.msgpack.Decoder[Any]] = {
    topic: msgspec.msgpack.Decoder(kind, strict=True) for topic, kind in TYPES.items()
}
_VERSION_DECODER = msgspec.msgpack.Decoder(_Version)
_ENCODER = msgspec.msgpack.Encoder()


def encoding(topic: str) -> str:
    """Encoding tag of a topic's payload."""
    return f"application/msgpack;lsu.{topic}/{VERSION}"


def encode(message: Message) -> bytes:
    """Payload of a message: a MessagePack map of plain numbers, strings and lists."""
    return _ENCODER.encode(message)


def decode(topic: str, payload: bytes) -> Message:
    """The message in ``payload``; raises :class:`Refused` and nothing else."""
    return read(topic, payload)[0]


def read(topic: str, payload: bytes) -> tuple[Message, tuple[str, ...]]:
    """The message in ``payload``, and the names of the fields in it that are unknown here and were ignored.

    Raises :class:`Refused` and nothing else.
    """
    decoder = _DECODERS.get(topic)
    if decoder is None:
        raise Refused("topic", f"no message type for topic {topic!r}")
    if len(payload) > MAX_PAYLOAD:
        raise Refused("size", f"{len(payload)} bytes, the limit is {MAX_PAYLOAD}")
    try:
        try:
            return decoder.decode(payload), ()
        except msgspec.ValidationError as refusal:
            return _read_newer(topic, payload, refusal)
    except (msgspec.ValidationError, TooManyFields) as error:
        raise Refused("content", str(error)) from None
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError, OverflowError, MemoryError) as error:
        raise Refused("format", f"{type(error).__name__}: {error}") from None


def _read_newer(topic: str, payload: bytes, refusal: msgspec.ValidationError) -> tuple[Message, tuple[str, ...]]:
    """What is known of a payload that strict decoding refuses; raises ``refusal`` where that was for another reason."""
    known, unknown = without_unknown(payload, TYPES[topic])
    version = _VERSION_DECODER.decode(known).v
    if version != VERSION:
        raise Refused("version", f"version {version}, this peer speaks {VERSION}")
    if not unknown:
        raise refusal
    return _DECODERS[topic].decode(known), unknown


def dimension(support: SupportMessage) -> int:
    """Dimension of the space that the set lies in."""
    if isinstance(support, OrthotopeMessage):
        return len(support.lower)
    if isinstance(support, IntersectionMessage):
        return dimension(support.parts[0])
    return len(support.center)


def _check_finite(name: str, values: list[float]) -> None:
    if not all(map(math.isfinite, values)):
        raise ValueError(f"{name} holds a number that is not finite")


def _check_box(lower: list[float], upper: list[float]) -> None:
    _check_finite("lower", lower)
    _check_finite("upper", upper)
    if len(lower) != len(upper):
        raise ValueError(f"lower has {len(lower)} entries, upper {len(upper)}")
    if any(map(operator.gt, lower, upper)):
        raise ValueError("lower > upper")


def _check_matrix(name: str, rows: list[list[float]], height: int, width: int | None) -> None:
    if len(rows) != height:
        raise ValueError(f"{name} has {len(rows)} rows, expected {height}")
    expected = width if width is not None else (len(rows[0]) if rows else 0)
    for row in rows:
        if len(row) != expected:
            raise ValueError(f"{name} has a row of {len(row)} entries, expected {expected}")
        _check_finite(name, row)


def _check_dimension(support: SupportMessage, lower: list[float]) -> None:
    if dimension(support) != len(lower):
        raise ValueError(f"support has dimension {dimension(support)}, lower {len(lower)} entries")
