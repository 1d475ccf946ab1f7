"""Your own sensors in, estimates out: one file for a program of yours, with zenoh, msgpack and the standard library.

    from lsu_mesh_services.client import connect  # or copy this file beside your program: from client import connect

    with connect("mesh.toml") as mesh:
        gps = mesh.sensor("gps")
        gps.publish([1.5, None], time="now")
        for estimate in mesh.estimates("main"):
            print(estimate.step, estimate.lower, estimate.upper)

A sensor sends times, and the mesh counts the steps. A mesh that began anew is followed; Zenoh restores lost links.
"""

from __future__ import annotations

import json
import math
import re
import secrets
import socket
import struct
import threading
import time as clock
import tomllib
from collections import Counter, deque
from collections.abc import AsyncIterator, Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from decimal import Decimal, InvalidOperation
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any, Generic, Self, TypeVar

import msgpack
import zenoh
from zenoh import ext

T = TypeVar("T")
Time = datetime | str | Decimal | Fraction | int | float
Value = float | int | Decimal | Fraction | None
NS, MAX_NS = 10**9, 2**63
LEASE_MS, HEARTBEAT_S, LEAST_CACHED, CACHED_S = 2000, 0.1, 256, 6
ASK_EVERY_S, ANSWER_S, TELL_AFTER_S, SILENT_S, LOOK_EVERY_S = 1.0, 0.9, 0.3, 3.0, 0.1
SETTLED_S, SETTLE_S = 0.3, 2.0
READER = "viewer"
"""Name in the certificate of those who read everything and publish nothing."""
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_ISO = re.compile(r"(\d{4}-\d\d-\d\d[T ]\d\d:\d\d(?::\d\d)?)(?:[.,](\d+))?\s*(Z|[+-]\d\d(?::?\d\d)?)?")
_COMMON_NAME = bytes.fromhex("0603550403")
"""What stands before a common name in a certificate: the object identifier 2.5.4.3."""


class MeshError(Exception):
    """What went wrong, with the remedy."""


class NoMesh(MeshError):
    """Nobody of the mesh answers."""


class NotAllowed(MeshError):
    """The certificate, or the configuration, does not let this program do that."""


class WrongValue(MeshError, ValueError):
    """A value, a time or a name that the mesh would refuse; nothing was sent."""


def moment(time: Time) -> tuple[int, int]:
    """A time as ns since 1970, and the half-width in ns of what is not known of it.

    A date, a text, a whole number and a ``Decimal`` (of seconds) are what they say; a ``float`` is known to half of its
    spacing. What is rounded to a whole nanosecond is not known to that nanosecond.
    """
    if isinstance(time, str) and time.strip() == "now":
        return clock.time_ns(), 0
    exact, unknown = _exact_ns(time)
    ns = round(exact)
    if not 0 <= ns < MAX_NS:
        raise WrongValue(f"time {time!r} is not within 1970 … 2262: time is in seconds; give nanoseconds as time_ns")
    return ns, math.ceil(abs(exact - ns) + unknown)


def _exact_ns(time: Time) -> tuple[Fraction, Fraction]:
    """Nanoseconds since 1970 as written, and half of the spacing of a float."""
    if isinstance(time, datetime):
        if time.tzinfo is None:
            raise WrongValue(f'time {time} has no time zone; give one, as in datetime.now(UTC), or "now"')
        since = time - EPOCH
        return Fraction((since.days * 86400 + since.seconds) * NS + since.microseconds * 1000), Fraction(0)
    if isinstance(time, str):
        return _read_text(time), Fraction(0)
    spacing = math.ulp(time) if isinstance(time, float) else 0.0
    try:
        if isinstance(time, bool):
            raise ValueError
        return Fraction(time) * NS, Fraction(spacing) / 2 * NS
    except (TypeError, ValueError, OverflowError):
        raise WrongValue(f'time {time!r} is no time; expected seconds, a date with a time zone, or "now"') from None


def _read_text(text: str) -> Fraction:
    words = text.strip()
    try:
        if found := _ISO.fullmatch(words):
            whole, digits, zone = found.groups()
            if zone is None:
                raise WrongValue(f"time {text!r} has no time zone; end it with Z or +02:00")
            return _exact_ns(datetime.fromisoformat(whole + zone))[0] + Fraction(f"0.{digits or 0}") * NS
        if "_" in words:
            raise ValueError
        return Fraction(Decimal(words)) * NS
    except (ValueError, OverflowError, InvalidOperation) as error:
        if isinstance(error, WrongValue):
            raise
        known = '"now", seconds such as 1700000000.25, or a moment such as 2024-05-01T12:00:00Z'
        raise WrongValue(f"time {text!r} cannot be read; expected {known}") from None


