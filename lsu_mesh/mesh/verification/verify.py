"""Every published set of a recording, recomputed and compared bit by bit; and whether it holds the true state."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field

from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.measurement_time import placed
from lsu_mesh.mesh.messages import Measurement, Message, Refused, Smoothed
from lsu_mesh.mesh.verification.archive import Archive
from lsu_mesh.mesh.verification.banks import BankVerification
from lsu_mesh.mesh.verification.claims import Claims
from lsu_mesh.mesh.verification.comparison import Outcome
from lsu_mesh.mesh.verification.containment import Containment
from lsu_mesh.mesh.verification.findings import Difference, Missing
from lsu_mesh.mesh.verification.lineage import Set
from lsu_mesh.mesh.verification.side_by_side import compared


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


def verify(configuration: Configuration, messages: Iterable[Message], processes: int = 1) -> Verification:
    """Recompute the sets among ``messages`` (in the order of arrival), compare them, and look for the truth in them.

    ``configuration`` is that of the recorded run. With ``processes`` > 1 the peers' sets are recomputed side by side,
    with the same result.
    """
    if configuration.instances is not None:
        return _verified_banks(configuration, messages)
    archive = Archive(_placed(configuration, messages))
    found = Verification(containment=Containment.of(configuration, archive))
    claims = Claims(configuration, archive)
    sets = archive.sets()
    for recorded, outcome in zip(sets, compared(configuration, archive, sets, processes), strict=True):
        _count(found, recorded, outcome)
        if not isinstance(recorded, Smoothed):  # what one says of itself is its posterior's, and compared with that
            claims.check_lineage(recorded, outcome.recomputed)
        found.containment.check(recorded, claims.proved_guarantee(recorded))
    claims.check_processes()
    found.false_claims, found.unproved = claims.false, claims.unproved
    return found


def _count(found: Verification, recorded: Set | Smoothed, outcome: Outcome) -> None:
    place = (recorded.src, recorded.topic, recorded.step, recorded.seq)
    if outcome.missing:
        found.unverifiable.append(Missing(*place, outcome.missing))
        if outcome.is_outdated:
            found.outdated[outcome.missing] += 1
    elif outcome.different is not None:
        found.differences.append(Difference(*place, *outcome.different))
    else:
        found.exact[recorded.src, recorded.topic] += 1


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
