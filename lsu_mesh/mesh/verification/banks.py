"""The sets of banks, recomputed from what they used and compared bit by bit; and whether they hold the true states.

A bank goes from step to step, so that its sets are recomputed in order: from the prior, the domain or the sets that a
process began with, over the measurements that each message names. Where the recorder missed one, all that follows from
it is unverifiable.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from lsu_mesh.array_types import Flags
from lsu_mesh.errors import LsuMeshError
from lsu_mesh.mesh.bank_messages import (
    INCONSISTENT,
    BankFused,
    BankMeasurement,
    BankMessage,
    BankPosterior,
    BankSets,
    BankTruth,
)
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.estimation.bank_engine import BankEngine, published_sets
from lsu_mesh.mesh.estimation.bank_fusion_step import ALGORITHM, fuse_banks
from lsu_mesh.mesh.measurement_time import placed
from lsu_mesh.mesh.messages import Message, Reference, Refused
from lsu_mesh.mesh.verification.archive import Unverifiable
from lsu_mesh.mesh.verification.containment import Miss
from lsu_mesh.mesh.verification.findings import Difference, Missing

BROKEN = 1e-9
"""A measurement that exceeds its bound by more than this share of all that enters it, or of the bound, is untrue."""


class BankVerification:
    """What came of the sets of a recording of banks; ``exact`` and the others are as in ``Verification``."""

    def __init__(self, configuration: Configuration, messages: Iterable[Message]) -> None:
        self._configuration = configuration
        self._messages: dict[Reference, BankMessage] = {}
        for message in messages:
            if isinstance(message, BankMeasurement):
                try:
                    message = placed(configuration, message)
                except Refused:
                    continue
            if isinstance(message, BankMessage):
                self._messages.setdefault(message.reference, message)
        self._truth = {one.step: one for one in self._messages.values() if isinstance(one, BankTruth)}
        self._untrue = self._untrue_data()
        self.exact: list[tuple[str, str]] = []
        """Peer and topic of each message that is equal."""
        self.differences: list[Difference] = []
        self.unverifiable: list[Missing] = []
        self.outdated: list[str] = []
        self.holding = 0
        self.misses: list[Miss] = []
        self.excused: list[str] = []
        self._chains: dict[tuple[str, str], tuple[BankEngine, BankPosterior]] = {}

    @property
    def steps_with_truth(self) -> list[int]:
        """Steps whose true states are known."""
        return list(self._truth)

    def check(self) -> None:
        """All sets: each peer's in the order in which it published them."""
        sets = [one for one in self._messages.values() if isinstance(one, BankSets)]
        boots = list(dict.fromkeys(one.boot for one in sets))
        for message in sorted(sets, key=lambda one: (one.topic, one.src, boots.index(one.boot), one.seq)):
            self._check_one(message)
            self._check_truth(message)

    def _check_one(self, message: BankSets) -> None:
        place = (message.src, message.topic, message.step, message.seq)
        try:
            if isinstance(message, BankPosterior):
                algorithm, fields = self._posterior(message)
            else:
                assert isinstance(message, BankFused)
                algorithm, fields = ALGORITHM, fuse_banks([self._find(one, BankPosterior) for one in message.used])
        except Unverifiable as reason:
            self.unverifiable.append(Missing(*place, str(reason)))
            return
        except LsuMeshError as error:
            self.differences.append(Difference(*place, "base", message.base, str(error)))
            return
        found = next((name for name in fields if getattr(message, name) != fields[name]), None)
        if found is None:
            self.exact.append((message.src, message.topic))
        elif message.algorithm != algorithm:
            words = f"made by arithmetic {message.algorithm}, this version has {algorithm}"
            self.unverifiable.append(Missing(*place, words))
            self.outdated.append(words)
        else:
            self.differences.append(Difference(*place, *_first_difference(message, found, fields[found])))

    def _posterior(self, message: BankPosterior) -> tuple[int, dict[str, Any]]:
        """The number of the arithmetic, and the fields of a posterior by what it was made from."""
        chain = self._chains.pop((message.src, message.boot), None)
        engine, since = self._begun(message) if chain is None else (chain[0], chain[1].step)
        if chain is not None and message.base != chain[1].reference:
            raise Unverifiable(f"it was made from {message.base}, and the posterior before it is {chain[1].reference}")
        data = {one.name: one for one in (self._find(reference, BankMeasurement) for reference in message.used)}
        for _ in range(since, message.step):
            engine.predict()
        fields = engine.fields(engine.step(data))
        self._chains[message.src, message.boot] = (engine, message)
        return engine.algorithm, fields

    def _begun(self, message: BankPosterior) -> tuple[BankEngine, int]:
        """The bank at the sets that a process began with, and their step."""
        configuration, base = self._configuration, message.base
        settings, instances = configuration.filters[message.name], configuration.instances
        assert instances is not None
        if base == "prior":
            return BankEngine(configuration, settings, instances.priors(configuration.prior)), 1
        domain = configuration.base_model.domain
        if base == "domain" and domain is not None:
            engine = BankEngine(configuration, settings, [domain] * instances.count)
            engine.restarts(np.zeros(instances.count, dtype=np.bool_))
            return engine, message.step
        if isinstance(base, str):
            raise Unverifiable(f"a bank does not begin at {base!r}")
        before = self._find(base, BankPosterior)
        if before.boot == message.boot:
            raise Unverifiable("what the process held after an earlier step is not known: a message is missing")
        engine = BankEngine(configuration, settings, published_sets(before))
        engine.restarts(before.status_codes == INCONSISTENT)
        return engine, before.step

    def _find(self, reference: Reference, kind: type[Any]) -> Any:
        found = self._messages.get(reference)
        if not isinstance(found, kind):
            topic, src, boot, seq = reference
            raise Unverifiable(f"{topic} {seq} of {src} (boot {boot}) is not in the recording")
        return found

    # -- the truth

    def _check_truth(self, message: BankSets) -> None:
        truth = self._truth.get(message.step)
        if truth is None:
            return
        x, believed = truth.matrix("x"), message.status_codes != INCONSISTENT
        inside = ((message.matrix("lower") <= x) & (x <= message.matrix("upper"))).all(axis=1)
        self.holding += int((believed & inside).sum())
        for i in np.flatnonzero(believed & ~inside).tolist():
            if any(self._untrue[name][i] <= message.step for name in self._sensors_of(message)):
                self.excused.append("a measurement that exceeded its declared bound")
            else:
                words = f"instance {i}"
                self.misses.append(Miss(message.src, message.topic, message.step, message.seq, state=words))

    def _sensors_of(self, message: BankSets) -> tuple[str, ...]:
        filters, fusion = self._configuration.filters, self._configuration.fusion
        if message.name in filters:
            return filters[message.name].sensors
        return tuple(sensor for source in fusion[message.name].sources for sensor in filters[source].sensors)

    def _untrue_data(self) -> dict[str, Any]:
        """By sensor and instance the first step of a measurement that the truth shows to be untrue."""
        instances = self._configuration.instances
        assert instances is not None
        never = np.iinfo(np.int64).max
        first = {name: np.full(instances.count, never) for name in self._configuration.sensors}
        for message in self._messages.values():
            truth = self._truth.get(message.step) if isinstance(message, BankMeasurement) else None
            if isinstance(message, BankMeasurement) and truth is not None:
                rows = self._are_untrue(message, truth)
                first[message.name][rows] = np.minimum(first[message.name][rows], message.step)
        return first

    def _are_untrue(self, message: BankMeasurement, truth: BankTruth) -> Flags:
        sensor = self._configuration.sensors[message.name]
        C, r, x = np.array(sensor.C), np.array(sensor.r), truth.matrix("x")
        size = r + np.abs(x) @ np.abs(C.T)
        return np.asarray((np.abs(message.matrix("y") - x @ C.T) > r + BROKEN * size).any(axis=1))


def _first_difference(message: BankSets, field: str, expected: object) -> tuple[str, Any, Any]:
    """The first instance whose numbers differ, with what is recorded and recomputed."""
    recorded = getattr(message, field)
    if not isinstance(recorded, bytes) or not isinstance(expected, bytes) or len(recorded) != len(expected):
        return field, recorded, expected
    size = len(recorded) // message.instances
    pairs = [
        (recorded[first : first + size], expected[first : first + size]) for first in range(0, len(recorded), size)
    ]
    i = next(i for i, (old, new) in enumerate(pairs) if old != new)
    old, new = (list(one) if size % 8 else np.frombuffer(one, "<f8").tolist() for one in pairs[i])
    return f"{field}[{i}]", old, new