@dataclass(frozen=True)
class Model:
    """What the mesh answers about itself; ``t_k = start_ns + round(k dt)``."""

    digest: str
    dt: Fraction
    start_ns: int | None
    sensors: Mapping[str, Mapping[str, Any]]
    inputs: int
    plant: str | None
    """Name of the plant whose inputs a program sends."""
    raw: Mapping[str, Any]

    @classmethod
    def read(cls, answer: Mapping[str, Any]) -> Model:
        """The model in an answer to the query."""
        exact = answer.get("dt_exact")
        dt = Fraction(repr(answer["dt"])) if exact is None else Fraction(exact)
        columns = len(answer["B"][0]) if answer.get("B") else 0
        start, sensors = answer.get("start_ns"), answer["sensors"]
        return cls(answer["model"], dt, start, sensors=sensors, inputs=columns, plant=answer.get("plant"), raw=answer)

    def time_of(self, step: int) -> int | None:
        """``t_k`` in ns; None where the mesh counts steps without times."""
        return None if self.start_ns is None else self.start_ns + round(step * self.dt * NS)

    def step_within(self, time_ns: int) -> int:
        """The step k with ``t_k <= t < t_(k+1)``, in which an input of time t begins to act."""
        if self.start_ns is None:
            raise WrongValue("the mesh counts steps and has no times: give step=, or [mesh] start_time")
        k = math.floor((time_ns - self.start_ns) / (self.dt * NS))
        return max(j for j in (k - 1, k, k + 1) if (self.time_of(j) or 0) <= time_ns)


@dataclass(frozen=True)
class Estimate:
    """A published set; the state lies in ``support``, and within ``lower`` … ``upper``."""

    name: str
    step: int
    time_ns: int | None
    lower: Any
    upper: Any
    point: Any
    status: str
    guarantee: str
    support: Mapping[str, Any]
    raw: Mapping[str, Any]

    def numpy(self) -> Estimate:
        """The same with NumPy arrays for lists."""
        import numpy as np

        support = {key: np.array(value) if _is_numbers(value) else value for key, value in self.support.items()}
        lower, upper, point = np.array(self.lower), np.array(self.upper), np.array(self.point)
        return replace(self, lower=lower, upper=upper, point=point, support=support)


STATUSES = ("ok", "predicted", "inconsistent", "restarted")


