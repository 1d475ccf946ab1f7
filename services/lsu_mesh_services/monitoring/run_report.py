"""The report of a run: one row per filter and fusion, from the messages that they published.

Memory is bounded, however long a run: a step that can hardly be revised any more is only summed up.
"""

from __future__ import annotations

import math
import random
from array import array
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from lsu_mesh.mesh.access import recorded_topics
from lsu_mesh.mesh.admission import Admission
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.messages import Event, Health, Message, Posterior, Truth
from lsu_mesh.mesh.processes import Processes, words_of

KEPT_STEPS, KEPT_TRUTHS = 8192, 65536
"""Steps that an estimate may be revised in, and be judged in by a truth that comes later."""
MAX_LATENCIES = 65536
"""Of more latencies, a random sample of that size is kept."""
MAX_EVENTS = 1024


class Told(NamedTuple):
    """The newest revision of one step."""

    boot: str
    revision: int
    point: list[float]
    lower: list[float]
    upper: list[float]

    @property
    def width(self) -> float:
        """Mean of the widths of the bounds."""
        return float(np.mean(np.subtract(self.upper, self.lower)))


class Sample:
    """All numbers, or a uniform sample of them where there are many (reservoir)."""

    def __init__(self, most: int = MAX_LATENCIES) -> None:
        self.numbers = array("d")
        self._most, self._count = most, 0
        self._random = random.Random(0)

    def add(self, number: float) -> None:
        """One more."""
        self._count += 1
        if len(self.numbers) < self._most:
            self.numbers.append(number)
        elif (place := self._random.randrange(self._count)) < self._most:
            self.numbers[place] = number


@dataclass
class Track:
    """What one estimator published."""

    role: str
    kind: str
    told: dict[int, Told] = field(default_factory=dict)
    """The newest steps."""
    newest: int = 0
    outside: set[int] = field(default_factory=set)
    """Of these steps, those in which a revision did not hold the truth."""
    inconsistent: set[int] = field(default_factory=set)
    latencies_ms: Sample = field(default_factory=Sample)
    health: Health | None = None
    steps: int = 0
    """Of the steps that are summed up, how many; how many with a known truth, and so on."""
    known: int = 0
    squares: float = 0.0
    """Σ of the mean square errors."""
    widths: float = 0.0
    missed: int = 0
    contradicted: int = 0

    def sum_up(self, step: int, truth: list[float] | None) -> None:
        """Forget a step but for what it adds to the sums."""
        told = self.told.pop(step)
        self.steps += 1
        self.widths += told.width
        if truth is not None:
            self.known += 1
            self.squares += _square(told, truth)
        self.missed += step in self.outside
        self.contradicted += step in self.inconsistent
        self.outside.discard(step)
        self.inconsistent.discard(step)


@dataclass(frozen=True)
class Row:
    """Summary of one estimator; None where the run gives no number (no truth, no latency)."""

    name: str
    role: str
    kind: str
    steps: int
    last_step: int
    rmse: float | None
    inside: float | None
    width: float | None
    latency_p50_ms: float | None
    latency_p99_ms: float | None
    gaps: int
    refused: int
    inconsistent: int
    restarts: int = 0


