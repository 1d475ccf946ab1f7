"""What a run was like: one row per filter and fusion, from the messages that they published."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.gate import Gate
from lsu_mesh.mesh.messages import TYPES, Event, Fused, Health, Message, Posterior, Truth


@dataclass
class Track:
    """What one estimator published."""

    role: str
    kind: str
    posteriors: dict[int, Posterior] = field(default_factory=dict)
    """The newest revision of each step."""
    every: int = 0
    outside: set[int] = field(default_factory=set)
    latencies_ms: list[float] = field(default_factory=list)
    health: Health | None = None
    inconsistent: set[int] = field(default_factory=set)


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
        self._gate = Gate(configuration, TYPES)
        self._truth: dict[int, list[float]] = {}
        self.tracks = {name: Track("filter", settings.kind) for name, settings in configuration.filters.items()}
        self.tracks |= {name: Track("fusion", "fusion") for name in configuration.fusion}
        self.events: list[Event] = []
        self.source_steps: dict[str, int] = {}
        self.links: dict[str, int] = {}
        """How many others each peer is connected to."""

    def deliver(self, key: str, payload: bytes, arrival_ns: int) -> None:
        """Take a payload as it came."""
        message = self._gate.admit(key, payload)
        if message is not None:
            self.note(message, arrival_ns)

    def note(self, message: Message, arrival_ns: int) -> None:
        """Take a message that was let through before."""
        if isinstance(message, Truth):
            self._truth[message.step] = message.x
            for track in self.tracks.values():
                posterior = track.posteriors.get(message.step)
                if posterior is not None and not _holds(posterior, message.x):
                    track.outside.add(message.step)
        elif isinstance(message, Posterior):
            self._note_posterior(message, arrival_ns)
        elif isinstance(message, Event):
            self.events.append(message)
        elif isinstance(message, Health):
            self.links[message.name] = int(message.counters.get("links", 0))
            if message.name in self.tracks:
                self.tracks[message.name].health = message
            elif message.role in ("plant", "sensor"):
                self.source_steps[message.name] = message.step

    def _note_posterior(self, message: Posterior, arrival_ns: int) -> None:
        track = self.tracks[message.name]
        track.every += 1
        old = track.posteriors.get(message.step)
        if old is None or old.boot != message.boot or message.revision >= old.revision:
            track.posteriors[message.step] = message
        if message.status == "inconsistent":
            track.inconsistent.add(message.step)
        truth = self._truth.get(message.step)
        if truth is not None and not _holds(message, truth):
            track.outside.add(message.step)
        if old is None and any(reference[0] in ("measurement", "posterior") for reference in message.used):
            track.latencies_ms.append((arrival_ns - message.origin_ns) * 1e-6)

    def last_step(self) -> int:
        """The newest step that every estimator has reached."""
        return min((max(track.posteriors, default=0) for track in self.tracks.values()), default=0)

    def progress(self) -> int:
        """The newest step that any estimator has reached."""
        return max((max(track.posteriors, default=0) for track in self.tracks.values()), default=0)

    def rows(self, restarts: Mapping[str, int] | None = None) -> list[Row]:
        """Filters by name, then fusions."""
        return [self._row(name, track, (restarts or {}).get(name, 0)) for name, track in self.tracks.items()]

    def _row(self, name: str, track: Track, restarts: int) -> Row:
        known = [step for step in track.posteriors if step in self._truth]
        errors = np.array([np.subtract(track.posteriors[k].point, self._truth[k]) for k in known])
        widths = [np.mean(np.subtract(p.upper, p.lower)) for p in track.posteriors.values()]
        p50, p99 = np.percentile(track.latencies_ms, [50, 99]) if track.latencies_ms else (math.nan, math.nan)
        counters = track.health.counters if track.health else {}
        return Row(
            name=name,
            role=track.role,
            kind=track.kind,
            steps=len(track.posteriors),
            last_step=max(track.posteriors, default=0),
            rmse=float(np.sqrt(np.mean(errors**2))) if known else None,
            inside=1.0 - len(track.outside) / len(known) if known else None,
            width=float(np.mean(widths)) if widths else None,
            latency_p50_ms=_number(p50),
            latency_p99_ms=_number(p99),
            gaps=int(counters.get("gaps", 0)),
            refused=int(sum(count for key, count in counters.items() if key.startswith("refused."))),
            inconsistent=len(track.inconsistent),
            restarts=restarts,
        )


def _holds(posterior: Posterior | Fused, x: list[float]) -> bool:
    return all(low <= value <= high for low, value, high in zip(posterior.lower, x, posterior.upper, strict=True))


def _number(value: float) -> float | None:
    return None if math.isnan(value) else float(value)
