"""A bank as a node: the measurements of N targets in, their posteriors out, one message per step.

It does the steps in order and never again: what comes late is counted and not used, which makes sets wider and none
wrong. A bank has no inputs, so that it predicts whenever a step is over.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lsu_mesh.array_types import Flags
from lsu_mesh.mesh.access import published_topics, subscriptions
from lsu_mesh.mesh.bank_messages import INCONSISTENT, BankMeasurement, BankPosterior
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.estimation.bank_answer import posterior_of
from lsu_mesh.mesh.estimation.bank_engine import BankEngine, BankStep, published_sets, warm_up_bank
from lsu_mesh.mesh.messages import Base, Message, Posterior
from lsu_mesh.mesh.nodes.bank_course import BankCourse
from lsu_mesh.mesh.nodes.node import SECOND, About
from lsu_mesh.supports.support import Support

MAX_CARRIED = 4096
"""Steps that the prior is carried over without data; a bank that starts later begins at the domain, if there is one."""
MAX_NAMED = 16
"""Instances that an event names."""


class BankFilterNode(BankCourse[BankMeasurement]):
    """One :class:`lsu_mesh.filters.bank.FilterBank` on the batched measurements of its sensors."""

    role = "filter"
    answers = ("bank_posterior",)

    def __init__(self, configuration: Configuration, name: str, boot: str) -> None:
        self.settings = configuration.filters[name]
        self.publishes = published_topics(configuration, self.role, name)
        super().__init__(configuration, name, boot, self.settings.sensors)
        assert configuration.instances is not None
        self._engine = BankEngine(configuration, self.settings, configuration.instances.priors(configuration.prior))
        self._base: Base = "prior"
        self._epoch = 0
        self._candidate: BankPosterior | None = None
        """The last sets of an earlier process of this name."""
        self._known: set[int] = set()
        """Instances whose data contradicted their sets in the step before."""
        self._lost_told: set[int] = set()
        self._counts |= {"contradictions": 0.0, "resets": 0.0}
        self.last: BankPosterior | None = None

    @property
    def deadline(self) -> int:
        return int(self.settings.deadline * SECOND)

    def subscriptions(self) -> Sequence[tuple[str, str]]:
        return subscriptions(self.configuration, self.role, self.name)

    def receive(self, message: Message, now: int) -> list[Message]:
        if isinstance(message, BankMeasurement):
            self.take(message, now)
        elif isinstance(message, BankPosterior) and (self._candidate is None or message.step > self._candidate.step):
            self._candidate = message
        return []

    def posterior_of(self, instance: int) -> Posterior | None:
        """The posterior of one instance of the last step, or ``None`` before the first one and of no such instance."""
        if self.last is None or not 0 <= instance < self.last.instances:
            return None
        return self.one(self.last, instance)

    def one(self, message: BankPosterior, instance: int) -> Posterior:
        """The posterior of one instance in a message of the bank."""
        return posterior_of(self.configuration, message, instance)

    def warm_up(self) -> None:
        warm_up_bank(self.configuration, self.settings)

    # -- the course of steps

    def first_step(self, oldest: int) -> int:
        """Begin where a sound set is: at the last sets of an earlier process, at the prior, or at the domain."""
        domain, candidate = self.configuration.base_model.domain, self._candidate
        if oldest == 1:
            return 1
        if candidate is not None:
            self._begin(published_sets(candidate), candidate.reference, candidate.status_codes == INCONSISTENT)
            self._engine.predict()
            return candidate.step + 1
        if domain is not None and oldest > MAX_CARRIED:
            self._begin([domain] * len(self._engine.bank), "domain", np.zeros(len(self._engine.bank), dtype=np.bool_))
            return oldest
        return 1

    def _begin(self, sets: Sequence[Support], base: Base, doubtful: Flags) -> None:
        self._engine = BankEngine(self.configuration, self.settings, sets)
        self._engine.restarts(doubtful)
        self._base = base

    def close(self, k: int, arrived: dict[str, BankMeasurement], now: int) -> list[Message]:
        """The data and the posterior of step k, then the prediction of k + 1; without any data nothing is published."""
        messages: list[Message] = []
        if arrived:
            step = self._engine.step(arrived)
            messages += self._events(k, step, now)
            self._epoch += bool(step.reset.size)
            self.last = posterior = self._posterior(k, step, arrived, now)
            self._base = posterior.reference
            messages.append(posterior)
        failed = self._engine.predict()
        if failed.size:
            self._epoch += 1
            self._counts["resets"] += failed.size
            text = f"step {k + 1}: the predictions of {_listed(failed.tolist())} left the domain; started again from it"
            about: About = {"step": k + 1, "instances": int(failed.size)}
            messages.append(self.event("ERROR", "reset", text, now=now, step=k + 1, about=about))
        return messages

    def _posterior(self, k: int, step: BankStep, arrived: dict[str, BankMeasurement], now: int) -> BankPosterior:
        data = [arrived[name] for name in self.sources if name in arrived]
        return BankPosterior(
            **self.stamp("bank_posterior", k, now, min(one.origin_ns for one in data)),
            **self._engine.fields(step),
            instances=len(self._engine.bank),
            guarantee="declared",
            base=self._base,
            used=[one.reference for one in data],
            missing=[name for name in self.sources if name not in arrived],
            epoch=self._epoch,
        )

    def _events(self, k: int, step: BankStep, now: int) -> list[Message]:
        """Tell which instances' data have begun to contradict, and which were started again."""
        self._counts["contradictions"] += step.contradicted.size
        self._counts["resets"] += step.reset.size
        messages: list[Message] = []
        fresh = sorted(set(step.contradicted.tolist()) - self._known)
        self._known = set(step.contradicted.tolist())
        if fresh:
            text = f"step {k}: the data of {_listed(fresh)} contradict their sets and were not used"
            about: About = {"step": k, "instances": len(fresh), "first": fresh[0]}
            messages.append(self.event("WARN", "contradiction", text, now=now, step=k, about=about))
        if step.reset.size:
            count = self.settings.reset_after
            text = f"step {k}: {count} steps in a row contradicted the sets of {_listed(step.reset.tolist())}; "
            about = {"step": k, "instances": int(step.reset.size), "epoch": self._epoch + 1}
            text += "started again from the domain"
            messages.append(self.event("ERROR", "reset", text, now=now, step=k, about=about))
        fresh_lost = sorted(set(step.lost.tolist()) - self._lost_told)
        if fresh_lost:
            self._lost_told |= set(fresh_lost)
            text = (
                f"step {k}: nothing is promised of {_listed(fresh_lost)} any more, whose data contradicted their sets; "
                "give the model a domain, or check the declared bounds"
            )
            about = {"step": k, "instances": len(fresh_lost), "first": fresh_lost[0]}
            messages.append(self.event("ERROR", "reset-impossible", text, now=now, step=k, about=about))
        return messages


def _listed(instances: Sequence[int]) -> str:
    """``instance 3``, ``instances 3, 17``, ``20 instances: 1, 2, … and more``."""
    named = ", ".join(map(str, instances[:MAX_NAMED]))
    if len(instances) == 1:
        return f"instance {named}"
    return f"instances {named}" if len(instances) <= MAX_NAMED else f"{len(instances)} instances ({named}, …)"