class RunReport:
    """Collects messages and sums them up."""

    def __init__(self, configuration: Configuration) -> None:
        self.configuration = configuration
        self._gate = Admission(configuration, recorded_topics(configuration))
        self._truth: dict[int, list[float]] = {}
        self.tracks = {name: Track("filter", settings.kind) for name, settings in configuration.filters.items()}
        self.tracks |= {name: Track("fusion", "fusion") for name in configuration.fusion}
        self.events: deque[Event] = deque(maxlen=MAX_EVENTS)
        self.source_steps: dict[str, int] = {}
        self.links: dict[str, int] = {}
        """How many others each peer is connected to."""
        self.duplicates: dict[str, str] = {}
        """Peers that ran more than once, and where."""
        self._processes = Processes()
        self.used: set[str] = set()
        """Names of those whose messages went into an estimate."""

    def deliver(self, key: str, payload: bytes, arrival_ns: int) -> None:
        """Take a payload as it came."""
        message = self._gate.admit(key, payload)
        if message is not None:
            self.record(message, arrival_ns)

    def record(self, message: Message, arrival_ns: int) -> None:
        """Take a message that was let through before."""
        if isinstance(message, Truth):
            self._record_truth(message)
        elif isinstance(message, Posterior):
            self._record_posterior(message, arrival_ns)
        elif isinstance(message, Event):
            self.events.append(message)
        elif isinstance(message, Health):
            self._record_processes(message, arrival_ns)
            self.links[message.name] = int(message.counters.get("links", 0))
            if message.name in self.tracks:
                self.tracks[message.name].health = message
            elif message.role in ("plant", "sensor"):
                self.source_steps[message.name] = message.step

    def _record_processes(self, message: Health, arrival_ns: int) -> None:
        self._processes.record(message, arrival_ns)
        if len(living := self._processes.of(message.name, arrival_ns)) > 1:
            self.duplicates[message.src] = f"{message.src} ran as {words_of(living)}"

    def _record_truth(self, message: Truth) -> None:
        self._truth[message.step] = message.x
        if len(self._truth) > KEPT_TRUTHS:
            del self._truth[next(iter(self._truth))]
        for track in self.tracks.values():
            told = track.told.get(message.step)
            if told is not None and not _holds(told, message.x):
                track.outside.add(message.step)

    def _record_posterior(self, message: Posterior, arrival_ns: int) -> None:
        track, step = self.tracks[message.name], message.step
        if step <= track.newest - KEPT_STEPS:
            return  # summed up already
        old = track.told.get(step)
        if old is None or old.boot != message.boot or message.revision >= old.revision:
            track.told[step] = Told(
                boot=message.boot,
                revision=message.revision,
                point=message.point,
                lower=message.lower,
                upper=message.upper,
            )
        self.used.update(reference[1].rpartition("/")[2] for reference in message.used)
        if message.status == "inconsistent":
            track.inconsistent.add(step)
        truth = self._truth.get(step)
        if truth is not None and not _holds(message, truth):
            track.outside.add(step)
        if old is None and any(reference[0] in ("measurement", "posterior") for reference in message.used):
            track.latencies_ms.add((arrival_ns - message.origin_ns) * 1e-6)
        if step > track.newest:
            track.newest = step
            self._sum_up(track)

    def _sum_up(self, track: Track) -> None:
        while (oldest := next(iter(track.told))) <= track.newest - KEPT_STEPS:
            track.sum_up(oldest, self._truth.get(oldest))

    def last_step(self) -> int:
        """The newest step that every estimator has reached."""
        return min((track.newest for track in self.tracks.values()), default=0)

    def progress(self) -> int:
        """The newest step that any estimator has reached."""
        return max((track.newest for track in self.tracks.values()), default=0)

    def rows(self, restarts: Mapping[str, int] | None = None) -> list[Row]:
        """Filters by name, then fusions."""
        return [self._row(name, track, (restarts or {}).get(name, 0)) for name, track in self.tracks.items()]

    def _row(self, name: str, track: Track, restarts: int) -> Row:
        errors = [_square(told, self._truth[step]) for step, told in track.told.items() if step in self._truth]
        steps, known = track.steps + len(track.told), track.known + len(errors)
        widths = track.widths + sum(told.width for told in track.told.values())
        latencies = track.latencies_ms.numbers
        p50, p99 = np.percentile(latencies, [50, 99]) if latencies else (math.nan, math.nan)
        counters = track.health.counters if track.health else {}
        return Row(
            name=name,
            role=track.role,
            kind=track.kind,
            steps=steps,
            last_step=track.newest,
            rmse=math.sqrt((track.squares + sum(errors)) / known) if known else None,
            inside=1.0 - (track.missed + len(track.outside)) / known if known else None,
            width=widths / steps if steps else None,
            latency_p50_ms=_number(p50),
            latency_p99_ms=_number(p99),
            gaps=int(counters.get("gaps", 0)),
            refused=int(sum(count for key, count in counters.items() if key.startswith("refused."))),
            inconsistent=track.contradicted + len(track.inconsistent),
            restarts=restarts,
        )


def _square(told: Told, x: list[float]) -> float:
    """Mean square error of the point estimate."""
    return float(np.mean(np.subtract(told.point, x) ** 2))


def _holds(posterior: Posterior | Told, x: list[float]) -> bool:
    return all(low <= value <= high for low, value, high in zip(posterior.lower, x, posterior.upper, strict=True))


def _number(value: float) -> float | None:
    return None if math.isnan(value) else float(value)
