"""Sees everything that every process publishes and takes, and raises :class:`InvariantBroken` at the first lie."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.filters.registry import filter_class
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.messages import (
    Event,
    Fused,
    Health,
    Input,
    Measurement,
    Message,
    Posterior,
    Prediction,
    Reference,
    Smoothed,
    Truth,
)
from lsu_mesh.mesh.nodes.node import Node
from lsu_mesh.mesh.sets import to_support
from lsu_mesh.mesh.simulator.broken import InvariantBroken
from lsu_mesh.mesh.simulator.provenance import Provenance
from lsu_mesh.mesh.simulator.recomputation import Recomputation
from lsu_mesh.mesh.simulator.recorder import RecorderSink

FALSE_ALARMS = ("contradiction", "reset", "measurement-changed", "input-changed", "source-rejected", "quarantined")
"""Events that must not occur in a mesh whose sources are all right."""

NO_ACCUSATION = ("status restarted",)
"""Reasons why a fusion leaves a sound source out: it has only just begun again."""

EXACTLY = 4
"""Every so many sets the support itself is asked for the truth, in exact arithmetic; the bounds are always."""


@dataclass
class Life:
    """One process from its start to its death."""

    sequences: dict[str, int] = field(default_factory=dict)
    """Next sequence number by topic."""
    taken: set[Reference] = field(default_factory=set)
    """Every message that was admitted."""
    revisions: dict[int, int] = field(default_factory=dict)
    """Next revision by step."""


class Invariants:
    """Checks what can be checked at once; ``X`` (T, n) holds the true states of steps 1 … T."""

    def __init__(self, configuration: Configuration, X: NDArray[np.float64]) -> None:
        self._truth: list[list[float]] = X.tolist()
        self._has_estimates = any(
            settings.adopt or filter_class(settings.kind).guarantee != "declared"
            for settings in configuration.filters.values()
        )
        self._lives: dict[str, Life] = {}
        self._values: dict[tuple[str, str, int, int], list[float] | list[float | None]] = {}
        """What was said first, by topic, name, step and time."""
        self._provenance = Provenance(configuration)
        self._recomputation = Recomputation(configuration)
        self._published: dict[tuple[str, str], set[int]] = {}
        """Sequence numbers by (topic/name, boot)."""
        self._stored: set[Reference] = set()
        self._stored_count = 0
        self._looked: dict[tuple[str, str, str], int] = {}
        """How far the recording was compared, by recorder's boot, key, and the key's boot."""
        self.newest: dict[str, dict[int, Posterior]] = {}
        """By estimator and step, the last that was published."""
        self.health: dict[str, Health] = {}
        self.sets = 0
        """Published sets that were checked."""
        self.untrue_times = 0
        """Data that a node refused because its clock says that their time cannot be true."""

    def began(self, node: Node) -> None:
        """A process has started."""
        self._lives[node.boot] = Life()
        self.health.pop(node.name, None)

    def admitted(self, node: Node, message: Message) -> None:
        """A message was admitted; that never happens twice."""
        taken = self._lives[node.boot].taken
        if message.reference in taken:
            raise InvariantBroken("dedupe", f"{node.role}/{node.name} took {message.reference} twice")
        taken.add(message.reference)
        self._recomputation.admitted(node, message)

    def published(self, node: Node, message: Message) -> None:
        """A process has published; every message must be true."""
        self._check_sequence(node, message)
        if isinstance(message, Prediction | Posterior | Smoothed):
            self._check_truth(message)
        if isinstance(message, Posterior):
            self._check_posterior(node, message)
        elif isinstance(message, Smoothed):
            self._check_smoothed(node, message)
        elif isinstance(message, Truth):
            self._check_same(message, message.x)
        elif isinstance(message, Input):
            self._check_same(message, message.u)
        elif isinstance(message, Measurement):
            self._check_same(message, message.y, message.time_ns)
        elif isinstance(message, Event) and (message.level == "ERROR" or message.code in FALSE_ALARMS):
            raise InvariantBroken("false alarm", f"{message.src} says {message.code}: {message.text}")
        elif isinstance(message, Health):
            self.health[node.name] = message
            if isinstance(node, RecorderSink):
                self._check_flushed(node, message)
        self._provenance.record(message)

    def ran(self, node: Node) -> None:
        """A process has done all that it could with what it had."""
        self._recomputation.check(node, self.newest.get(node.name, {}))

    # -- single checks

    def _check_sequence(self, node: Node, message: Message) -> None:
        life = self._lives[node.boot]
        expected = life.sequences.get(message.topic, 0)
        if (message.seq, message.boot, message.src) != (expected, node.boot, f"{node.role}/{node.name}"):
            raise InvariantBroken("sequence", f"{message.reference}, expected number {expected} of {node.boot}")
        life.sequences[message.topic] = expected + 1
        self._published.setdefault((f"{message.topic}/{message.name}", message.boot), set()).add(message.seq)

    def _check_same(self, message: Message, values: list[float] | list[float | None], time_ns: int = 0) -> None:
        """A step has one truth and one input, a moment one measurement of each sensor, restarts or not."""
        first = self._values.setdefault((message.topic, message.name, message.step, time_ns), values)
        if first != values:
            text = f"{message.src} sent step {message.step} as {values}, before as {first}"
            raise InvariantBroken("restart", text)

    def _check_truth(self, message: Prediction | Posterior | Smoothed) -> None:
        if message.step > len(self._truth) or (self._has_estimates and message.guarantee != "declared"):
            return  # estimates may miss the truth, and where all filters are guaranteed every set has to hold it
        self.sets += 1
        x = self._truth[message.step - 1]
        for low, value, high in zip(message.lower, x, message.upper, strict=True):
            if not low <= value <= high:
                text = f"{message.src} step {message.step}: {value!r} is not in [{low!r}, {high!r}]"
                raise InvariantBroken("containment", text)
        if self.sets % EXACTLY == 0 and not to_support(message.support).contains(x):
            raise InvariantBroken("containment", f"{message.src} step {message.step}: {x} is not in the support")

    def _check_posterior(self, node: Node, message: Posterior) -> None:
        rejected = message.rejected if isinstance(message, Fused) else []
        accused = [one for one in rejected if one.reason not in NO_ACCUSATION]
        if message.status == "inconsistent" or accused:
            raise InvariantBroken("false alarm", f"{message.src} step {message.step}: {message.cause or message}")
        life = self._lives[node.boot]
        expected = life.revisions.get(message.step, 0)
        if message.revision != expected:
            text = f"{message.src} step {message.step}: revision {message.revision}, expected {expected}"
            raise InvariantBroken("revision", text)
        life.revisions[message.step] = expected + 1
        self._provenance.check(message, life.taken)
        self.newest.setdefault(node.name, {})[message.step] = message

    def _check_smoothed(self, node: Node, message: Smoothed) -> None:
        """It belongs to the newest set of its process, ``lag`` steps later."""
        base = self.newest.get(node.name, {}).get(message.step + message.lag)
        if base is None or (base.reference, base.revision) != (message.base, message.revision):
            text = f"{message.src} step {message.step}: made from {message.base}, the newest set of its step is another"
            raise InvariantBroken("smoothed", text)

    def _check_flushed(self, node: RecorderSink, message: Health) -> None:
        """Every message that is counted as flushed is stored, from the first that this recorder received."""
        stored = node.stored
        self._stored.update(stored[self._stored_count :])
        self._stored_count = len(stored)
        for key, seq in node.ledger.flushed.items():
            boot = node.ledger.boot(key)
            topic, name = key.split("/")
            src = f"{self._provenance.role_of(topic, name)}/{name}"
            first = node.ledger.first(key)
            for number in range(max(first, self._looked.get((node.boot, key, boot), 0)), seq + 1):
                if (topic, src, boot, number) not in self._stored and not node.ledger.is_lost(key, number):
                    raise InvariantBroken("recording", f"{key} is counted as flushed to {seq}, {number} is not stored")
            self._looked[node.boot, key, boot] = seq
