"""A filter as a node: measurements, inputs and transfers in, predictions and posteriors out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData
from lsu_mesh.mesh.access import PUBLISHES, subscriptions
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.estimation.adoption import adopted_model, is_due, make_engine
from lsu_mesh.mesh.estimation.filter_step import (
    FilterOutcome,
    RejectedTransfer,
    contradiction_rule,
    filter_step,
    stack,
)
from lsu_mesh.mesh.estimation.inconsistency import Dropped
from lsu_mesh.mesh.estimation.message_fields import described, finite_or_none, foretold
from lsu_mesh.mesh.estimation.restart import RestartSearch, Start
from lsu_mesh.mesh.estimation.step_record import Combined, Step
from lsu_mesh.mesh.estimation.transfer import MAX_BOX_AGE, Transfer
from lsu_mesh.mesh.messages import (
    Fused,
    Input,
    Measurement,
    Message,
    Posterior,
    Prediction,
    Suggestion,
    SupportMessage,
)
from lsu_mesh.mesh.nodes.estimator import About, Estimator
from lsu_mesh.mesh.nodes.node import SECOND
from lsu_mesh.mesh.sets import to_message


class FilterNode(Estimator):
    """Runs one filter of the library on the measurements of its sensors."""

    role = "filter"
    publishes = PUBLISHES["filter"]
    answers = ("posterior",)

    def __init__(self, configuration: Configuration, name: str, boot: str) -> None:
        settings = configuration.filters[name]
        self.settings = settings
        model = configuration.model(settings.sensors)
        super().__init__(
            configuration,
            name,
            boot,
            engine=make_engine(settings, model, configuration.prior),
            sources=settings.sensors,
        )
        self._sensor_of_row = [sensor for sensor in settings.sensors for _ in configuration.sensors[sensor].C]
        self._inconsistent: set[int] = set()
        """Steps in a row, up to the current one, whose data contradicted the set."""
        self._restart_search = RestartSearch(self.held.epochs)
        self._is_tested = True
        """Whether data of a later step have agreed with the set of the mesh that the node started from."""
        self._started_at = 0
        self._transfer = Transfer(configuration, settings)
        self._factor = 1.0
        """By how much r was widened in the current step."""
        self._counts["transfers rejected"] = 0
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
        first = self.timeline.arrived(message.step, message.name)
        if first is None:
            self.take(message.name, message, now)
        elif isinstance(first, Measurement) and first.y != message.y:
            text = f"{message.name} sent step {message.step} again with another value; the first counts"
            about: About = {"sensor": message.name, "step": message.step}
            return [self.event("WARN", "measurement-changed", text, now=now, step=message.step, about=about)]
        return []

    # -- one step

    def combine(self, k: int, step: Step, now: int) -> tuple[Combined, list[Message]]:
        self._factor = 1.0
        adopted = self._adopt(k, now)
        measured = self._measured(step)
        y = stack(self.configuration, self.sources, measured)
        missing = [name for name in self.sources if name not in step.arrived]
        used = [message for message in measured.values() if any(value is not None for value in message.y)]
        origin = min((message.origin_ns for message in used), default=None)
        messages = [*adopted, *self._repair(k, y, now)]
        if self.held.unsound:
            return Combined(
                status="inconsistent", used=[], missing=missing, origin=origin, cause=self.held.unsound
            ), messages
        outcome, told = self._update(k, step, y, now)
        messages += told
        if self.held.unsound:  # the data are not in the set: it is the one from before, of which nothing is believed
            return Combined(
                status="inconsistent", used=[], missing=missing, origin=origin, cause=str(outcome.error)
            ), messages
        for message in outcome.transfers:
            self.held.add_dependency(message)
            if self._transfer.way == "data-predictor":
                self.held.downgrade_guarantee("none")
        references = [message.reference for message in (*outcome.transfers, *used)]
        return Combined(
            status=outcome.status,
            used=references,
            missing=missing,
            origin=origin,
            cause=self._cause(outcome),
            gain=outcome.gain,
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

    def _measured(self, step: Step) -> dict[str, Measurement]:
        """What the sensors have sent of a step, in the order of their names."""
        arrived = {name: step.arrived.get(name) for name in self.sources}
        return {name: message for name, message in arrived.items() if isinstance(message, Measurement)}

    def _update(self, k: int, step: Step, y: Vector, now: int) -> tuple[FilterOutcome, list[Message]]:
        """The step's transfers and data, and what the node does where they contradict the set."""
        inputs, is_replay = self.timeline.inputs, step.transfers is not None
        before = self.engine.snapshot()
        outcome = filter_step(
            self.engine,
            y,
            self._transfers(k, step, inputs),
            as_set=lambda message: self._transfer.as_set(message, k, self.engine, inputs),
            rule=contradiction_rule(self.settings.on_inconsistency) if self._is_tested else "refuse",
        )
        # a transfer that misses the set was told of when the step was first done
        rejected = [one for one in outcome.rejected if one.by_data or not is_replay]
        messages = [self._transfer_event(k, one, now) for one in rejected]
        if outcome.error is None:
            if outcome.status == "ok":
                self._agree(k)
            return outcome, messages
        self._counts["contradictions"] += 1
        if not self._is_tested:
            self.engine.restore(before)
            return replace(outcome, transfers=(), gain=None), [*messages, *self._refuse_start(k, y, outcome.error, now)]
        if outcome.dropped is None:
            self._factor = outcome.factor
            self.held.downgrade_guarantee("learned")
            return outcome, [*messages, self._widened_event(k, outcome.error, now)]
        epoch = self.held.epochs.number
        messages += self._drop(k, y, outcome.dropped, now)
        if epoch != self.held.epochs.number:
            outcome = replace(outcome, transfers=(), gain=None)
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

    def _transfer_event(self, k: int, rejected: RejectedTransfer, now: int) -> Message:
        self._counts["transfers rejected"] += 1
        source = rejected.message.src
        text = f"step {k}: the transfer from {source} was left out: {rejected.reason}"
        return self.event("WARN", "transfer-rejected", text, now=now, step=k, about={"source": source, "step": k})

    @staticmethod
    def _cause(outcome: FilterOutcome) -> str | None:
        if outcome.error is None:
            return None
        is_widened = outcome.status == "ok"
        return f"{outcome.error}; r widened by {outcome.factor:.6g}" if is_widened else str(outcome.error)

    def _agree(self, k: int) -> None:
        self._inconsistent.clear()
        self._is_tested = self._is_tested or k > self._started_at

    # -- contradictions

    def _widened_event(self, k: int, error: InconsistentData, now: int) -> Message:
        text = f"step {k}: {error}; r was widened by {self._factor:.4g} in this step, the set is no longer guaranteed"
        return self.event("WARN", "widened", text, now=now, step=k, about={"step": k, "factor": self._factor})

    def _drop(self, k: int, y: Vector, dropped: Dropped, now: int) -> list[Message]:
        """Tell what was left out because it contradicts the prediction; reset when it goes on."""
        self._inconsistent.add(k)
        messages = [
            self._dropped_event(k, row, y, dropped=dropped, now=now) for row in (*dropped.alone, *dropped.together)
        ]
        if self.settings.on_inconsistency == "reset" and len(self._inconsistent) >= self.settings.reset_after:
            messages.append(self._reset(k, y, now))
        return messages

    def _dropped_event(self, k: int, row: int, y: Vector, dropped: Dropped, now: int) -> Message:
        sensor, output, gap = self._sensor_of_row[row], self.engine.model.outputs[row], dropped.gap(row, y)
        lower, upper = float(dropped.band.lower[row]), float(dropped.band.upper[row])
        is_alone = row in dropped.alone
        if is_alone:
            why = f"lies {gap:.4g} outside [{lower:.6g}, {upper:.6g}], all that the declared bounds allow"
        else:
            why = "contradicts the prediction together with the step's other measurements"
        text = f"step {k}: {output} = {y[row]:.6g} of sensor {sensor} {why}; left out"
        about: About = {
            "sensor": sensor, "output": output, "step": k, "y": float(y[row]), "lower": lower, "upper": upper,
            "gap": gap if is_alone else None,
        }  # fmt: skip
        return self.event("WARN", "contradiction", text, now=now, step=k, about=about)

    def _reset(self, k: int, y: Vector, now: int) -> Message:
        """Too many contradictions in a row: start again from something sound, or say that there is nothing."""
        self._inconsistent.clear()
        count = self.settings.reset_after
        start = self._start_again(k, y, abandons=True)
        if start is not None:
            self.abandon_epoch("")
            self._hold(start)
            self.engine.update(y)
            text = f"step {k}: {count} steps in a row contradicted the set; started again from {start.words}"
            return self.event(
                "ERROR", "reset", text, now=now, step=k, about={"step": k, "epoch": self.held.epochs.number}
            )
        text = (
            f"step {k}: {count} steps in a row contradicted the set and there is nothing sound to "
            "start again from; give the model a domain, or check the declared bounds"
        )
        return self.event("ERROR", "reset-impossible", text, now=now, step=k, about={"step": k})

    def _refuse_start(self, k: int, y: Vector, error: InconsistentData, now: int) -> list[Message]:
        """The set that the node started from misses the first data: it was not sound."""
        self._is_tested = True
        event = self._abandon(k, y, f"the set that it started from contradicts the data: {error}", about={}, now=now)
        if not self.held.unsound:
            self.engine.update(y)
        return [event]

    def _repair(self, k: int, y: Vector, now: int) -> list[Message]:
        """Leave an epoch that a source has abandoned; where there was nothing sound to start from, look again."""
        source = self.held.epochs.abandoned
        if source is not None:
            return [self._abandon(k, y, f"{source} has abandoned its epoch", about={"source": source}, now=now)]
        start = self._start_again(k, y, abandons=False) if self.held.unsound else None
        if start is None:
            return []
        self._hold(start)
        text = f"step {k}: started again from {start.words}"
        return [
            self.event(
                "INFO", "found-start", text, now=now, step=k, about={"step": k, "epoch": self.held.epochs.number}
            )
        ]

    def _abandon(self, k: int, y: Vector, why: str, about: About, now: int) -> Message:
        """A new epoch at once, so that others learn of it; held is something sound, or nothing that may be believed."""
        start = self._start_again(k, y, abandons=True)
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

    def _start_again(self, k: int, y: Vector, *, abandons: bool) -> Start | None:
        """A set of step k, before its data, that is sound and meets them; ``None`` where there is none."""
        inputs = self.timeline.inputs
        return self._restart_search.find(self.engine, k, y, reach=self.held.reach, inputs=inputs, abandons=abandons)

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
            algorithm=self.engine.algorithm,
        )

    def prediction(self, k: int, now: int) -> list[Message]:
        held = self.held
        is_input_known = self.timeline.has_input(k - 1) or not self.engine.model.input_count
        return [
            Prediction(
                **self.stamp("prediction", k, now),
                **foretold(self.engine),
                support=to_message(self.engine.support),
                epoch=held.epochs.number,
                descent=held.descent,
                guarantee=held.guarantee,
                base=held.base,
                used=list(held.used),
                bounds=self.noise_bounds(),
                missing=[] if is_input_known else ["input"],
                algorithm=self.engine.algorithm,
            )
        ]
