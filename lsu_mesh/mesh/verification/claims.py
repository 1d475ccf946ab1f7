"""The claims of sets, proved: guarantee, descent, status, epoch, missing, rejected, quarantined, policy.

Each claim is recomputed from provenance, events and configuration. One that is false is named with its set; one that
cannot be recomputed is counted by name, and nothing is concluded from it.
"""

from __future__ import annotations

from collections import Counter

from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.messages import Event, Fused, Guarantee, Message, Posterior, Prediction, Reference, Smoothed
from lsu_mesh.mesh.verification.archive import Archive
from lsu_mesh.mesh.verification.findings import Difference
from lsu_mesh.mesh.verification.lineage import Lineage, Set
from lsu_mesh.mesh.verification.presence import Presence, by_process
from lsu_mesh.mesh.verification.process_claims import ProcessClaims
from lsu_mesh.mesh.verification.recomputed import Recomputed


class Claims:
    """The claims of all sets of a recording."""

    def __init__(self, configuration: Configuration, archive: Archive) -> None:
        self._configuration = configuration
        self._archive = archive
        self._lineage = Lineage(configuration, archive)
        self._presence = Presence(configuration, archive)
        self._recomputed: dict[Reference, Recomputed | None] = {}
        self.false: list[Difference] = []
        self.unproved: Counter[str] = Counter()
        """By claim and why."""

    def proved_guarantee(self, message: Set | Smoothed) -> Guarantee | None:
        """The guarantee that a set has by all that it descends from; ``None`` where that cannot be told."""
        return self._lineage.proved(message.base if isinstance(message, Smoothed) else message.reference)

    def check_lineage(self, message: Set, recomputed: Recomputed | None) -> None:
        """What one set descends from, after all that it was made from; and whether it is of the configuration."""
        self._recomputed[message.reference] = recomputed
        false, unproved = self._lineage.check(message, recomputed)
        if isinstance(message, Fused):
            settings = self._configuration.fusion[message.name]
            configured = {"policy": settings.policy, "faults": settings.faults}
            false |= {name: value for name, value in configured.items() if getattr(message, name) != value}
        for name, expected in false.items():
            self._add(message, name, expected)
        self.unproved.update(unproved)

    def check_processes(self) -> None:
        """Claims that need all messages of a process, in their order."""
        kinds = (Posterior, Prediction)
        sets = by_process(message for message in self._archive.messages(Message) if isinstance(message, kinds))
        events = by_process(self._archive.messages(Event))
        for process, found in sets.items():
            listed = [one for one in found if isinstance(one, Posterior | Prediction)]
            earlier = [one.epoch for (src, boot), others in sets.items() for one in others
                       if src == process[0] and boot != process[1] and isinstance(one, Posterior)]  # fmt: skip
            told = [one for one in events.get(process, []) if isinstance(one, Event)]
            claims = ProcessClaims(listed, told, earlier)
            for one in claims.check(self._recomputed):
                self._add(one.message, one.field, one.expected)
            self.unproved.update(claims.unproved)
            posteriors = sorted((one for one in listed if isinstance(one, Posterior)), key=lambda one: one.seq)
            for message in posteriors:
                for one in self._presence.check(message, self._recomputed.get(message.reference)):
                    self._add(one.message, one.field, one.expected)
            fused = [one for one in posteriors if isinstance(one, Fused)]
            for one in self._presence.check_quarantined(fused) if fused else ():
                self._add(one.message, one.field, one.expected)
        self.unproved.update(self._presence.unproved)

    def _add(self, message: Set, field: str, expected: object) -> None:
        place = (message.src, message.topic, message.step, message.seq)
        self.false.append(Difference(*place, field, getattr(message, field), expected))
