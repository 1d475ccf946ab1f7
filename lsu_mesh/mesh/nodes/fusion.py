"""Fusion as a node: posteriors of all filters in, their intersection with the own prediction out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lsu_mesh.errors import InconsistentData
from lsu_mesh.filters.lsucz import LSUCZ
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.messages import Fused, Input, Message, Posterior, Rejection, SupportMessage
from lsu_mesh.mesh.nodes.estimator import Combined, Estimator, Status, Step, finite_or_none
from lsu_mesh.mesh.nodes.node import SECOND
from lsu_mesh.mesh.sets import to_support
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support, Vector


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


class FusionNode(Estimator):
    """``fused_k = ∩ posteriors_k ∩ (own prediction of k)`` as a constrained zonotope of limited complexity."""

    role = "fusion"

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
        self._learned = False
        self.last: dict[str, Posterior] = {}
        """Last sound posterior of each source, for those that ask for it."""

    @property
    def deadline(self) -> int:
        return int(self.settings.deadline * SECOND)

    @property
    def history(self) -> int:
        return self.settings.max_lag

    def subscriptions(self) -> Sequence[tuple[str, str]]:
        listed = [("posterior", name) for name in self.configuration.fusion[self.name].sources]
        if self.configuration.plant is not None and self.configuration.base_model.input_count:
            listed.append(("input", self.configuration.plant.name))
        return listed

    def receive(self, message: Message, now: int) -> list[Message]:
        if isinstance(message, Input):
            return self.take_input(message, now)
        if isinstance(message, Posterior):
            self._receive_posterior(message, now)
        return []

    def _receive_posterior(self, message: Posterior, now: int) -> None:
        name = message.name
        if message.status in ("ok", "predicted"):
            known = self.last.get(name)
            if known is None or message.step >= known.step:
                self.last[name] = message
            if self.current is None:
                self.take_candidate(message)
        old = self.arrived(message.step, name)
        if old is None or old.boot != message.boot or old.seq < message.seq:
            self.take(name, message, now)

    # -- fusion of one step

    def combine(self, k: int, step: Step, now: int) -> tuple[Combined, list[Message]]:
        self._rejected = []
        sources = self._sound_sources(step)
        missing = [name for name in self.sources if name not in step.arrived]
        self._met = self.engine.bounds()
        if not sources:
            return Combined("predicted", [], missing, None), []
        before, met = self.engine.snapshot(), self._met
        messages: list[Message] = []
        status: Status = "ok"
        cause: str | None = None
        if self._try_all(sources):
            accepted = sources
        elif self._restart(sources):
            accepted, status, cause = sources, "restarted", "own prediction was disjoint from what the sources agree on"
            self.begin_epoch(sources[0].message.reference)
            messages.append(self.event("ERROR", "prediction-dropped", f"step {k}: {cause}", now, k, {"step": k}))
        else:
            self.engine.restore(before)
            self._met = met
            accepted = [source for source in sources if self._try(source)]
            status = "ok" if accepted else "inconsistent"
            cause = "sources contradict one another"
            messages += self._name_rejected(k, sources, accepted, now)
        self._learned = self._learned or any(source.message.guarantee == "learned" for source in accepted)
        origin = min((source.message.origin_ns for source in accepted), default=None)
        used = [source.message.reference for source in accepted]
        return Combined(status, used, missing, origin, cause), messages

    def _sound_sources(self, step: Step) -> list[Source]:
        sources = []
        for name in self.sources:
            message = step.arrived.get(name)
            if not isinstance(message, Posterior):
                continue
            if message.status in ("ok", "predicted"):
                sources.append(Source(name, message, to_support(message.support)))
            else:
                self._rejected.append(Rejection(source=name, reason=f"status {message.status}"))
        return sources

    def _try_all(self, sources: Sequence[Source]) -> bool:
        return all(self._try(source) for source in sources)

    def _try(self, source: Source) -> bool:
        """Meet the set with one source; False, and unchanged, where the intersection is proved empty."""
        lower = np.maximum(self._met[0], source.bounds[0])
        upper = np.minimum(self._met[1], source.bounds[1])
        if (lower > upper).any():
            return False
        before = self.engine.snapshot()
        try:
            self.engine.condition(source.support)
        except InconsistentData:
            return False
        own_lower, own_upper = self.engine.bounds()
        lower, upper = np.maximum(lower, own_lower), np.minimum(upper, own_upper)
        if (lower > upper).any():
            self.engine.restore(before)
            return False
        self._met = (lower, upper)
        return True

    def _restart(self, sources: Sequence[Source]) -> bool:
        """Drop the own prediction and hold what the sources alone say; False where they contradict one another."""
        first, *others = sources
        self.engine.reset(first.support)
        self._met = first.bounds
        return self._try_all(others)

    def _name_rejected(self, k: int, sources: Sequence[Source], accepted: Sequence[Source], now: int) -> list[Message]:
        messages: list[Message] = []
        self._counts["contradictions"] += 1
        for source in sources:
            if source not in accepted:
                reason = "disjoint from the own prediction and the sources accepted before"
                self._rejected.append(Rejection(source=source.name, reason=reason))
                about: dict[str, str | int | float | None] = {"source": source.name, "step": k}
                text = f"step {k}: {source.name} is {reason}; left out"
                messages.append(self.event("WARN", "source-rejected", text, now, k, about))
        return messages

    # -- messages out

    def posterior(self, k: int, step: Step, combined: Combined, support: SupportMessage, now: int) -> Posterior:
        lower, upper = self._met
        return Fused(
            **self.stamp("fused", k, now, combined.origin),
            kind="fusion",
            support=support,
            lower=lower.tolist(),
            upper=upper.tolist(),
            point=(lower + 0.5 * (upper - lower)).tolist(),
            log_volume=finite_or_none(Orthotope(lower, upper).log_volume()),
            volume_of="hull",
            status=combined.status,
            revision=step.revision,
            epoch=self.epoch,
            guarantee="learned" if self._learned else "declared",
            base=self._base,
            used=list(combined.used),
            bounds=self.noise_bounds(),
            missing=list(combined.missing),
            cause=combined.cause,
            policy="intersect",
            faults=self.settings.faults,
            rejected=self._rejected,
            quarantined=[],
        )
