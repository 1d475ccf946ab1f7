"""Which sources a step had: missing, rejected and quarantined ones, recomputed from provenance and recording.

A source that was used was not missing. One that was neither used nor rejected nor missing must have sent a message
without data. Whether the message of a missing source came late, or never, only the process itself can know: that is
counted by name.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence

from lsu_mesh.fusion.policies import POLICIES
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.estimation.fusion_step import ABANDONED, OUTVOTED
from lsu_mesh.mesh.estimation.quarantine import Quarantine
from lsu_mesh.mesh.messages import Fused, Measurement, Message, Posterior, Prediction
from lsu_mesh.mesh.verification.archive import Archive
from lsu_mesh.mesh.verification.process_claims import FalseClaim
from lsu_mesh.mesh.verification.recomputed import Recomputed


class Presence:
    """Checks the claims about sources of posteriors and fused sets."""

    def __init__(self, configuration: Configuration, archive: Archive) -> None:
        self._configuration = configuration
        self._archive = archive
        self.unproved: list[str] = []
        self._newest: dict[tuple[str, str], int] = {}
        """The newest epoch of each process that any message speaks of."""
        self._sets: dict[str, dict[str, list[Posterior]]] = {}
        """What each process of a filter or fusion published."""
        for message in archive.messages(Message):
            if isinstance(message, Posterior):
                self._sets.setdefault(message.name, {}).setdefault(message.boot, []).append(message)
            if isinstance(message, Posterior | Prediction):
                for src, boot, number in [(message.src, message.boot, message.epoch), *message.descent]:
                    self._newest[src, boot] = max(number, self._newest.get((src, boot), 0))

    def check(self, message: Posterior, recomputed: Recomputed | None) -> Iterator[FalseClaim]:
        """All claims about sources that are false."""
        if not all(self._archive.has(reference) for reference in message.used):
            self.unproved.append("missing: what was used is not in the recording")
            return
        if isinstance(message, Fused):
            yield from self._check_fused(message, recomputed)
            return
        sensors = self._configuration.filters[message.name].sensors
        used = self._used(message, Measurement)
        yield from self._check_missing(message, sensors, used)
        for name in sensors:
            if name in message.missing or name in used:
                continue
            sent = [one for one in self._archive.of_step(name, message.step) if isinstance(one, Measurement)]
            is_silent = any(all(value is None for value in one.y) for one in sent)
            if not is_silent and not (sent and message.status == "inconsistent"):
                yield FalseClaim(message, "missing", f"{name} in it: nothing of it was used")

    def _check_missing(self, message: Posterior, sources: Sequence[str], there: Iterable[str]) -> Iterator[FalseClaim]:
        """Names of sources, in their order, and none of one that was there."""
        if list(message.missing) != [name for name in sources if name in message.missing]:
            yield FalseClaim(message, "missing", f"some of {', '.join(sources)}, in this order")
        for name in message.missing:
            if name in there:
                yield FalseClaim(message, "missing", f"{name} not in it: it was there")
            elif self._archive.of_step(name, message.step):
                self.unproved.append(f"missing: whether what {name} sent came late or never")

    def _used(self, message: Posterior, kind: type[Message]) -> set[str]:
        """Names of the sources of the message's own step that it used."""
        found = (self._archive.find(reference, Message) for reference in message.used)
        return {one.name for one in found if isinstance(one, kind) and one.step == message.step}

    # -- fusion

    def _check_fused(self, message: Fused, recomputed: Recomputed | None) -> Iterator[FalseClaim]:
        settings = self._configuration.fusion[message.name]
        used, rejected = self._used(message, Posterior), {one.source for one in message.rejected}
        yield from self._check_missing(message, settings.sources, used | rejected)
        yield from self._check_rejected(message, recomputed, used)
        for name in settings.sources:
            if name in message.missing or name in used or name in rejected:
                continue
            if not self._archive.of_step(name, message.step):
                if self._sent_nothing(name, message.step):
                    yield FalseClaim(message, "missing", f"{name} in it: it sent nothing of this step")
                else:
                    self.unproved.append(f"missing: what {name} sent, because the recorder missed some of it")
            elif used:
                yield FalseClaim(message, "rejected", f"{name} in it: it was there and was not used")
            else:
                self.unproved.append(f"rejected: why nothing of {name} was used")

    def _sent_nothing(self, name: str, step: int) -> bool:
        """Whether a process of the source published before and behind a step of which nothing came, without a gap."""
        for sets in self._sets.get(name, {}).values():
            steps, numbers = [one.step for one in sets], {one.seq for one in sets}
            if min(steps) < step < max(steps) and len(numbers) == max(numbers) - min(numbers) + 1:
                return True
        return False

    def _check_rejected(self, message: Fused, recomputed: Recomputed | None, used: set[str]) -> Iterator[FalseClaim]:
        settings = self._configuration.fusion[message.name]
        for one in message.rejected:
            if one.source not in settings.sources:
                yield FalseClaim(message, "rejected", f"none of {one.source}, which is no source")
            elif one.reason != OUTVOTED:
                yield from self._check_reason(message, one.source, one.reason, used)
        said = {one.source for one in message.rejected if one.reason == OUTVOTED}
        if recomputed is None or recomputed.outvoted is None:
            if said:
                self.unproved.append("rejected: whether what is not in the recording contradicts the others")
        elif said != recomputed.outvoted:
            names = ", ".join(sorted(recomputed.outvoted)) or "nobody"
            yield FalseClaim(message, "rejected", f"{names}, because of a contradiction")

    def _check_reason(self, message: Fused, name: str, reason: str, used: set[str]) -> Iterator[FalseClaim]:
        """A status, or an abandoned epoch, that one of the source's sets of the step must have."""
        sent = [one for one in self._archive.of_step(name, message.step) if isinstance(one, Posterior)]
        if name in used:
            yield FalseClaim(message, "rejected", f"no {name}: it was used")
        elif not sent:
            self.unproved.append("rejected: what a source sent is not in the recording")
        elif reason == ABANDONED:
            if not any(self._is_abandoned(one) for one in sent):
                yield FalseClaim(message, "rejected", f"no {name}: its epochs go on")
        elif not any(reason == f"status {one.status}" for one in sent):
            words = " or ".join(sorted({f"status {one.status}" for one in sent}))
            yield FalseClaim(message, "rejected", f"{name} with {words}")

    def _is_abandoned(self, message: Posterior) -> bool:
        marks = [(message.src, message.boot, message.epoch), *message.descent]
        return any(number < self._newest.get((src, boot), 0) for src, boot, number in marks)

    def check_quarantined(self, sets: Sequence[Fused]) -> Iterator[FalseClaim]:
        """Who is quarantined, by all sets of one process; from a gap in the recording on it cannot be known."""
        first = sets[0]
        settings = self._configuration.fusion[first.name]
        policy = POLICIES[settings.policy]
        quarantine = Quarantine(settings.sources, settings.quarantine_after, settings.max_lag)
        for number, message in enumerate(sets):
            if message.seq != number:
                self.unproved.append("quarantined: the recorder missed some of the fusion's sets")
                return
            left_out = {one.source for one in message.rejected if one.source in settings.sources}
            there = set(settings.sources) - set(message.missing) - left_out
            used = self._names_used(message)
            is_passed_over = not used and len(there) >= policy.sources_needed(settings.faults)
            agreed = set() if message.status == "inconsistent" or is_passed_over else there
            quarantine.record(message.step, left_out, agreed, lambda name, is_in, one=message: one)  # type: ignore[misc]
            if message.quarantined != sorted(quarantine.members):
                yield FalseClaim(message, "quarantined", sorted(quarantine.members))

    def _names_used(self, message: Fused) -> bool:
        return any(reference[0] in (Posterior.topic, Fused.topic) for reference in message.used)


def by_process(messages: Iterable[Message]) -> dict[tuple[str, str], list[Message]]:
    """Messages by (src, boot)."""
    found: defaultdict[tuple[str, str], list[Message]] = defaultdict(list)
    for message in messages:
        found[message.src, message.boot].append(message)
    return found
