"""The common course of filter and fusion nodes: steps in order, waiting, rewinding, republishing.

At each step the node collects what its sources send, combines it when all have come or the deadline has passed,
publishes, and predicts with the input. What comes late rewinds to its step. A missing input is never guessed.
A set is handed out as soon as it stands, before the next step's prediction is computed.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData, UnboundedSupport
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.held_inputs import Input as Drive
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.estimation.message_fields import told_density
from lsu_mesh.mesh.estimation.step_record import Combined, Step, published_content
from lsu_mesh.mesh.estimation.time_update import Origin, predict_step
from lsu_mesh.mesh.estimation.warm_up import warm_up
from lsu_mesh.mesh.lost_messages import Loss
from lsu_mesh.mesh.messages import Bounds, Input, Measurement, Message, Posterior, SupportMessage
from lsu_mesh.mesh.nodes.node import About, Complaint
from lsu_mesh.mesh.nodes.source_timeout import SourceTimeouts, input_key
from lsu_mesh.mesh.nodes.starting import START_GRACE, StartingNode
from lsu_mesh.mesh.nodes.useless_data import USELESS, UselessData
from lsu_mesh.mesh.sets import to_message

__all__ = ["START_GRACE", "Estimator"]
MAX_AT_ONCE = 1024
"""Steps done in one tick, the next tick goes on; more only where more than this would be left."""
MAX_MESSAGES = 32
"""So much to publish and a tick ends, the next tick goes on: nobody waits for the first until the last is done."""
MAX_USED = 2048
"""So many references since the last publication and a step is published all the same: receivers refuse longer lists."""


class Estimator(StartingNode):
    """A node that holds one set per step."""

    def __init__(
        self, configuration: Configuration, name: str, boot: str, engine: Filter, sources: tuple[str, ...]
    ) -> None:
        super().__init__(configuration, name, boot, engine=engine, sources=sources)
        self._source_timeouts = SourceTimeouts(configuration, self.subscriptions(), sources)
        kinds = dict.fromkeys(configuration.sensors, "sensor") | dict.fromkeys(configuration.filters, "filter")
        kinds |= dict.fromkeys(configuration.fusion, "fusion")
        reach = ("history" if self.role == "filter" else "max_lag", self.history)
        self.useless = UselessData({name: kinds[name] for name in sources}, configuration.mesh.rate, reach)
        """Sources that send nothing of use."""
        self.admission.datum_refused = self.useless.record_refused
        self._has_more = False
        """Whether the last tick has left steps that may be ready."""
        self.last_posterior: Posterior | None = None
        self.predicts = True
        """Whether predictions are published; the service around the node knows whether anybody takes them."""
        self.absent: set[str] = set()
        """Sources that are known to be gone and are not waited for."""

    # -- what differs between filter and fusion

    @property
    @abstractmethod
    def deadline(self) -> int:
        """How long to wait for a step's sources after its first sign, in nanoseconds."""

    @abstractmethod
    def combine(self, k: int, step: Step, now: int) -> tuple[Combined, list[Message]]:
        """Bring the step's data into the engine's set; also events."""

    @abstractmethod
    def posterior(self, k: int, step: Step, combined: Combined, support: SupportMessage, now: int) -> Posterior:
        """The message about the set after the data."""

    def published_bounds(self) -> tuple[Vector, Vector]:
        """Bounds of the set after the data, as they are published."""
        return self.engine.bounds()

    def is_complete(self, k: int, step: Step, source: str) -> bool:
        """Whether a source that is there has sent all of step k."""
        return source in step.arrived

    def lacks_input(self, k: int, step: Step, now: int) -> str:
        """What input the step's data see and is still waited for; empty where there is none."""
        return ""

    def content(self) -> tuple[object, ...]:
        """What a posterior says besides its set and makes it worth telling again."""
        return ()

    def is_told(self, step: Step) -> bool:
        """Whether what was published beside the step's posterior still holds."""
        return True

    def beside(self, posterior: Posterior, step: Step, now: int) -> list[Message]:
        """What is published with a posterior, of the same data."""
        return []

    def prediction(self, k: int, now: int) -> list[Message]:
        """Messages about the set before the data of step k."""
        return []

    # -- messages in

    def record_alive(self, name: str, is_there: bool, now: int) -> None:
        """Whoever has left is not waited for."""
        super().record_alive(name, is_there, now)
        if name in self.sources:
            (self.absent.discard if is_there else self.absent.add)(name)

    def record_lost(self, losses: Sequence[Loss], now: int) -> None:
        """As of every node; inputs that waited for too long are not waited for."""
        super().record_lost(losses, now)
        if any(loss.is_too_old and loss.key == input_key(self.configuration) for loss in losses):
            self.timeline.give_up_inputs()

    def take(self, source: str, message: Message, now: int) -> None:
        """Note a source's message for its step; a step that is over will be done again."""
        self._source_timeouts.received(source, now)
        newest, future = self.timeline.arrivals.newest, self.timeline.from_the_future
        step = self.timeline.see(message.step, now)
        if step is None:
            self._counts["late"] += self.timeline.from_the_future == future
            self.useless.record_off(source, newest - message.step, now)
            return
        self.useless.record_used(source)
        if isinstance(message, Measurement) and source in self.sources and not step.takes(message):
            return
        step.arrived[source] = message
        if self.current is not None and self.timeline.is_over(message.step):
            self._counts["late"] += 1
            self.timeline.do_again(message.step, step)

    def take_input(self, message: Input, now: int) -> list[Message]:
        """Note an input; the first of a step counts."""
        step = self.timeline.see(message.step, now)
        if step is None:
            return []
        if step.input is None:
            self.timeline.record_input(step, message)
        elif (step.input.u, step.input.time_ns) != (message.u, message.time_ns):
            about: About = {"source": message.src, "step": message.step}
            text = f"input of step {message.step} came again from {message.src} with another value; the first counts"
            return [self.event("WARN", "input-changed", text, now=now, step=message.step, about=about)]
        return []

    # -- the course of steps

    def warnings(self, now: int) -> list[Message]:
        """As of every node, and whose data are all of no use, or of use again."""
        found = super().warnings(now)
        for news in self.useless.take_news(now):
            about: About = {"source": news.source, "reason": news.reason, "seconds": news.seconds}
            if news.code == USELESS:
                found.append(self.warning(news.code, news.text, now, about=about))
            else:
                found.append(self.event("INFO", news.code, news.text, now=now, step=self.step(), about=about))
        return found

    def advance(self, now: int) -> Iterator[Message]:
        self.timeline.is_late = self.is_late
        dirty = self.timeline.take_dirty()
        if dirty is not None:
            self._rewind(dirty)
        self._has_more = False
        if self.current is None and not self._start(now):
            return
        count = 0
        for left in reversed(range(self._steps_at_once())):
            assert self.current is not None
            k = self.current
            step = self.timeline.step(k)
            if not self.timeline.is_combined:
                self._waiting = ""
                if not self._is_ready(k, step, now):
                    break
                self._waiting = self.lacks_input(k, step, now)
                if self._waiting:
                    break
                for message in self._close(k, step, now):
                    count += 1
                    yield message
            if not self._predict(k, step, now):
                if self.timeline.input_is_lost(k):
                    self._start_over_behind_lost_inputs(k, now)
                break
            told = self._take_remarks()
            is_told = self.predicts and step.published is not None
            if is_told and not self.held.unsound and not self.timeline.is_behind():
                told += self.prediction(k + 1, now)
            count += len(told)
            yield from told
            # a step that was published before is done again: all that a late message changes is told in one tick
            self._has_more = left == 0 or (count >= MAX_MESSAGES and not self.timeline.is_published(k + 1))
            if self._has_more:
                break
        yield from self._take_remarks()

    def _start_over_behind_lost_inputs(self, k: int, now: int) -> None:
        last = self.timeline.last_lost_input(k)
        words = f"the input of step {k} is lost" if last == k else f"the inputs of steps {k} to {last} are lost"
        self._start_over(last, words, now)

    def _steps_at_once(self) -> int:
        """A backlog stays bounded whatever comes: what is too much waits in the queue in front of the node."""
        assert self.current is not None
        return max(MAX_AT_ONCE, self.timeline.arrivals.newest - self.current - MAX_AT_ONCE)

    def _is_ready(self, k: int, step: Step, now: int) -> bool:
        if step.closed or all(name in self.absent or self.is_complete(k, step, name) for name in self.sources):
            return bool(step.closed or step.arrived or self.timeline.arrivals.newest > k)
        return self.is_overdue(k, now)

    def is_overdue(self, k: int, now: int) -> bool:
        """Whether the deadline of step k has passed."""
        sign = self.timeline.arrivals.of(k)
        return sign is not None and now >= sign + self.deadline

    def wakeup(self) -> int | None:
        if self._has_more:
            return 0
        if self.current is None:
            first = self.timeline.first_evidence
            return None if first is None else first + START_GRACE
        if self._waiting and self.configuration.input_box is None:
            return None
        sign = self.timeline.arrivals.of(self.current)
        waits = not self.timeline.is_combined or self.configuration.input_box is not None
        return sign + self.deadline if sign is not None and waits else None

    def _close(self, k: int, step: Step, now: int) -> Iterator[Message]:
        """Combine the step's data and publish the result if it is new, before what goes beside it is computed."""
        held = self.held
        step.before = held.snapshot()
        combined, events = self.combine(k, step, now)
        step.closed = True
        self.timeline.is_combined = True
        if held.is_restarted and combined.status != "inconsistent":
            combined = replace(combined, status="restarted")
            held.is_restarted = False
        held.record_used(combined.used)
        # a base that is no message does not say its step: the first posterior since then is always published
        may_skip = combined.status in ("ok", "predicted") and len(held.used) < MAX_USED and held.tells_step
        yield from events
        if held.unsound and self.last_posterior is None:
            return
        if step.published is None and self.timeline.is_behind() and may_skip:
            self._counts["behind"] += 1
            return
        posterior = self._publish(k, step, combined, now)
        if posterior is not None:
            yield posterior
            yield from self.beside(posterior, step, now)

    def _publish(self, k: int, step: Step, combined: Combined, now: int) -> Posterior | None:
        """The posterior's message, or None when the step was published before with the same set and sources."""
        held = self.held
        support, old = to_message(self.engine.support), step.published
        box = tuple(bound.tolist() for bound in self.published_bounds())
        beside = tuple(told_density(self.engine.density).values())
        claims = (combined.status, held.epochs.number, held.descent, held.guarantee, list(combined.missing))
        told = (support, box, beside, *claims, *self.content())
        if old is not None and told == published_content(old) and self.is_told(step):
            held.record_published(old)
            return None
        step.revision += 1
        combined = replace(combined, used=held.used)
        posterior = step.published = self.posterior(k, step, combined, support=support, now=now)
        held.record_published(posterior)
        if posterior.status != "inconsistent":
            self.last_posterior = posterior
        return posterior

    def _predict(self, k: int, step: Step, now: int) -> bool:
        """Time update to step k + 1; False where the input is still missing."""
        u: Drive = None
        if self.engine.model.input_count:
            if step.input is not None:
                u = np.array(step.input.u)
            elif self.configuration.input_box is not None and self.is_overdue(k, now):
                u = self.configuration.input_box
            else:
                is_late = self.timeline.arrivals.newest > k
                self._waiting = f"input of step {k} ({input_key(self.configuration)})" if is_late else ""
                return False
        self._waiting = ""
        earlier, since = self._earlier_input(k), None if step.input is None else step.input.time_ns
        self.held.predict_reach(k, u, earlier, message=step.input)
        if self.configuration.continuous is not None:
            known = Origin(self.engine.snapshot(), u, earlier, since)
            self.timeline.step(k + 1).origin = None if self.held.unsound else known
        if not self._predict_set(k, u, earlier, since=since, now=now):
            return False
        self.timeline.advance()
        return True

    def _earlier_input(self, k: int) -> Drive:
        """What drove the step before, where inputs may act late: it is one that the set is made from."""
        message = self.timeline.inputs.get(k - 1) if self.configuration.input_delay_ns else None
        if message is None:
            return None
        self.held.record_used([message.reference])
        return np.array(message.u)

    def _predict_set(self, k: int, u: Drive, earlier: Drive, *, since: int | None, now: int) -> bool:
        """Time update of the set; one that leaves the domain was wrong, one that outgrows all numbers says nothing."""
        try:
            predict_step(self.engine, self.configuration, k, u=u, earlier=earlier, since=since)
        except (InconsistentData, UnboundedSupport) as error:
            words = f"the prediction from step {k} failed: {error}"
            if not self.start_without_data(k + 1, abandons=True):
                self._start_over(k, words, now)
                return False
            about: About = {"step": k, "epoch": self.held.epochs.number}
            self._remarks.append(self.event("ERROR", "reset", words, now=now, step=k, about=about))
        return True

    def _take_remarks(self) -> list[Message]:
        said, self._remarks = self._remarks, []
        return said

    def _rewind(self, k: int) -> None:
        """Return to the set before the data of step k, so that everything since is done again."""
        step = self.timeline.rewind(k)
        if step is not None and step.before is not None:
            self._counts["rewinds"] += 1
            self.held.restore(step.before)

    def warm_up(self) -> None:
        warm_up(self.engine, self.configuration)

    # -- what is said of the node

    def step(self) -> int:
        return self.current or 0

    def waiting_for(self) -> str:
        return self._waiting

    def complaints(self, now: int) -> list[Complaint]:
        """As of every node, how far it is behind, and which sources have fallen silent."""
        found = super().complaints(now)
        found += [Complaint("WARN", text) for text in self.useless.complaints(now)]
        newest = self.timeline.arrivals.newest
        if self.current is not None and self.timeline.is_behind():
            late, unpublished = newest - self.current, self._counts["behind"]
            text = f"behind by {late} steps; {unpublished:g} steps so far were done without being published"
            found.append(Complaint("WARN", text))
        last = self.configuration.mesh.steps
        has_ended = last is not None and newest >= last  # nobody has anything to say any more
        is_early = self.timeline.first_evidence is None
        return found + ([] if has_ended or is_early else self._source_timeouts.complaints(now))

    def counters(self) -> dict[str, float]:
        future, newest = self.timeline.from_the_future, self.timeline.arrivals.newest
        return (
            self._counts
            | self.useless.counters
            | {"from the future": future, "epoch": self.held.epochs.number, "newest": newest}
        )

    def noise_bounds(self, factor: float = 1.0) -> Bounds:
        """rho and r in force; r of this step widened by ``factor``."""
        rho, r = self.engine.half_widths
        return Bounds(rho=rho.tolist(), r=(r * factor).tolist())