@dataclass(frozen=True)
class BankEstimate:
    """The sets of all targets of a bank: ``lower[i, j]`` is of state j of target i, counted from 0."""

    name: str
    step: int
    time_ns: int | None
    instances: int
    lower: Any
    upper: Any
    point: Any
    statuses: Any
    """Places in ``STATUSES``; of a target that is ``inconsistent`` nothing is promised."""
    raw: Mapping[str, Any]

    def status(self, target: int) -> str:
        """The status of one target in words."""
        return STATUSES[self.statuses[target]]

    def numpy(self) -> BankEstimate:
        """The same with NumPy arrays."""
        import numpy as np

        lower, upper, point = np.asarray(self.lower), np.asarray(self.upper), np.asarray(self.point)
        return replace(self, lower=lower, upper=upper, point=point, statuses=np.frombuffer(self.statuses, np.uint8))

    @classmethod
    def read(cls, name: str, time_ns: int | None, raw: Mapping[str, Any]) -> BankEstimate:
        """The estimate in a message ``bank_posterior`` or ``bank_fused``."""
        shape = [raw["instances"], len(raw["lower"]) // (8 * raw["instances"])]
        lower, upper, point = (memoryview(raw[key]).cast("d", shape) for key in ("lower", "upper", "point"))
        return cls(
            name, raw["step"], time_ns, raw["instances"], lower=lower, upper=upper, point=point,
            statuses=raw["statuses"], raw=raw,
        )  # fmt: skip


def _is_numbers(value: object) -> bool:
    return isinstance(value, list) and not any(isinstance(one, Mapping) for one in value)


@dataclass(frozen=True)
class Event:
    """Something that a person should know."""

    source: str
    level: str
    code: str
    text: str
    about: Mapping[str, Any]
    raw: Mapping[str, Any]


@dataclass(frozen=True)
class Settings:
    """How to reach a mesh."""

    mesh: str
    connect: Sequence[str]
    listen: Sequence[str] = ()
    mode: str = "peer"
    zenoh: Sequence[str] = ()
    tls: Mapping[str, Any] = field(default_factory=dict)
    folder: Path = Path()
    wait: float | None = 10.0
    """Seconds until :class:`NoMesh`; None: for ever."""
    tell: Callable[[str], None] | None = None
    """Called with why nobody answers, and when that changes."""

    @property
    def uses_tls(self) -> bool:
        """Whether links are encrypted, and certificates say who is who."""
        return bool(self.tls.get("enabled"))

    def file(self, what: str, name: str) -> Path:
        """The file of the authority, or of the certificate or key of a name."""
        usual = {"authority": "keys/ca.pem", "certificate": "keys/{name}.pem", "key": "keys/{name}.key"}
        return self.folder / Path(str(self.tls.get(what, usual[what])).replace("{name}", name)).expanduser()

    @classmethod
    def read(cls, file: str | Path) -> Settings:
        """What a configuration file says."""
        path = Path(file)
        try:
            return cls.of(tomllib.loads(path.read_text(encoding="utf-8")), path.parent)
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise MeshError(f"{path}: is no configuration of a mesh, which has [mesh] name: {error!r}") from None

    @classmethod
    def of(cls, values: Mapping[str, Any], folder: Path) -> Settings:
        """``[mesh] name`` and ``[network]`` of a configuration in a folder."""
        name, network = values["mesh"]["name"], values.get("network", {})
        tls = network.get("tls", {})
        entry = network.get("entry", f"{'tls' if tls.get('enabled') else 'tcp'}/127.0.0.1:7447")
        return cls(name, (entry, *network.get("connect", [])), tls=tls, folder=folder)


def connect(
    file: str | Path | None = None, *, name: str | None = None, entry: str | Sequence[str] | None = None, **more: Any
) -> Mesh:
    """Join the mesh of a configuration file, or the mesh ``name`` at ``entry``.

    ``more`` are fields of :class:`Settings`, such as ``wait``: so many seconds until :class:`NoMesh`, None for ever.
    """
    if file is None and (name is None or entry is None):
        raise MeshError('which mesh? connect("mesh.toml"), or connect(name="external", entry="tcp/127.0.0.1:7447")')
    settings = Settings(name or "", ()) if file is None else Settings.read(file)
    changes: dict[str, Any] = {} if name is None else {"mesh": name}
    changes |= {} if entry is None else {"connect": (entry,) if isinstance(entry, str) else tuple(entry)}
    return Mesh(replace(settings, **changes, **more))


class Stream(Generic[T]):
    """What comes, for ``for`` and ``async for``; of more than ``keep`` that wait the newest are kept."""

    def __init__(self, keep: int) -> None:
        self.dropped = 0
        """So many were lost, because this program is slower than the mesh."""
        self._waiting: deque[T] = deque(maxlen=keep)
        self._changed = threading.Condition()
        self._wake: Callable[[], None] | None = None
        self._is_closed = False

    def put(self, one: T) -> None:
        """Called by the network."""
        with self._changed:
            self.dropped += len(self._waiting) == self._waiting.maxlen
            self._waiting.append(one)
            self._tell()

    def close(self) -> None:
        """End the iterations, once what waits is taken."""
        with self._changed:
            self._is_closed = True
            self._tell()

    def _tell(self) -> None:
        self._changed.notify_all()
        if self._wake is not None:
            self._wake()

    def next(self, timeout: float | None = None) -> T | None:
        """The oldest that waits; None after ``timeout`` seconds, or when the mesh is closed."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._is_closed, timeout)
            return self._waiting.popleft() if self._waiting else None

    def __iter__(self) -> Iterator[T]:
        while (one := self.next()) is not None:
            yield one

    async def __aiter__(self) -> AsyncIterator[T]:
        import asyncio

        loop, came = asyncio.get_running_loop(), asyncio.Event()

        def wake() -> None:
            if not loop.is_closed():
                loop.call_soon_threadsafe(came.set)

        with self._changed:
            self._wake = wake
        while True:
            came.clear()
            one = self.next(0)
            if one is not None:
                yield one
            elif self._is_closed:
                return
            else:
                await came.wait()


class Source:
    """What a program sends under one name: ``sensor`` measurements, or ``plant`` inputs."""

    def __init__(self, mesh: Mesh, session: Any, role: str, *, name: str) -> None:
        self.name, self.role = name, role
        self.counters: Counter[str] = Counter()
        """What was ``published`` and ``refused`` here."""
        self._mesh, self._session = mesh, session
        self._topic = "measurement" if role == "sensor" else "input"
        self._boot, self._started_ns = secrets.token_hex(8), clock.time_ns()
        self._sequences: Counter[str] = Counter()
        self._publishers: dict[str, Any] = {}
        self._digest, self._step = "", 0
        self._lock = threading.Lock()
        self._outputs(mesh.model())  # an error here, before anybody sees it
        self._token = session.liveliness().declare_token(mesh.key("live", name))

    def publish(self, values: Value | Sequence[Value] | Mapping[str, Value], time: Time = "now", **more: Any) -> None:
        """Send what was measured, or the inputs that act from now on, at a time.

        ``values``: a number, a list or a map by output; None was not measured. ``time_ns``: the time in nanoseconds
        instead; ``time_error``: seconds that are not known of it, or ``time_error_ns``; ``step``: of a mesh without
        times. :class:`WrongValue` says what the mesh would refuse.
        """
        model = self._mesh.model()
        try:
            if model.raw.get("instances") is not None:
                raise WrongValue(f"mesh {self._mesh.name!r} is one of banks; publish_all() sends a row per target")
            numbers = self._numbers(values, self._outputs(model))
            fields, step = self._timed(model, time, **more)
        except WrongValue:
            self.counters["refused"] += 1
            raise
        if fields is not None:
            self._put(model, self._topic, step, {("y" if self.role == "sensor" else "u"): numbers} | fields)
            self.counters["published"] += 1

    def publish_all(self, values: Any, time: Time = "now", **more: Any) -> None:
        """Send what was measured of all targets of a mesh of banks: a row per target, None or NaN was not measured.

        ``values``: rows, or an array of NumPy (N, m); the rest is as in :meth:`publish`.
        """
        model = self._mesh.model()
        try:
            count = model.raw.get("instances")
            if count is None:
                raise WrongValue(f"mesh {self._mesh.name!r} has no bank; publish() sends the values of one target")
            y = self._rows(values, self._outputs(model), count)
            fields, step = self._timed(model, time, **more)
        except WrongValue:
            self.counters["refused"] += 1
            raise
        if fields is not None:
            self._put(model, "bank_measurement", step, {"instances": count, "y": y} | fields)
            self.counters["published"] += 1

    def _rows(self, values: Any, outputs: Sequence[str], count: int) -> bytes:
        """Rows of float64, little-endian."""
        width = len(outputs)
        if hasattr(values, "astype"):
            array = values.astype("<f8")
            if array.shape != (count, width):
                raise WrongValue(f"{self.name}: found shape {array.shape}, expected {(count, width)}, a row per target")
            if (abs(array) == math.inf).any():
                raise WrongValue(f"{self.name}: a value is infinite; give NaN where nothing was measured")
            return bytes(array.tobytes())
        rows = [self._numbers(row, outputs) for row in values]
        if len(rows) != count:
            raise WrongValue(f"{self.name}: found {len(rows)} row(s), expected {count}, one per target")
        flat = [math.nan if value is None else value for row in rows for value in row]
        return struct.pack(f"<{len(flat)}d", *flat)

    @property
    def outputs(self) -> Sequence[str]:
        """Names of the values that it sends."""
        return self._outputs(self._mesh.model())

    def _outputs(self, model: Model) -> Sequence[str]:
        if self.role == "plant":
            if model.plant != self.name:
                found = "none does" if model.plant is None else f"this is {model.plant!r}"
                text = f'a program may send inputs only for a plant with source = "external"; {found}'
                raise NotAllowed(f"mesh {self._mesh.name!r} has no such plant {self.name!r}: {text}")
            return [str(i) for i in range(model.inputs)]
        rows = model.sensors.get(self.name)
        if rows is None:
            known = ", ".join(model.sensors) or "none"
            raise WrongValue(f"mesh {self._mesh.name!r} has no sensor {self.name!r}; its sensors: {known}")
        source = rows.get("source", "simulated")
        if source != "external":
            text = 'a program may send only for a sensor with source = "external"'
            raise NotAllowed(f"[sensors.{self.name}] of mesh {self._mesh.name!r} has source = {source!r}: {text}")
        outputs: Sequence[str] = rows["outputs"]
        return outputs

    def _numbers(self, values: Any, outputs: Sequence[str]) -> list[float | None]:
        if isinstance(values, Mapping):
            if unknown := [key for key in values if key not in outputs]:
                raise WrongValue(f"{self.name} has no output {unknown[0]!r}; its outputs: {', '.join(outputs)}")
            values = [values.get(key) for key in outputs]
        try:
            listed = [values] if values is None or not hasattr(values, "__iter__") else list(values)
        except TypeError:  # an array without dimensions
            listed = [values]
        if len(listed) != len(outputs):
            text = f"found {len(listed)} value(s), expected {len(outputs)}: {', '.join(outputs)}"
            raise WrongValue(f"{self.name}: {text}")
        return [self._number(one, output) for one, output in zip(listed, outputs, strict=True)]

    def _number(self, value: Any, output: str) -> float | None:
        if value is None and self.role == "sensor":
            return None
        try:
            number = math.nan if isinstance(value, bool | str | bytes) else float(value)
        except (TypeError, ValueError, OverflowError):
            number = math.nan
        if not math.isfinite(number):
            remedy = "; give None where nothing was measured" if self.role == "sensor" else ""
            raise WrongValue(f"{self.name}: {output} = {value!r}, expected a finite number{remedy}")
        return number

    def _timed(
        self, model: Model, time: Time, *, time_ns: int | None = None, time_error: Time = 0, time_error_ns: int = 0,
        step: int = 0,
    ) -> tuple[dict[str, int | None] | None, int]:  # fmt: skip
        """The fields of time, None where the mesh has not begun then, and the step: 0 where the mesh counts it."""
        ns, unknown = moment(time) if time_ns is None else (time_ns, 0)
        if not isinstance(ns, int) or not 0 <= ns < MAX_NS or not isinstance(step, int) or step < 0:
            raise WrongValue(f"time_ns = {ns!r}, step = {step!r}: expected whole numbers from 0 to 2^63 - 1")
        if self.role == "plant":
            step = step or model.step_within(ns)
            self._step = max(0, step)
            return ({"time_ns": None if model.start_ns is None else ns} if step > 0 else None), step
        if model.start_ns is None:
            if step == 0:
                raise WrongValue("the mesh counts steps and has no times: give step=, or [mesh] start_time")
            self._step = step
            return {"time_ns": ns, "time_error_ns": None}, step
        self._step = max(0, model.step_within(ns))
        declared = model.sensors[self.name].get("time_error_ns", 0)
        given = max(time_error_ns, math.ceil(_exact_ns(time_error)[0]))
        if given < 0:
            raise WrongValue(f"time_error = {time_error!r}: expected 0 or more seconds")
        return {"time_ns": ns, "time_error_ns": unknown + given + declared}, step

    def _put(self, model: Model, topic: str, step: int, fields: Mapping[str, Any]) -> None:
        with self._lock:
            if model.digest != self._digest:
                self._digest = model.digest
                self._undeclare()  # its cache holds what the mesh before could use
            key, now = self._mesh.key(topic, self.name), clock.time_ns()
            if topic not in self._publishers:
                self._publishers[topic] = self._mesh.declare_publisher(self._session, key)
            message = {
                "v": 1, "src": f"{self.role}/{self.name}", "boot": self._boot, "seq": self._sequences[topic],
                "step": step, "sent_ns": now, "origin_ns": now, "model": model.digest,
            } | dict(fields)  # fmt: skip
            self._sequences[topic] += 1
            self._publishers[topic].put(msgpack.packb(message), encoding=f"application/msgpack;lsu.{topic}/1")

    def publish_health(self, model: Model, links: int, reasons: Sequence[str]) -> None:
        """How this source does; the mesh says it once a second."""
        counters = {name: float(count) for name, count in self.counters.items()} | {"links": float(links)}
        level = "WARN" if reasons else "OK"
        fields = {"role": self.role, "level": level, "reasons": list(reasons), "counters": counters}
        more = {"started_ns": self._started_ns, "host": socket.gethostname()}
        self._put(model, "health", self._step, fields | more)

    def _undeclare(self) -> None:
        for publisher in self._publishers.values():
            publisher.undeclare()
        self._publishers.clear()

    def close(self) -> None:
        """Leave the mesh; :meth:`Mesh.close` does it too."""
        with self._lock:
            self._undeclare()
            self._token.undeclare()


class Mesh:
    """A mesh that this program has joined; a context manager. :func:`connect` makes it."""

    def __init__(self, settings: Settings) -> None:
        self.name = settings.mesh
        self._settings = settings
        self._sessions: dict[str, Any] = {}
        self._sources: dict[tuple[str, str], Source] = {}
        self._streams: list[Stream[Any]] = []
        self._declared: list[Any] = []
        self._model: Model | None = None
        self._answered_at = self._began = clock.monotonic()
        self._digests: list[str] = []
        self._changed = threading.Condition(threading.RLock())
        self._is_closed = False
        self._thread = threading.Thread(target=self._watch, name="lsu-mesh client", daemon=True)
        if not settings.uses_tls:
            self._session(READER)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Leave the mesh, and end the iterations over its estimates."""
        with self._changed:
            if self._is_closed:
                return
            self._is_closed = True
            self._changed.notify_all()
        self._thread.join()
        for stream in self._streams:
            stream.close()
        for one in [*self._declared, *self._sources.values()]:
            try:
                one.close() if isinstance(one, Source) else one.undeclare()
            except zenoh.ZError:
                continue
        for session in self._sessions.values():
            session.close()

    def sensor(self, name: str) -> Source:
        """The sensor of that name, which this process is from now on: it is seen in ``lsu-mesh health``.

        It returns when somebody listens and the links have settled, or after two seconds.

        Raises :class:`NoMesh`, :class:`NotAllowed`, and :class:`WrongValue` where the mesh has no such sensor.
        """
        return self._source("sensor", name)

    def plant(self, name: str | None = None) -> Source:
        """The plant, which tells the inputs."""
        return self._source("plant", name or self.model().plant or "plant")

    def _source(self, role: str, name: str) -> Source:
        with self._changed:
            known = self._sources.get((role, name))
            if known is not None:
                return known
            session = self._session(name)
            source = self._sources[role, name] = Source(self, session, role, name=name)
        topic = "input" if role == "plant" else "measurement"
        is_bank = role == "sensor" and self.model().raw.get("instances") is not None
        self._settle(session, self.key("bank_measurement" if is_bank else topic, name))
        return source

    def _settle(self, session: Any, key: str) -> None:
        """Wait for the links, a moment: filters take no live data from caches, so what is sent before is lost."""
        probe, links, since = session.declare_publisher(key), -1, clock.monotonic()
        end = since + SETTLE_S
        while (now := clock.monotonic()) < end:
            if (linked := self.links()) != links:
                links, since = linked, now
            if now > since + SETTLED_S and probe.matching_status.matching:
                break
            clock.sleep(0.02)
        probe.undeclare()

    def estimates(self, name: str, *, history: int = 1, keep: int = 1024) -> Stream[Estimate]:
        """What the filter or fusion of that name publishes, from its last ``history`` estimates on."""
        stream: Stream[Estimate] = Stream(keep)
        self._subscribe(("posterior", "fused"), name, stream, made=self._estimate, history=history)
        return stream

    def bank(self, name: str, *, history: int = 1, keep: int = 64) -> Stream[BankEstimate]:
        """What the bank, or the fusion of banks, of that name publishes of all its targets."""
        stream: Stream[BankEstimate] = Stream(keep)
        self._subscribe(("bank_posterior", "bank_fused"), name, stream, made=self._bank_estimate, history=history)
        return stream

    def events(self, name: str = "*", *, keep: int = 1024) -> Stream[Event]:
        """What the peers of the mesh tell people, from now on."""
        stream: Stream[Event] = Stream(keep)
        self._subscribe(("event",), name, stream, made=_event, history=0)
        return stream

    def latest(self, name: str, timeout: float = 2.0, *, target: int | None = None) -> Estimate | None:
        """The newest estimate of a filter or fusion, or of one target of a bank; None where nobody answers.

        Raises :class:`WrongValue` where the bank has no such target, or has published nothing yet.
        """
        session, found, errors = self._session(READER), [], list[str]()
        for topic in ("posterior", "fused"):
            key = self.key(topic, name if target is None else f"{name}/{target}")
            for reply in session.get(key, timeout=timeout):
                if reply.ok is not None:
                    found.append(msgpack.unpackb(reply.ok.payload.to_bytes()))
                elif target is not None and reply.err is not None:
                    errors.append(reply.err.payload.to_string())
        if errors and not found:
            raise WrongValue(errors[0])
        newest = max(found, key=lambda message: int(message["step"]), default=None)
        return None if newest is None else self._estimate(name, newest)

    def _subscribe(
        self, topics: Sequence[str], name: str, stream: Stream[T], *, made: Callable[[str, dict[str, Any]], T],
        history: int,
    ) -> None:  # fmt: skip
        def came(sample: Any) -> None:
            try:
                message = msgpack.unpackb(sample.payload.to_bytes())
                one = made(str(sample.key_expr).rpartition("/")[2], message) if message["v"] == 1 else None
            except (ValueError, KeyError, TypeError, msgpack.UnpackException):
                return  # no message of this protocol
            if one is not None:
                stream.put(one)

        session = self._session(READER)
        self._streams.append(stream)
        for topic in topics:
            self._declared.append(
                ext.declare_advanced_subscriber(
                    session, self.key(topic, name), came,
                    history=ext.HistoryConfig(detect_late_publishers=True, max_samples=history) if history else None,
                    recovery=ext.RecoveryConfig(heartbeat=True, periodic_queries=None),
                )
            )  # fmt: skip

    def _estimate(self, name: str, raw: dict[str, Any]) -> Estimate:
        model = self._model
        time_ns = None if model is None or model.digest != raw["model"] else model.time_of(raw["step"])
        common = ("lower", "upper", "point", "status", "guarantee", "support")
        return Estimate(name, raw["step"], time_ns, **{key: raw[key] for key in common}, raw=raw)

    def _bank_estimate(self, name: str, raw: dict[str, Any]) -> BankEstimate:
        model = self._model
        time_ns = None if model is None or model.digest != raw["model"] else model.time_of(raw["step"])
        return BankEstimate.read(name, time_ns, raw)

    def key(self, topic: str, name: str) -> str:
        """The key of a topic of a peer."""
        return f"lsu/v1/{self.name}/{topic}/{name}"

    def declare_publisher(self, session: Any, key: str) -> Any:
        """A publisher whose messages late subscribers get too."""
        cached = LEAST_CACHED if self._model is None else math.ceil(CACHED_S / self._model.dt)
        if "/bank_" not in key:  # messages of banks are large
            cached = max(LEAST_CACHED, cached)
        return ext.declare_advanced_publisher(
            session, key, congestion_control=zenoh.CongestionControl.DROP, cache=ext.CacheConfig(cached),
            publisher_detection=True,
            sample_miss_detection=ext.MissDetectionConfig(heartbeat=HEARTBEAT_S, sporadic_heartbeat=None),
        )  # fmt: skip

    def model(self) -> Model:
        """What the mesh last answered about itself; waits for the first answer.

        Raises :class:`NoMesh` after ``wait`` seconds; the text says who was asked, and what was found there.
        """
        told, reason, wait = "", "", self._settings.wait
        end = math.inf if wait is None else clock.monotonic() + wait
        while True:
            with self._changed:
                if self._model is None and not self._is_closed:
                    self._changed.wait(max(0.0, min(TELL_AFTER_S, end - clock.monotonic())))
                if self._model is not None:
                    return self._model
                if self._is_closed:
                    raise NoMesh(f"mesh {self.name!r}: this program has left it")
            if clock.monotonic() >= end:
                raise NoMesh(self.why_silent())
            if self._settings.tell is not None:
                words = self.why_silent()
                reason, before = re.sub(r"\d", "", words), reason
                if reason != told and (before == reason or not self.links()):
                    self._settings.tell(words)  # of a mesh that starts, what lasts
                    told = reason

    def links(self) -> int:
        """How many peers and routers this program is connected to."""
        found = [session.info for session in self._sessions.values()]
        return max((len(info.peers_zid()) + len(info.routers_zid()) for info in found), default=0)

    def why_silent(self) -> str:
        """Why nobody answers, as far as it can be known from here."""
        asked, links = f"lsu/v1/{self.name}/model", self.links()
        if not links:
            found = "; ".join(_found_at(endpoint) for endpoint in self._settings.connect)
            return f"nobody answers {asked}, trying {', '.join(self._settings.connect)}: {found}"
        session = next(iter(self._sessions.values()))
        replies = session.liveliness().get("lsu/v1/*/live/*", timeout=1.0)
        names = sorted({str(reply.ok.key_expr).split("/")[2] for reply in replies if reply.ok is not None})
        there = f"peers of {', '.join(map(repr, names))} are there" if names else "no peer shows itself"
        words = f"connected to {links}, {there}, but nobody answers {asked}"
        if self.name in names:
            return f"{words}: wait for its filters and fusions, or start one"
        remedy = f"give the name of the mesh, not {self.name!r}" if names else "start its filters"
        if self._settings.uses_tls:
            shown = ", ".join(repr(common_name(self._settings.file("certificate", one))) for one in self._sessions)
            remedy += f"; or the peers' access control does not know {shown}, the name in this program's certificate"
        return f"{words}: {remedy}"

    def _watch(self) -> None:
        """Ask for the model and tell the health, once a second; at once where links change."""
        ask_at, links = 0.0, -1
        while True:
            with self._changed:
                self._changed.wait(LOOK_EVERY_S)
                if self._is_closed:
                    return
            now, linked = clock.monotonic(), self.links()
            if now < ask_at and linked == links:
                continue
            is_due, links = now >= ask_at, linked
            try:
                self._ask()
                if is_due:
                    ask_at = now + ASK_EVERY_S
                    self._tell_health(linked)
            except zenoh.ZError:
                continue  # a lost link: asked again soon

    def _ask(self) -> None:
        session = next(iter(list(self._sessions.values())), None)
        if session is None:
            return
        answers: dict[str, Model] = {}
        none = zenoh.ConsolidationMode.NONE
        for reply in session.get(f"lsu/v1/{self.name}/model", consolidation=none, timeout=ANSWER_S):
            if reply.ok is not None:
                one = Model.read(msgpack.unpackb(reply.ok.payload.to_bytes()))
                answers[one.digest] = one
        if not answers:
            return
        with self._changed:
            self._answered_at, self._digests = clock.monotonic(), sorted(answers)
            if self._model is None or self._model.digest not in answers:  # of two starts the earlier one stands
                self._model = min(answers.values(), key=lambda one: (one.start_ns or 0, one.digest))
            self._changed.notify_all()

    def _tell_health(self, links: int) -> None:
        if self._model is None:
            return
        silent = clock.monotonic() - self._answered_at
        reasons = [f"nobody answers the model query for {silent:.0f} s"] if silent > SILENT_S else []
        if len(self._digests) > 1:
            reasons.append(f"the mesh runs with {len(self._digests)} models: {', '.join(self._digests)}")
        for source in list(self._sources.values()):
            source.publish_health(self._model, links, reasons)

    def _session(self, name: str) -> Any:
        """The session for a name: its own where certificates say who is who, else one for all."""
        with self._changed:
            name = name if self._settings.uses_tls else READER
            if name not in self._sessions:
                try:
                    self._sessions[name] = zenoh.open(_configuration(self._settings, name))
                except zenoh.ZError as error:
                    raise MeshError(f"no Zenoh session with {', '.join(self._settings.connect)}: {error}") from None
            return self._sessions[name]


def _event(name: str, raw: dict[str, Any]) -> Event:
    return Event(source=raw["src"], **{key: raw[key] for key in ("level", "code", "text", "about")}, raw=raw)


def _found_at(endpoint: str) -> str:
    """What is at an endpoint, where no session comes about."""
    protocol, _, rest = endpoint.partition("/")
    host, _, port = rest.partition("?")[0].partition("#")[0].rpartition(":")
    try:
        found = socket.getaddrinfo(host.strip("[]"), int(port))
        if protocol not in ("tcp", "tls"):
            return f"{host} is known, and no session comes about"
        socket.create_connection((str(found[0][4][0]), int(port)), timeout=1.0).close()
        return f"{rest} takes connections, but no session comes about: {_NO_SESSION.get(protocol, '')}"
    except socket.gaierror as error:
        return f"{host}: name not known ({error.strerror})"
    except (OSError, ValueError) as error:
        return f"{rest}: {getattr(error, 'strerror', None) or error}"


_NO_SESSION = {
    "tcp": "it is no Zenoh peer, or it wants TLS (entry = tls/…)",
    "tls": "it refuses this certificate, or its own is not of this authority and host",
}


def common_name(certificate: Path) -> str:
    """The name in a certificate: the last common name in it, which is the subject's."""
    import ssl

    try:
        der = ssl.PEM_cert_to_DER_cert(certificate.read_text(encoding="ascii").strip())
    except (OSError, ValueError) as error:
        raise NotAllowed(f"{certificate}: is no certificate that can be read: {error}") from None
    at = der.rfind(_COMMON_NAME) + len(_COMMON_NAME)
    return der[at + 2 : at + 2 + der[at + 1]].decode(errors="replace")


def _configuration(settings: Settings, name: str) -> zenoh.Config:
    retry = {"period_init_ms": 200, "period_max_ms": 1000, "period_increase_factor": 2}
    listen = settings.listen or (f"{'tls' if settings.uses_tls else 'tcp'}/127.0.0.1:0",)
    values: dict[str, object] = {
        "mode": settings.mode,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": True,
        # this end opens the links, because the peers need not reach this host
        "scouting/gossip/autoconnect_strategy": {"peer": {"to_router": "always", "to_peer": "always"}},
        "connect/endpoints": list(settings.connect),
        "connect/timeout_ms": -1,
        "connect/exit_on_failure": False,
        "connect/retry": retry,
        "listen/endpoints": list(listen) if settings.mode != "client" else [],
        "transport/link/tx/lease": LEASE_MS,
        "transport/link/tx/queue/congestion_control/block/wait_before_close": 500_000,
        "transport/shared_memory/enabled": False,
        "timestamping/enabled": True,
    }
    values |= _security(settings, name) if settings.uses_tls else {}
    configuration = zenoh.Config()
    for path, value in values.items():
        configuration.insert_json5(path, json.dumps(value))
    for item in settings.zenoh:
        path, _, text = item.partition(":" if ":" in item.partition("=")[0] else "=")
        configuration.insert_json5(path, text)
    return configuration


def _security(settings: Settings, name: str) -> dict[str, object]:
    """The certificate of a name; :class:`NotAllowed` where it is of another one, whose rights it would give."""
    files = {what: settings.file(what, name) for what in ("authority", "certificate", "key")}
    for what, file in files.items():
        if not file.is_file():
            remedy = "`lsu-mesh keys init` makes it; copy it to this host"
            raise NotAllowed(f"[network.tls] {what}: there is no file {file} for {name!r}; {remedy}")
    shown = common_name(files["certificate"])
    if settings.tls.get("access_control", True) and shown != name:
        may = "read everything and publish nothing" if shown == READER else f"publish as {shown!r} and nobody else"
        text = f"is the certificate of {shown!r}, which may {may}; this needs the one of {name!r}"
        raise NotAllowed(f"{files['certificate']}: {text}: `lsu-mesh keys init` makes it")
    tls = {
        "root_ca_certificate": str(files["authority"]), "enable_mtls": True,
        "listen_certificate": str(files["certificate"]), "listen_private_key": str(files["key"]),
        "connect_certificate": str(files["certificate"]), "connect_private_key": str(files["key"]),
        "verify_name_on_connect": bool(settings.tls.get("verify_hosts", True)), "close_link_on_expiration": True,
    }  # fmt: skip
    return {"transport/link/tls": tls, "transport/link/protocols": ["tls", "quic"]}
