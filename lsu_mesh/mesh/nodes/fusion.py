"""Fusion as a node: posteriors of all filters in, their intersection with the own prediction out."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData
from lsu_mesh.filters.lsucz import LSUCZ
from lsu_mesh.fusion.fuse import fuse
from lsu_mesh.mesh.access import PUBLISHES, subscriptions
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.estimation.message_fields import described_box
from lsu_mesh.mesh.estimation.quarantine import Quarantine, Say
from lsu_mesh.mesh.estimation.step_record import Combined, Status, Step
from lsu_mesh.mesh.estimation.transfer import SOUND
from lsu_mesh.mesh.messages import Fused, Input, Message, Posterior, Rejection, SupportMessage
from lsu_mesh.mesh.nodes.estimator import START_GRACE, WEAKNESS, About, Estimator
from lsu_mesh.mesh.nodes.node import SECOND, Complaint
from lsu_mesh.mesh.sets import to_support
from lsu_mesh.supports.support import Support

MAX_FAMILIES = 64
"""So many families of contradicting sources are tried, the largest first, to find out whom to leave out."""
FAR_BEHIND_S, FAR_BEHIND = 2.0, 256
"""So far behind, in time at the mesh's rate and in steps, and a fusion goes on where its sources are."""
SILENT_STEPS = 5
"""After so many steps without any message, a second at least, the fusion goes on by the clock."""


@dataclass(frozen=True)
class Source:
    """One filter's set of a step."""

    name: str
    message: Posterior
    support: Support

    @property
    def bounds(self) -> tuple[Vector, Vector]:
        """The bounds that the filter published."""
        return np.array(self.message.lower), np.array(self.message.upper)


@dataclass(frozen=True)
class Outcome:
    """What came of a step's sources."""

    status: Status
    used: Sequence[Source]
    cause: str | None = None
    messages: list[Message] = field(default_factory=list)


