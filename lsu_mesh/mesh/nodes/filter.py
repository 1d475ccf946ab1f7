"""A filter as a node: measurements, inputs and transfers in, predictions and posteriors out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from lsu_mesh.errors import InconsistentData
from lsu_mesh.mesh.access import published_topics, subscriptions
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.estimation.adoption import adopted_model, filter_algorithm, is_due, make_engine
from lsu_mesh.mesh.estimation.filter_step import (
    FilterOutcome,
    Transfers,
    contradiction_rule,
    filter_step,
)
from lsu_mesh.mesh.estimation.guarantee import declared_guarantee
from lsu_mesh.mesh.estimation.message_fields import can_foretell, described, finite_or_none, foretold, smoothed
from lsu_mesh.mesh.estimation.received_data import ReceivedData
from lsu_mesh.mesh.estimation.restart import RestartSearch, Start
from lsu_mesh.mesh.estimation.send_on_gain import SendOnGain
from lsu_mesh.mesh.estimation.step_data import BEFORE_PRIOR, StepData, Unused
from lsu_mesh.mesh.estimation.step_record import Combined, Step
from lsu_mesh.mesh.estimation.transfer import MAX_BOX_AGE, Transfer
from lsu_mesh.mesh.measurement_time import is_timed
from lsu_mesh.mesh.messages import (
    Fused,
    Input,
    Measurement,
    Message,
    Posterior,
    Prediction,
    Smoothed,
    Suggestion,
    SupportMessage,
)
from lsu_mesh.mesh.nodes.estimator import Estimator
from lsu_mesh.mesh.nodes.filter_events import dropped_event, rejected_event, widened_event
from lsu_mesh.mesh.nodes.node import SECOND, About
from lsu_mesh.mesh.nodes.source_timeout import input_key
from lsu_mesh.mesh.sets import to_message


class FilterNode(Estimator):
    """Runs one filter of the library on the measurements of its sensors."""

    role = "filter"
    answers = ("posterior",)

    def __init__(self, configuration: Configuration, name: str, boot: str) -> None:
        settings = configuration.filters[name]
        self.settings = settings
        self.publishes = published_topics(configuration, self.role, name)
        model = configuration.model(settings.sensors)
        super().__init__(
            configuration,
            name,
            boot,
            engine=make_engine(settings, model, configuration.prior),
            sources=settings.sensors,
        )
        self.held.limit_guarantee(declared_guarantee(configuration, settings))
        self._received = ReceivedData(configuration, settings.sensors, self.timeline, settings.kind)
        self._sensor_of_row = [sensor for sensor in settings.sensors for _ in configuration.sensors[sensor].C]
        self._inconsistent: set[int] = set()
        """Steps in a row, up to the current one, whose data contradicted the set."""
        self._restart_search = RestartSearch(configuration, self.held.epochs)
        self._is_tested = True
        """Whether data of a later step have agreed with the set of the mesh that the node started from."""
        self._started_at = 0
        self._transfer = Transfer(configuration, settings)
        self._factor = 1.0
        """By how much r was widened in the current step."""
        self._counts["transfers rejected"] = 0
        self._send_on_gain = SendOnGain(configuration, settings)
        if settings.publish_when:
            self._counts["predictions not sent"] = 0
        self._announced: Suggestion | None = None
        """Bounds that are adopted at a step to come."""

    @property
    def deadline(self) -> int:
        return int(self.settings.deadline * SECOND)

    @property
    def history(self) -> int:
        return self.settings.history

    @property
    def remembered(self) -> int:
        """A step that is done again may carry a fused box on that was old already when the step was first done."""
        return self.history + MAX_BOX_AGE

    def subscriptions(self) -> Sequence[tuple[str, str]]:
        return subscriptions(self.configuration, self.role, self.name)

    def receive(self, message: Message, now: int) -> list[Message]:
        if isinstance(message, Measurement):
            return self._receive_measurement(message, now)
        if isinstance(message, Input):
            return self.take_input(message, now)
        if isinstance(message, Suggestion):
            self._receive_bounds(message)
        elif isinstance(message, Prediction):
            self.held.epochs.record(message)
            self._transfer.record(message)
        elif isinstance(message, Posterior):
            self._receive_set(message)
        return []

    def _receive_bounds(self, message: Suggestion) -> None:
        if message.adopt_at is not None and (self._announced is None or message.sent_ns >= self._announced.sent_ns):
            self._announced = message

    def _receive_set(self, message: Posterior) -> None:
        self.held.epochs.record(message)
        if isinstance(message, Fused):
            if message.name in self.settings.transfer_from:
                self._transfer.record(message)
            self._restart_search.record(message)
        if self.current is None:
            self.take_candidate(message)

    def _receive_measurement(self, message: Measurement, now: int) -> list[Message]:
        self.useless.record_step(message.name, message.step, now)
        if message.step < 1:
            self._received.count(Unused(message, BEFORE_PRIOR))
            late_ns = self.configuration.grid.time_of(max(1, self.timeline.arrivals.newest)) - message.time_ns
            self.useless.record_seconds(message.name, BEFORE_PRIOR, late_ns / SECOND, now=now)
            return []
        first = None if is_timed(message) else self.timeline.untimed(message.step, message.name)
        if first is None:
            self.take(message.name, message, now)
            if message.step <= self.timeline.arrivals.newest:  # not from the future
                self._received.note(message)
        elif first.y != message.y:
            text = f"{message.name} sent step {message.step} again with another value; the first counts"
            about: About = {"sensor": message.name, "step": message.step}
            return [self.event("WARN", "measurement-changed", text, now=now, step=message.step, about=about)]
        return []

    def is_complete(self, k: int, step: Step, source: str) -> bool:
        return self._received.is_complete(k, step, source)

    def lacks_input(self, k: int, step: Step, now: int) -> str:
        j = self._received.missing_input(k, step, lambda: self.is_overdue(k, now))
        return "" if j is None else f"input of step {j} ({input_key(self.configuration)})"

    def counters(self) -> dict[str, float]:
        return super().counters() | self._received.counts

    # -- one step

    def combine(self, k: int, step: Step, now: int) -> tuple[Combined, list[Message]]:
        self._factor = 1.0
        adopted = self._adopt(k, now)
        data = self._received.gather(k, step, self.engine.model.r)
        missing = [name for name in self.sources if not data.has(name)]
        messages = [*adopted, *self._repair(data, now)]
        if step.origin is None:  # another set is held than that which was carried on from the step before
            data = self._received.at_start(data)
        origin = min((one.message.origin_ns for one in data.data), default=None)
        nothing = Combined("inconsistent", used=[], missing=missing, origin=origin, cause=self.held.unsound)
        if self.held.unsound:
            return nothing, messages
        outcome, told = self._update(data, step, now)
        messages += told
        if self.held.unsound:  # the data are not in the set: it is the one from before, of which nothing is believed
            return replace(nothing, cause=str(outcome.error)), messages
        if step.origin is None:
            data = self._received.at_start(data)
        for message in outcome.transfers:
            self.held.add_dependency(message)
            if self._transfer.way == "data-predictor":
                self.held.downgrade_guarantee("none")
        used = [
            *data.seen,
            *(one.message.reference for one in data.inside),
            *(message.reference for message in outcome.transfers),
            *(one.message.reference for one in data.at_end),
        ]
        return Combined(
            status=outcome.status,
            used=used,
            missing=missing,
            origin=origin,
            cause=outcome.cause,
            gain=outcome.gain,
            gain_of=outcome.gain_of,
        ), messages

    def _adopt(self, k: int, now: int) -> list[Message]:
        """Go by announced bounds from their step on: from the domain, in a new epoch, and never better than learned."""
        message, domain = self._announced, self.engine.model.domain
        if message is None or domain is None or not is_due(message, k):
            return []
        self._announced = None
        model = adopted_model(self.configuration, self.settings, message)
        self.held.adopt(make_engine(self.settings, model, domain))
        self._restart_search.forget()
        self._inconsistent.clear()
        self.abandon_epoch("")
        self.start_from("domain", (message.reference,))
        text = f"step {k}: adopted the bounds that {message.src} found; started again from the domain"
        about: About = {"step": k, "epoch": self.held.epochs.number, "source": message.src, "factor": message.factor}
        return [self.event("WARN", "bounds-adopted", text, now=now, step=k, about=about)]

    def _update(self, data: StepData, step: Step, now: int) -> tuple[FilterOutcome, list[Message]]:
        """The step's transfers and data, and what the node does where they contradict the set."""
        k, inputs, is_replay = data.k, self.timeline.inputs, step.transfers is not None
        before = self.engine.snapshot()
        transfers = Transfers(
            self._transfers(k, step, inputs),
            lambda message: self._transfer.as_set(message, k, self.engine, inputs),
            self.settings.transfer_gain,
        )
        rule = contradiction_rule(self.settings.on_inconsistency) if self._is_tested else "refuse"
        outcome = filter_step(self.engine, data, transfers, rule)
        # a transfer that misses the set was told of when the step was first done
        rejected = [one for one in outcome.rejected if one.by_data or not is_replay]
        self._counts["transfers rejected"] += len(rejected)
        messages = [rejected_event(self, k, one, now=now) for one in rejected]
        if outcome.error is None:
            if outcome.status == "ok":
                self._agree(k)
            return outcome, messages
        self._counts["contradictions"] += 1
        if not self._is_tested:
            self.engine.restore(before)
            start = self._refuse_start(data, outcome.error, now)
            return replace(outcome, transfers=(), gain=None, gain_of=None), [*messages, *start]
        if outcome.status == "ok":
            self._factor = outcome.factor
            self.held.downgrade_guarantee("learned")
            return outcome, [*messages, widened_event(self, k, outcome, now=now)]
        epoch = self.held.epochs.number
        messages += self._drop(data, outcome, now)
        if epoch != self.held.epochs.number:
            outcome = replace(outcome, transfers=(), gain=None, gain_of=None)
        return outcome, messages

    def _transfers(self, k: int, step: Step, inputs: Mapping[int, Input]) -> list[Prediction | Fused]:
        """What others know of the step, chosen when it was first done; nothing of an abandoned epoch."""
        if self._transfer.way == "off":
            return []
        if step.transfers is None:
            has_inputs = self.engine.model.input_count > 0
            step.transfers = self._transfer.available(k, inputs, self.held.epochs, needs_inputs=has_inputs)
            self._transfer.forget_before(k - MAX_BOX_AGE)
        return [message for message in step.transfers if not self.held.epochs.is_abandoned(message)]

    def _agree(self, k: int) -> None:
        self._inconsistent.clear()
        self._is_tested = self._is_tested or k > self._started_at

    # -- contradictions

    def _drop(self, data: StepData, outcome: FilterOutcome, now: int) -> list[Message]:
        """Tell what was left out because it contradicts the prediction; reset when it goes on."""
        self._inconsistent.add(data.k)
        strips, dropped = list(outcome.strips), outcome.dropped
        if dropped is not None and data.y is not None:
            of_row, outputs = self._sensor_of_row, self.engine.model.outputs
            strips += dropped.strips(data.y, lambda row: (of_row[row], outputs[row]))
        messages = [dropped_event(self, data.k, strip, now=now) for strip in strips]
        if self.settings.on_inconsistency == "reset" and len(self._inconsistent) >= self.settings.reset_after:
            messages.append(self._reset(data, now))
        return messages

    def _reset(self, data: StepData, now: int) -> Message:
        """Too many contradictions in a row: start again from something sound, or say that there is nothing."""
        self._inconsistent.clear()
        k, count = data.k, self.settings.reset_after
        data = self._received.at_start(data)
        start = self._start_again(data, abandons=True)
        if start is not None:
            self.abandon_epoch("")
            self._hold(start)
            data.update(self.engine)
            text = f"step {k}: {count} steps in a row contradicted the set; started again from {start.words}"
            about: About = {"step": k, "epoch": self.held.epochs.number}
            return self.event("ERROR", "reset", text, now=now, step=k, about=about)
        text = (
            f"step {k}: {count} steps in a row contradicted the set and there is nothing sound to "
            "start again from; give the model a domain, or check the declared bounds"
        )
        return self.event("ERROR", "reset-impossible", text, now=now, step=k, about={"step": k})

    def _refuse_start(self, data: StepData, error: InconsistentData, now: int) -> list[Message]:
        """The set that the node started from misses the first data: it was not sound."""
        self._is_tested = True
        data = self._received.at_start(data)
        event = self._abandon(data, f"the set that it started from contradicts the data: {error}", about={}, now=now)
        if not self.held.unsound:
            data.update(self.engine)
        return [event]

    def _repair(self, data: StepData, now: int) -> list[Message]:
        """Leave an epoch that a source has abandoned; where there was nothing sound to start from, look again."""
        source, k = self.held.epochs.abandoned, data.k
        if source is not None:
            return [self._abandon(data, f"{source} has abandoned its epoch", about={"source": source}, now=now)]
        start = self._start_again(data, abandons=False) if self.held.unsound else None
        if start is None:
            return []
        self._hold(start)
        text = f"step {k}: started again from {start.words}"
        about: About = {"step": k, "epoch": self.held.epochs.number}
        return [self.event("INFO", "found-start", text, now=now, step=k, about=about)]

    def _abandon(self, data: StepData, why: str, about: About, now: int) -> Message:
        """A new epoch at once, so that others learn of it; held is something sound, or nothing that may be believed."""
        k, start = data.k, self._start_again(data, abandons=True)
        self.abandon_epoch(f"{why}; there is nothing sound to start again from")
        about = about | {"step": k, "epoch": self.held.epochs.number}
        if start is None:
            return self.event("ERROR", "epoch-lost", f"step {k}: {self.held.unsound}", now=now, step=k, about=about)
        self._hold(start)
        text = f"step {k}: {why}; started again from {start.words}"
        return self.event("WARN", "epoch-left", text, now=now, step=k, about=about)

    def _hold(self, start: Start) -> None:
        self.engine.restore(start.set)
        self.start_from(start.base, tuple(start.used))
        if start.message is not None:
            self.held.add_dependency(start.message)

    def _start_again(self, data: StepData, *, abandons: bool) -> Start | None:
        """A set of the step, before its data, that is sound and meets them; ``None`` where there is none."""
        at_start, inputs = self._received.at_start(data), self.timeline.inputs
        return self._restart_search.find(self.engine, at_start, reach=self.held.reach, inputs=inputs, abandons=abandons)

    def _start_from_candidate(self) -> bool:
        if not super()._start_from_candidate():
            return False
        assert self.current is not None
        self._is_tested, self._started_at = False, self.current
        return True

    # -- messages out

    def posterior(self, k: int, step: Step, combined: Combined, support: SupportMessage, now: int) -> Posterior:
        held = self.held
        return Posterior(
            **self.stamp("posterior", k, now, combined.origin),
            **described(self.engine),
            kind=self.settings.kind,
            support=support,
            status=combined.status,
            revision=step.revision,
            epoch=held.epochs.number,
            descent=held.descent,
            guarantee=held.guarantee,
            base=held.base,
            used=list(combined.used),
            bounds=self.noise_bounds(self._factor),
            missing=list(combined.missing),
            cause=combined.cause,
            gain=None if combined.gain is None else finite_or_none(combined.gain),
            gain_of=combined.gain_of,
            algorithm=filter_algorithm(self.settings, self.engine),
        )

    def is_told(self, step: Step) -> bool:
        """The smoothed set too is what it was: a step that is done again may change it alone."""
        found = {} if step.published is None else smoothed(self.engine, step.published)
        return all(getattr(step.smoothed, name, None) == value for name, value in found.items())

    def beside(self, posterior: Posterior, step: Step, now: int) -> list[Message]:
        step.smoothed, fields = None, smoothed(self.engine, posterior)
        if not fields:
            return []
        stamp = self.stamp("smoothed", posterior.step - self.engine.lag, now, posterior.origin_ns)
        step.smoothed = Smoothed(**stamp, **fields)
        return [step.smoothed]

    def prediction(self, k: int, now: int) -> list[Message]:
        held = self.held
        if not can_foretell(self.engine, self.configuration.input_box):
            return []
        if not self._send_on_gain.publishes(k, held, self.timeline.inputs):
            self._counts["predictions not sent"] += 1
            return []
        is_input_known = self.timeline.has_input(k - 1) or not self.engine.model.input_count
        return [
            Prediction(
                **self.stamp("prediction", k, now),
                **foretold(self.engine, self.configuration.input_box),
                support=to_message(self.engine.support),
                epoch=held.epochs.number,
                descent=held.descent,
                guarantee=held.guarantee,
                base=held.base,
                used=list(held.used),
                bounds=self.noise_bounds(),
                missing=[] if is_input_known else ["input"],
                algorithm=filter_algorithm(self.settings, self.engine),
            )
        ]
