"""Every published set of a recording, recomputed and compared bit by bit; and whether it holds the true state."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import msgspec

from lsu_mesh.errors import LsuMeshError
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.measurement_time import placed
from lsu_mesh.mesh.messages import Fused, Measurement, Message, Prediction, Refused, Smoothed
from lsu_mesh.mesh.verification.archive import Archive, DoesNotFit, Unverifiable
from lsu_mesh.mesh.verification.banks import BankVerification
from lsu_mesh.mesh.verification.claims import Claims
from lsu_mesh.mesh.verification.containment import Containment
from lsu_mesh.mesh.verification.findings import Difference, Missing
from lsu_mesh.mesh.verification.lineage import Set
from lsu_mesh.mesh.verification.recompute import (
    FilterRecomputation,
    FusionRecomputation,
    Recomputation,
)
from lsu_mesh.mesh.verification.recomputed import Recomputed


@dataclass
class Verification:
    """What came of it. ``exact`` counts equal sets by (peer, topic), ``differences`` are in the order of arrival."""

    exact: Counter[tuple[str, str]] = field(default_factory=Counter)
    differences: list[Difference] = field(default_factory=list)
    unverifiable: list[Missing] = field(default_factory=list)
    outdated: Counter[str] = field(default_factory=Counter)
    """Of the unverifiable ones those that another arithmetic computed, by its number."""
    false_claims: list[Difference] = field(default_factory=list)
    """What sets say of themselves that their provenance, the events or the configuration contradict."""
    unproved: Counter[str] = field(default_factory=Counter)
    """Claims that cannot be recomputed, by name."""
    containment: Containment = field(default_factory=Containment)

    @property
    def holds(self) -> bool:
        """Whether what can be recomputed is equal, no claim is false, and no set that must hold the truth misses it."""
        return not self.differences and not self.false_claims and not self.containment.misses


def verify(configuration: Configuration, messages: Iterable[Message]) -> Verification:
    """Recompute the sets among ``messages`` (in the order of arrival), compare them, and look for the truth in them.

    ``configuration`` is that of the recorded run.
    """
    if configuration.instances is not None:
        return _verified_banks(configuration, messages)
    archive = Archive(_placed(configuration, messages))
    recomputations: dict[str, Recomputation] = {}
    found = Verification(containment=Containment.of(configuration, archive))
    claims = Claims(configuration, archive)
    for recorded in archive.sets():
        recomputation = recomputations.get(recorded.src)
        if recomputation is None:
            recomputation = recomputations[recorded.src] = _recomputation(configuration, archive, recorded)
        recomputed = _check(found, recomputation, recorded)
        if not isinstance(recorded, Smoothed):  # what one says of itself is its posterior's, and compared with that
            claims.check_lineage(recorded, recomputed)
        found.containment.check(recorded, claims.proved_guarantee(recorded))
    claims.check_processes()
    found.false_claims, found.unproved = claims.false, claims.unproved
    return found


def _verified_banks(configuration: Configuration, messages: Iterable[Message]) -> Verification:
    """The sets of a mesh of banks; what holds the truth is counted target by target."""
    banks = BankVerification(configuration, messages)
    banks.check()
    containment = Containment.of(configuration, Archive([]))
    containment.holding, containment.misses = banks.holding, banks.misses
    containment.excused = Counter(banks.excused)
    containment.archive.truth = {step: [] for step in banks.steps_with_truth}
    return Verification(
        exact=Counter(banks.exact),
        differences=banks.differences,
        unverifiable=banks.unverifiable,
        outdated=Counter(banks.outdated),
        containment=containment,
    )


def _placed(configuration: Configuration, messages: Iterable[Message]) -> Iterator[Message]:
    """The messages with the steps of their times, as peers take them; without measurements that peers refuse."""
    for message in messages:
        if isinstance(message, Measurement) and message.name in configuration.sensors:
            with suppress(Refused):
                yield placed(configuration, message)
        else:
            yield message


def _recomputation(configuration: Configuration, archive: Archive, recorded: Message) -> Recomputation:
    if isinstance(recorded, Fused):
        return FusionRecomputation(configuration, archive, recorded.name)
    return FilterRecomputation(configuration, archive, recorded.name)


def _check(found: Verification, recomputation: Recomputation, recorded: Set | Smoothed) -> Recomputed | None:
    """Compare one set; what it is by its provenance, or ``None`` where it cannot be recomputed.

    Equal is a proof, whatever number the arithmetic had. What differs by another arithmetic cannot be recomputed.
    """
    place = (recorded.src, recorded.topic, recorded.step, recorded.seq)
    recomputed: Recomputed | None
    different: tuple[str, Any, Any] | None
    try:
        if isinstance(recorded, Prediction):
            recomputed = recomputation.prediction(recorded)
        elif isinstance(recorded, Smoothed):
            recomputed = recomputation.smoothed(recorded)
        else:
            recomputed = recomputation.posterior(recorded)
        different = next(differences(recorded, recomputed.fields), None)
    except Unverifiable as reason:
        found.unverifiable.append(Missing(*place, str(reason)))
        return None
    except DoesNotFit as wrong:
        recomputed, different = None, (wrong.field, wrong.recorded, wrong.expected)
    except LsuMeshError as error:
        recomputed, different = None, ("base", "a set of the model", str(error))
    if different is None:
        found.exact[recorded.src, recorded.topic] += 1
        return recomputed
    other = recomputation.other_algorithm(recorded)
    if other is None:
        found.differences.append(Difference(*place, *different))
        return recomputed
    found.unverifiable.append(Missing(*place, other))
    found.outdated[other] += 1
    return None


def differences(recorded: Message, fields: Any) -> Iterator[tuple[str, Any, Any]]:
    """``(place, recorded, recomputed)`` of every number of ``fields`` that differs, even in the sign of a zero."""
    for name, value in sorted(fields.items(), key=lambda item: item[0] == "support"):
        yield from _compare(name, msgspec.to_builtins(getattr(recorded, name)), msgspec.to_builtins(value))


def _compare(place: str, old: Any, new: Any) -> Iterator[tuple[str, Any, Any]]:
    if msgspec.msgpack.encode(old) == msgspec.msgpack.encode(new):
        return
    if isinstance(old, dict) and isinstance(new, dict) and old.keys() == new.keys():
        for key in old:
            yield from _compare(f"{place}.{key}", old[key], new[key])
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for i, pair in enumerate(zip(old, new, strict=True)):
            yield from _compare(f"{place}[{i}]", *pair)
    else:
        yield place, old, new