class FusionNode(Estimator):
    """``fused_k = ∩ posteriors_k ∩ (own prediction of k)`` as a constrained zonotope of limited complexity."""

    role = "fusion"
    publishes = PUBLISHES["fusion"]
    takes_at_once = 16384
    """Many: it can only know from the newest how far it is behind."""

    def __init__(self, configuration: Configuration, name: str, boot: str) -> None:
        self.settings = configuration.fusion[name]
        engine = LSUCZ(
            configuration.base_model,
            configuration.prior,
            max_generators=self.settings.max_generators,
            max_constraints=self.settings.max_constraints,
        )
        super().__init__(configuration, name, boot, engine, self.settings.sources)
        self._met: tuple[Vector, Vector] = engine.bounds()
        """Bounds of the set met with those of every accepted source."""
        self._rejected: list[Rejection] = []
        self._quarantine = Quarantine(self.sources, self.settings.quarantine_after, self.settings.max_lag)
        self._reported: set[tuple[int, str]] = set()
        """Steps and sources whose contradiction was told; a step that is done again does not tell it again."""
        self._counts |= {"silent steps": 0, "skipped": 0}
        self._far_behind = max(FAR_BEHIND, int(FAR_BEHIND_S * configuration.mesh.rate))
        self.last: dict[str, Posterior] = {}
        """Last sound posterior of each source, for those that ask for it."""

    @property
    def deadline(self) -> int:
        return int(self.settings.deadline * SECOND)

    @property
    def history(self) -> int:
        return self.settings.max_lag

    def subscriptions(self) -> Sequence[tuple[str, str]]:
        return subscriptions(self.configuration, self.role, self.name)

    def receive(self, message: Message, now: int) -> list[Message]:
        if isinstance(message, Input):
            return self.take_input(message, now)
        if isinstance(message, Posterior):
            self._receive_posterior(message, now)
        return []

    def _receive_posterior(self, message: Posterior, now: int) -> None:
        name = message.name
        self.epochs.record(message)
        known = self.last.get(name)
        if known is not None and self.epochs.is_abandoned(known):
            del self.last[name]
            known = None
        if self.epochs.is_abandoned(message):
            return
        if message.status in SOUND and (known is None or message.step >= known.step):
            self.last[name] = message
        old = self.arrived(message.step, name)
        if old is None or old.boot != message.boot or old.seq < message.seq:
            self.take(name, message, now)

    def advance(self, now: int) -> list[Message]:
        self._sense_silence(now)
        return [*self._skip_ahead(now), *super().advance(now)]

    def _skip_ahead(self, now: int) -> list[Message]:
        """Far behind, join the sources where they are, like a fusion that starts late; what they know is enough."""
        if self.current is None or self._step_arrivals.newest - self.current <= self._far_behind:
            return []
        first = self._step_arrivals.newest - self.history
        if not any(self._is_start(k) for k in self._steps if k >= first):
            return []
        skipped, k = first - self.current, self.current
        self.join_again(first, now - START_GRACE)
        self._counts["skipped"] += skipped
        text = f"too far behind: {skipped} steps from step {k} on are skipped; going on from what the sources say"
        return [self.event("WARN", "skipped-ahead", text, now, k, {"step": k, "skipped": skipped})]

    def _sense_silence(self, now: int) -> None:
        """When nothing at all has come for a while, steps go on by the clock; the set then grows, honestly."""
        if self.current is None or self._step_arrivals.heard_at is None or self.waiting_for():
            return
        period = SECOND / self.configuration.mesh.rate
        silence = max(SECOND, int(SILENT_STEPS * period)) + self.deadline
        last = self.configuration.mesh.steps
        while now - self._step_arrivals.heard_at > silence and (last is None or self._step_arrivals.newest < last):
            heard_at = self._step_arrivals.heard_at + int(period)
            self._see(self._step_arrivals.newest + 1, now)
            self._step_arrivals.heard_at = heard_at
            self._counts["silent steps"] += 1

    # -- fusion of one step

    def combine(self, k: int, step: Step, now: int) -> tuple[Combined, list[Message]]:
        self._rejected = []
        sources = [] if self._passes_over() else self._sound_sources(step)
        abandoned = self._leave_abandoned_epoch(k, now)
        missing = [name for name in self.sources if name not in step.arrived]
        self._met = self.engine.bounds()
        if self.settings.policy == "relaxed" and len(sources) > self.settings.faults:
            outcome = self._relaxed(k, sources, now)
        elif self.settings.policy == "intersect" and sources:
            outcome = self._intersected(k, sources, now)
        elif not self.unsound or self._start_without_sources():
            outcome = Outcome("predicted", [])
        else:
            outcome = Outcome("inconsistent", [], self.unsound)
        self.engine.resume(self.engine.support, *self._met)  # what is published is all that the next step depends on
        agreeing = sources if outcome.status != "inconsistent" else []
        messages = [*abandoned, *outcome.messages, *self._record_rejected(k, agreeing, now)]
        self._add_dependencies(outcome.used)
        origin = min((source.message.origin_ns for source in outcome.used), default=None)
        used = [source.message.reference for source in outcome.used]
        return Combined(outcome.status, used, missing, origin, outcome.cause), messages

    def _passes_over(self) -> bool:
        """Far behind, a step is only predicted through: nobody is told of it, and later sources know what it knew."""
        return self._is_behind() and not self.unsound and self.epochs.abandoned is None

    def _add_dependencies(self, used: Sequence[Source]) -> None:
        """No single source carries a relaxed set: of those that are learned, or abandoned, ``faults`` may be wrong."""
        if self.settings.policy == "intersect":
            for source in used:
                self.add_dependency(source.message)
        elif used:
            guarantees = sorted((source.message.guarantee for source in used), key=WEAKNESS.index, reverse=True)
            self.downgrade_guarantee(guarantees[min(self.settings.faults, len(guarantees) - 1)])

    def _sound_sources(self, step: Step) -> list[Source]:
        sources = []
        for name in self.sources:
            message = step.arrived.get(name)
            if not isinstance(message, Posterior):
                continue
            if self.epochs.is_abandoned(message):
                self._rejected.append(Rejection(source=name, reason="descends from an epoch that was abandoned"))
            elif message.status in SOUND:
                sources.append(Source(name, message, to_support(message.support)))
            else:
                self._rejected.append(Rejection(source=name, reason=f"status {message.status}"))
        return sources

    def _intersected(self, k: int, sources: Sequence[Source], now: int) -> Outcome:
        """Every source with the own prediction; without the prediction where only that is wrong."""
        before, met = self.engine.snapshot(), self._met
        if not self.unsound and self._try_all(sources):
            return Outcome("ok", sources, None, self._name_rejected(k, [], now))
        self.engine.restore(before)
        if self._restart(sources):
            return self._without_prediction(k, sources, now)
        self.engine.restore(before)
        self._met = met
        cause = "sources contradict one another"
        if self.unsound and not self._start_without_sources():
            return Outcome("inconsistent", [], f"{cause}, and {self.unsound}")
        accepted = self._largest_family(sources)
        self.downgrade_guarantee("learned")
        messages = self._name_rejected(k, [source for source in sources if source not in accepted], now)
        return Outcome("ok" if accepted else "inconsistent", accepted, cause, messages)

    def _relaxed(self, k: int, sources: Sequence[Source], now: int) -> Outcome:
        """What holds the state as long as at most ``faults`` of the sources are wrong."""
        try:
            together = fuse([source.support for source in sources], "relaxed", self.settings.faults)
        except InconsistentData:
            cause = f"more than {self.settings.faults} of the sources contradict one another"
            about: About = {"step": k, "faults": self.settings.faults}
            event = self.event("ERROR", "too-many-faults", f"step {k}: {cause}", now, k, about)
            return Outcome("inconsistent", [], cause, [event])
        messages = self._name_rejected(k, [sources[i] for i in together.rejected], now)
        if not self.unsound and self._meet(together.support, together.bounds):
            return Outcome("ok", sources, None, messages)
        self.engine.reset(together.support)
        self._met = together.bounds
        outcome = self._without_prediction(k, sources, now)
        return Outcome(outcome.status, outcome.used, outcome.cause, [*messages, *outcome.messages])

    def _without_prediction(self, k: int, sources: Sequence[Source], now: int) -> Outcome:
        """The engine holds what the sources say alone: a new epoch begins, unless nothing was held before."""
        cause = self.unsound or "own prediction was disjoint from what the sources agree on"
        if self.unsound:
            self.start_from("sources")
            return Outcome("restarted", sources, cause)
        self.begin_epoch("sources")
        event = self.event("ERROR", "prediction-dropped", f"step {k}: {cause}", now, k, {"step": k})
        return Outcome("restarted", sources, cause, [event])

    def _leave_abandoned_epoch(self, k: int, now: int) -> list[Message]:
        """When a source abandons an epoch that went into the set, the fusion leaves its own at once, and says so."""
        source = self.epochs.abandoned
        if source is None:
            return []
        self.abandon_epoch(f"{source} has abandoned its epoch")
        event = self.event("ERROR", "prediction-dropped", f"step {k}: {self.unsound}", now, k, {"step": k})
        return [event]

    def _start_without_sources(self) -> bool:
        """Hold the prior carried through all inputs, or the domain; False where neither is known."""
        start = self.start_without_data()
        if start is None:
            return False
        self.engine.reset(start[0])
        self._met = self.engine.bounds()
        self.start_from(start[1])
        return True

    def _start_from_candidate(self) -> bool:
        """A fusion that starts late takes what its sources say together of a step, once enough of them are there."""
        for k in sorted(self._steps, reverse=True):
            if self._is_start(k):
                self._begin(k, self.configuration.prior, "prior", restarted=True)
                self.unsound = "started late"
                return True
        return False

    def _is_start(self, k: int) -> bool:
        """Whether enough sources of step k are there to hold the state by themselves, and its input."""
        enough = self.settings.faults + 1 if self.settings.policy == "relaxed" else 1
        return len(self._sound_sources(self._steps[k])) >= enough and not self._input_missing(k)

    def _try_all(self, sources: Sequence[Source]) -> bool:
        return all(self._try(source) for source in sources)

    def _try(self, source: Source) -> bool:
        """Meet the set with one source; False, and unchanged, where the intersection is proved empty."""
        return self._meet(source.support, source.bounds)

    def _meet(self, support: Support, bounds: tuple[Vector, Vector]) -> bool:
        """Meet the set with another one; False, and unchanged, where the intersection is proved empty."""
        lower, upper = np.maximum(self._met[0], bounds[0]), np.minimum(self._met[1], bounds[1])
        if (lower > upper).any():
            return False
        before = self.engine.snapshot()
        try:
            self.engine.condition(support)
        except InconsistentData:
            return False
        own_lower, own_upper = self.engine.bounds()
        lower, upper = np.maximum(lower, own_lower), np.minimum(upper, own_upper)
        if (lower > upper).any():
            self.engine.restore(before)
            return False
        self._met = (lower, upper)
        return True

    def _largest_family(self, sources: Sequence[Source]) -> Sequence[Source]:
        """Meet the set with as many sources as have a point in common with it, the first by name of equal size."""
        before, met = self.engine.snapshot(), self._met
        families = (f for size in range(len(sources) - 1, 0, -1) for f in itertools.combinations(sources, size))
        for family in itertools.islice(families, MAX_FAMILIES):
            if self._try_all(family):
                return family
            self.engine.restore(before)
            self._met = met
        return [source for source in sources if self._try(source)]

    def _restart(self, sources: Sequence[Source]) -> bool:
        """Drop the own prediction and hold what the sources alone say; False where they contradict one another."""
        first, *others = sources
        try:
            self.engine.reset(first.support)
        except InconsistentData:  # the source's own set is empty: it agrees with nobody
            return False
        self._met = first.bounds
        return self._try_all(others)

    def _name_rejected(self, k: int, rejected: Sequence[Source], now: int) -> list[Message]:
        """Events and counts of the sources that contradict the others."""
        messages: list[Message] = []
        self._reported = {(step, name) for step, name in self._reported if step >= k - self.history}
        for name in sorted(source.name for source in rejected):
            reason = "contradicts what the other sources and the own prediction agree on"
            self._rejected.append(Rejection(source=name, reason=reason))
            if (k, name) in self._reported:
                continue
            self._reported.add((k, name))
            self._counts["contradictions"] += 1
            text = f"step {k}: {name} {reason}; left out"
            messages.append(self.event("WARN", "source-rejected", text, now, k, {"source": name, "step": k}))
        return messages

    def _record_rejected(self, k: int, agreeing: Sequence[Source], now: int) -> list[Message]:
        """Events of who is quarantined, left out too often for whatever reason, and of who is let back in."""
        left_out = {rejection.source for rejection in self._rejected}
        agreed = {source.name for source in agreeing} - left_out
        return self._quarantine.record(k, left_out, agreed, self._say_quarantine(k, now))

    def _say_quarantine(self, k: int, now: int) -> Say:
        def say(name: str, is_in: bool) -> Message:
            count = self.settings.quarantine_after
            if is_in:
                text = f"step {k}: {name} was left out {count} times and is quarantined"
                return self.event("ERROR", "quarantined", text, now, k, {"source": name, "step": k})
            text = f"step {k}: {name} has agreed {count} times in a row and is let back in"
            return self.event("INFO", "let-back-in", text, now, k, {"source": name, "step": k})

        return say

    def complaints(self, now: int) -> list[Complaint]:
        """As of every estimator, and who is quarantined."""
        names = ", ".join(sorted(self._quarantine.members))
        return super().complaints(now) + ([Complaint("WARN", f"quarantined: {names}")] if names else [])

    # -- messages out

    def published_bounds(self) -> tuple[Vector, Vector]:
        return self._met

    def posterior(self, k: int, step: Step, combined: Combined, support: SupportMessage, now: int) -> Posterior:
        return Fused(
            **self.stamp("fused", k, now, combined.origin),
            **described_box(*self._met),
            kind="fusion",
            support=support,
            status=combined.status,
            revision=step.revision,
            epoch=self.epochs.number,
            descent=self.epochs.descent,
            guarantee=self.guarantee,
            base=self._base,
            used=list(combined.used),
            bounds=self.noise_bounds(),
            missing=list(combined.missing),
            cause=combined.cause,
            policy=self.settings.policy,  # type: ignore[arg-type]
            faults=self.settings.faults,
            rejected=self._rejected,
            quarantined=sorted(self._quarantine.members),
        )
