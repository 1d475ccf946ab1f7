"""Fusion as a node: posteriors of all filters in, their intersection with the own prediction out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import assert_never

from lsu_mesh.fusion.policies import POLICIES
from lsu_mesh.mesh.access import PUBLISHES, subscriptions
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.estimation.fusion_step import (
    ABANDONED,
    OUTVOTED,
    FusionEngine,
    FusionOutcome,
    Source,
    family_step,
    fused_guarantee,
    fused_point,
    fusion_algorithm,
    fusion_step,
    rehearse,
)
from lsu_mesh.mesh.estimation.message_fields import described_fusion
from lsu_mesh.mesh.estimation.quarantine import Quarantine, Say
from lsu_mesh.mesh.estimation.step_record import Combined, Status, Step
from lsu_mesh.mesh.estimation.transfer import SOUND
from lsu_mesh.mesh.messages import Fused, Input, Message, Posterior, Rejection, SupportMessage
from lsu_mesh.mesh.nodes.estimator import Estimator
from lsu_mesh.mesh.nodes.node import SECOND, About, Complaint
from lsu_mesh.mesh.nodes.starting import START_GRACE

FAR_BEHIND_S, FAR_BEHIND = 2.0, 256
"""A fusion that is farther behind, in time at the mesh's rate or in steps, continues where its sources are."""
CONTRADICTION = "sources contradict one another"
DISJOINT = "own prediction was disjoint from what the sources agree on"
"""Causes of what is no plain step."""
SILENT_STEPS = 5
"""After so many steps without any message, a second at least, the fusion takes steps by the clock."""


class FusionNode(Estimator):
    """``fused_k = ∩ posteriors_k ∩ (own prediction of k)`` as a constrained zonotope of limited complexity."""

    role = "fusion"
    publishes = PUBLISHES["fusion"]
    takes_at_once = 16384
    """Many: it can only know from the newest how far it is behind."""

    engine: FusionEngine

    def __init__(self, configuration: Configuration, name: str, boot: str) -> None:
        self.settings = configuration.fusion[name]
        self._policy = POLICIES[self.settings.policy]
        engine = FusionEngine(configuration, self.settings)
        super().__init__(configuration, name, boot, engine=engine, sources=self.settings.sources)
        self._rejected: list[Rejection] = []
        self._used: Sequence[Source] = ()
        """Sources that are in the set of the current step, whose points its own is made of."""
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

    def warm_up(self) -> None:
        super().warm_up()
        rehearse(self.engine)

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
        self.held.epochs.record(message)
        known = self.last.get(name)
        if known is not None and self.held.epochs.is_abandoned(known):
            del self.last[name]
            known = None
        if self.held.epochs.is_abandoned(message):
            return
        if message.status in SOUND and (known is None or message.step >= known.step):
            self.last[name] = message
        old = self.timeline.arrived(message.step, name)
        if old is None or old.boot != message.boot or old.seq < message.seq:
            self.take(name, message, now)

    def advance(self, now: int) -> Iterator[Message]:
        self._sense_silence(now)
        yield from self._skip_ahead(now)
        yield from super().advance(now)

    def _skip_ahead(self, now: int) -> list[Message]:
        """Far behind, continue at the sources' step, like a fusion that starts late: their sets suffice to start."""
        if self.current is None or self.timeline.arrivals.newest - self.current <= self._far_behind:
            return []
        first = self.timeline.arrivals.newest - self.history
        if not any(self._is_start(k) for k, _ in self.timeline.steps() if k >= first):
            return []
        skipped, k = first - self.current, self.current
        self.join_again(first, now - START_GRACE)
        self._counts["skipped"] += skipped
        text = f"too far behind: {skipped} steps from step {k} on are skipped; continues from its sources' sets"
        return [self.event("WARN", "skipped-ahead", text, now=now, step=k, about={"step": k, "skipped": skipped})]

    def _sense_silence(self, now: int) -> None:
        """When no message has come for a while, take steps by the clock; without data the set grows."""
        arrivals = self.timeline.arrivals
        if self.current is None or arrivals.heard_at is None or self.waiting_for():
            return
        period = SECOND / self.configuration.mesh.rate
        silence = max(SECOND, int(SILENT_STEPS * period)) + self.deadline
        last = self.configuration.mesh.steps
        while now - arrivals.heard_at > silence and (last is None or arrivals.newest < last):
            heard_at = arrivals.heard_at + int(period)
            self.timeline.see(arrivals.newest + 1, now)
            arrivals.heard_at = heard_at
            self._counts["silent steps"] += 1

    # -- fusion of one step

    def combine(self, k: int, step: Step, now: int) -> tuple[Combined, list[Message]]:
        self._rejected = []
        sources = [] if self._passes_over() else self._sound_sources(step)
        messages = self._leave_abandoned_epoch(k, now)
        missing = [name for name in self.sources if name not in step.arrived]
        has_prediction = not self.held.unsound
        outcome = fusion_step(self.engine, sources, self._policy, self.settings.faults, has_prediction=has_prediction)
        if (
            self._policy.is_intersection
            and outcome.basis == "contradiction"
            and self.start_without_data(k, abandons=False)
        ):
            outcome = family_step(self.engine, sources)
        self._used = outcome.used
        status, cause, told = self._conclude(k, outcome, now)
        messages += told
        agreeing = sources if status != "inconsistent" else []
        messages += self._record_rejected(k, agreeing, now)
        self._add_dependencies(outcome.used)
        origin = min((source.message.origin_ns for source in outcome.used), default=None)
        used = [source.message.reference for source in outcome.used]
        return Combined(status=status, used=used, missing=missing, origin=origin, cause=cause), messages

    def _passes_over(self) -> bool:
        """Whether the step is only predicted and not published, because the fusion is far behind."""
        return self.timeline.is_behind() and not self.held.unsound and self.held.epochs.abandoned is None

    def _conclude(self, k: int, outcome: FusionOutcome, now: int) -> tuple[Status, str | None, list[Message]]:
        """A step's status, its cause where the status is not "ok", and events."""
        match outcome.basis:
            case "both":
                return "ok", None, self._name_rejected(k, outcome.rejected, now)
            case "sources":
                messages = self._name_rejected(k, outcome.rejected, now)
                cause, told = self._without_prediction(k, now)
                return "restarted", cause, [*messages, *told]
            case "family":
                self.held.downgrade_guarantee("learned")
                status: Status = "ok" if outcome.used else "inconsistent"
                return status, CONTRADICTION, self._name_rejected(k, outcome.rejected, now)
            case "prediction":
                if self.held.unsound and not self.start_without_data(k, abandons=False):
                    return "inconsistent", self.held.unsound, []
                self.engine.resume(self.engine.support, *self.engine.bounds())
                return "predicted", None, []
            case "contradiction":
                return self._contradiction(k, now)
            case _:
                assert_never(outcome.basis)

    def _contradiction(self, k: int, now: int) -> tuple[Status, str, list[Message]]:
        """The sources contradict one another, and nothing of them is used."""
        if self._policy.is_intersection:
            return "inconsistent", f"{CONTRADICTION}, and {self.held.unsound}", []
        cause = f"more than {self.settings.faults} of the sources contradict one another"
        about: About = {"step": k, "faults": self.settings.faults}
        return (
            "inconsistent",
            cause,
            [self.event("ERROR", "too-many-faults", f"step {k}: {cause}", now=now, step=k, about=about)],
        )

    def _add_dependencies(self, used: Sequence[Source]) -> None:
        """No single source carries a relaxed set: of those that are learned, or abandoned, ``faults`` may be wrong."""
        if self._policy.is_intersection:
            for source in used:
                self.held.add_dependency(source.message)
        elif used:
            guarantees = [source.message.guarantee for source in used]
            self.held.downgrade_guarantee(fused_guarantee(guarantees, self.settings.faults))

    def _sound_sources(self, step: Step) -> list[Source]:
        sources = []
        for name in self.sources:
            message = step.arrived.get(name)
            if not isinstance(message, Posterior):
                continue
            if self.held.epochs.is_abandoned(message):
                self._rejected.append(Rejection(source=name, reason=ABANDONED))
            elif message.status in SOUND:
                sources.append(Source.of(message))
            else:
                self._rejected.append(Rejection(source=name, reason=f"status {message.status}"))
        return sources

    def _without_prediction(self, k: int, now: int) -> tuple[str, list[Message]]:
        """The engine holds the sources' intersection alone: a new epoch begins, unless no set was held before."""
        if self.held.unsound:
            cause = self.held.unsound
            self.start_from("sources")
            return cause, []
        self.abandon_epoch("")
        self.start_from("sources")
        return DISJOINT, [self._dropped_event(k, DISJOINT, now)]

    def _leave_abandoned_epoch(self, k: int, now: int) -> list[Message]:
        """When a source abandons an epoch that went into the set, the fusion leaves its own at once, and says so."""
        source = self.held.epochs.abandoned
        if source is None:
            return []
        self.abandon_epoch(f"{source} has abandoned its epoch")
        return [self._dropped_event(k, self.held.unsound, now)]

    def _dropped_event(self, k: int, cause: str, now: int) -> Message:
        about: About = {"step": k, "epoch": self.held.epochs.number}
        return self.event("ERROR", "prediction-dropped", f"step {k}: {cause}", now=now, step=k, about=about)

    def _start_from_candidate(self) -> bool:
        """A fusion that starts late takes the intersection of its sources at a step, once enough of them are there."""
        for k, _ in reversed(self.timeline.steps()):
            if self._is_start(k):
                self._begin(k, self.configuration.prior, "prior")
                self.held.unsound = "started late"
                return True
        return False

    def _is_start(self, k: int) -> bool:
        """Whether enough sources of step k are there to hold the state by themselves, and its input."""
        enough = self._policy.sources_needed(self.settings.faults)
        return len(self._sound_sources(self.timeline.step(k))) >= enough and not self._input_missing(k)

    def _name_rejected(self, k: int, rejected: Sequence[Source], now: int) -> list[Message]:
        """Events and counts of the sources that contradict the others."""
        messages: list[Message] = []
        self._reported = {(step, name) for step, name in self._reported if step >= k - self.history}
        for name in sorted(source.name for source in rejected):
            self._rejected.append(Rejection(source=name, reason=OUTVOTED))
            if (k, name) in self._reported:
                continue
            self._reported.add((k, name))
            self._counts["contradictions"] += 1
            text = f"step {k}: {name} {OUTVOTED}; left out"
            messages.append(
                self.event("WARN", "source-rejected", text, now=now, step=k, about={"source": name, "step": k})
            )
        return messages

    def _record_rejected(self, k: int, agreeing: Sequence[Source], now: int) -> list[Message]:
        """Events: which sources are quarantined, because they were left out too often, and which are used again."""
        left_out = {rejection.source for rejection in self._rejected}
        agreed = {source.name for source in agreeing} - left_out
        return self._quarantine.record(k, left_out, agreed, self._say_quarantine(k, now))

    def _say_quarantine(self, k: int, now: int) -> Say:
        def say(name: str, is_in: bool) -> Message:
            count = self.settings.quarantine_after
            if is_in:
                text = f"step {k}: {name} was left out {count} times and is quarantined"
                return self.event("ERROR", "quarantined", text, now=now, step=k, about={"source": name, "step": k})
            text = f"step {k}: {name} has agreed {count} times in a row and is used again"
            return self.event("INFO", "let-back-in", text, now=now, step=k, about={"source": name, "step": k})

        return say

    def complaints(self, now: int) -> list[Complaint]:
        """As of every estimator, and who is quarantined."""
        names = ", ".join(sorted(self._quarantine.members))
        return super().complaints(now) + ([Complaint("WARN", f"quarantined: {names}")] if names else [])

    # -- messages out

    def content(self) -> tuple[object, ...]:
        return (self._rejected,)

    def posterior(self, k: int, step: Step, combined: Combined, support: SupportMessage, now: int) -> Posterior:
        rule, bounds = self.settings.point, self.engine.bounds()
        return Fused(
            **self.stamp("fused", k, now, combined.origin),
            **described_fusion(*bounds, fused_point(self.engine.support, bounds, self._used, rule), rule),
            kind="fusion",
            support=support,
            status=combined.status,
            revision=step.revision,
            epoch=self.held.epochs.number,
            descent=self.held.descent,
            guarantee=self.held.guarantee,
            base=self.held.base,
            used=list(combined.used),
            bounds=self.noise_bounds(),
            missing=list(combined.missing),
            cause=combined.cause,
            algorithm=fusion_algorithm(self._policy),
            policy=self._policy.name,
            faults=self.settings.faults,
            rejected=self._rejected,
            quarantined=sorted(self._quarantine.members),
        )
