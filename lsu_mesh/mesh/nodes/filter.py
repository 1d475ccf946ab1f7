"""A filter as a node: measurements, inputs and transfers in, predictions and posteriors out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData
from lsu_mesh.mesh.access import PUBLISHES, subscriptions
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.estimation.adoption import adopted_model, is_due, make_engine
from lsu_mesh.mesh.estimation.inconsistency import Dropped, update_without_contradicting_strips, widen
from lsu_mesh.mesh.estimation.message_fields import described, finite_or_none, foretold
from lsu_mesh.mesh.estimation.restart import RestartSearch, Start
from lsu_mesh.mesh.estimation.step_record import Combined, Status, Step
from lsu_mesh.mesh.estimation.transfer import MAX_BOX_AGE, Transfer
from lsu_mesh.mesh.messages import (
    Bounds,
    Fused,
    Input,
    Measurement,
    Message,
    Posterior,
    Prediction,
    Reference,
    Suggestion,
    SupportMessage,
)
from lsu_mesh.mesh.nodes.estimator import WEAKNESS, About, Estimator
from lsu_mesh.mesh.nodes.node import SECOND
from lsu_mesh.mesh.sets import to_message


@dataclass(frozen=True)
class Brought:
    """Transfers that were brought to a prediction, and their gain in nats."""

    used: Sequence[Prediction | Fused] = ()
    gain: float | None = None


@dataclass(frozen=True)
class Updated:
    """What came of a data update, and the transfers that are still in the set."""

    status: Status
    brought: Brought = Brought()
    cause: str | None = None
    messages: Sequence[Message] = ()


class FilterNode(Estimator):
    """Runs one filter of the library on the measurements of its sensors."""

    role = "filter"
    publishes = PUBLISHES["filter"]
    answers = ("posterior",)

    def __init__(self, configuration: Configuration, name: str, boot: str) -> None:
        settings = configuration.filters[name]
        self.settings = settings
        model = configuration.model(settings.sensors)
        super().__init__(configuration, name, boot, make_engine(settings, model, configuration.prior), settings.sensors)
        self._rows: dict[str, slice] = {}
        start = 0
        for sensor in settings.sensors:
            self._rows[sensor] = slice(start, start + len(configuration.sensors[sensor].C))
            start = self._rows[sensor].stop
        self._inconsistent: set[int] = set()
        """Steps in a row, up to the current one, whose data contradicted the set."""
        self._restart_search = RestartSearch(self.epochs)
        self._is_tested = True
        """Whether data of a later step have agreed with the set of the mesh that the node started from."""
        self._started_at = 0
        self._transfer = Transfer(configuration, settings)
        self._widened: float | None = None
        """Factor by which r was widened in the current step."""
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
            self.epochs.record(message)
            self._transfer.record(message)
        elif isinstance(message, Posterior):
            self._receive_set(message)
        return []

    def _receive_bounds(self, message: Suggestion) -> None:
        if message.adopt_at is not None and (self._announced is None or message.sent_ns >= self._announced.sent_ns):
            self._announced = message

    def _receive_set(self, message: Posterior) -> None:
        self.epochs.record(message)
        if isinstance(message, Fused):
            if message.name in self.settings.transfer_from:
                self._transfer.record(message)
            self._restart_search.record(message)
        if self.current is None:
            self.take_candidate(message)

    def _receive_measurement(self, message: Measurement, now: int) -> list[Message]:
        first = self.arrived(message.step, message.name)
        if first is None:
            self.take(message.name, message, now)
        elif isinstance(first, Measurement) and first.y != message.y:
            text = f"{message.name} sent step {message.step} again with another value; the first counts"
            about: About = {"sensor": message.name, "step": message.step}
            return [self.event("WARN", "measurement-changed", text, now, message.step, about)]
        return []

    # -- one step

    def combine(self, k: int, step: Step, now: int) -> tuple[Combined, list[Message]]:
        self._widened = None
        adopted = self._adopt(k, now)
        y, used, origin = self._stack(step)
        missing = [name for name in self.sources if name not in step.arrived]
        messages = [*adopted, *self._repair(k, y, now)]
        if self.unsound:
            return Combined("inconsistent", [], missing, origin, self.unsound), messages
        before = self.engine.snapshot()
        brought, told = self._bring_transfers(k, step, now)
        updated = self._update(k, y, before, brought, now)
        for message in updated.brought.used:
            self.add_dependency(message)
            if self._transfer.way == "data-predictor":
                self.downgrade_guarantee("none")
        transferred = [message.reference for message in updated.brought.used]
        gain = updated.brought.gain
        combined = Combined(updated.status, [*transferred, *used], missing, origin, updated.cause, gain)
        return combined, [*messages, *told, *updated.messages]

    def _adopt(self, k: int, now: int) -> list[Message]:
        """Go by announced bounds from their step on: from the domain, in a new epoch, and never better than learned."""
        message, domain = self._announced, self.engine.model.domain
        if message is None or domain is None or not is_due(message, k):
            return []
        self._announced = None
        self.engine = make_engine(self.settings, adopted_model(self.configuration, self.settings, message), domain)
        self.best_guarantee = max(self.best_guarantee, "learned", key=WEAKNESS.index)
        self.reach.lose()
        self._restart_search.forget()
        self._inconsistent.clear()
        self.abandon_epoch("")
        self.start_from("domain", [message.reference])
        text = f"step {k}: adopted the bounds that {message.src} found; started again from the domain"
        about: About = {"step": k, "epoch": self.epochs.number, "source": message.src, "factor": message.factor}
        return [self.event("WARN", "bounds-adopted", text, now, k, about)]

    def _stack(self, step: Step) -> tuple[Vector, list[Reference], int | None]:
        """Measured outputs by sensor name, then row, NaN where missing; what was used; the oldest sending time."""
        y = np.full(self.engine.model.output_count, np.nan)
        used, origins = [], []
        for name in self.sources:
            message = step.arrived.get(name)
            if not isinstance(message, Measurement):
                continue
            values = [np.nan if value is None else value for value in message.y]
            y[self._rows[name]] = values
            if not np.isnan(values).all():
                used.append(message.reference)
                origins.append(message.origin_ns)
        return y, used, min(origins) if origins else None

    def _bring_transfers(self, k: int, step: Step, now: int) -> tuple[Brought, list[Message]]:
        """Condition the prediction on what others know."""
        if self._transfer.way == "off":
            return Brought(), []
        inputs, is_replay = self.inputs(), step.transfers is not None
        if step.transfers is None:
            has_inputs = self.engine.model.input_count > 0
            step.transfers = self._transfer.available(k, inputs, self.epochs, needs_inputs=has_inputs)
            self._transfer.forget_before(k - MAX_BOX_AGE)
        used: list[Prediction | Fused] = []
        gain = 0.0
        messages: list[Message] = []
        for message in step.transfers:
            if self.epochs.is_abandoned(message):
                continue
            try:
                gain += self.engine.condition(self._transfer.as_set(message, k, self.engine, inputs))
            except InconsistentData as error:
                if not is_replay:
                    messages.append(self._transfer_event(k, message, error, now))
                continue
            used.append(message)
        return Brought(used, gain if used else None), messages

    def _transfer_event(self, k: int, message: Message, why: object, now: int) -> Message:
        self._counts["transfers rejected"] += 1
        text = f"step {k}: the transfer from {message.src} was left out: {why}"
        return self.event("WARN", "transfer-rejected", text, now, k, {"source": message.src, "step": k})

    def _update(self, k: int, y: Vector, before: object, brought: Brought, now: int) -> Updated:
        """Data update; ``before`` is the set without the transfers, which give way where they alone contradict y."""
        if np.isnan(y).all():
            return Updated("predicted", brought)
        try:
            self.engine.update(y)
        except InconsistentData as error:
            return self._contradiction(k, y, before, brought, error, now)
        self._agree(k)
        return Updated("ok", brought)

    def _agree(self, k: int) -> None:
        self._inconsistent.clear()
        self._is_tested = self._is_tested or k > self._started_at

    # -- contradictions

    def _contradiction(
        self, k: int, y: Vector, before: object, brought: Brought, error: InconsistentData, now: int
    ) -> Updated:
        """What is done when the data are proved to miss the set."""
        if brought.used and self._agrees_without_transfers(y, before):
            self._agree(k)
            why = "it contradicts the data"
            return Updated("ok", messages=[self._transfer_event(k, message, why, now) for message in brought.used])
        self._counts["contradictions"] += 1
        if not self._is_tested:
            return Updated("inconsistent", cause=str(error), messages=self._refuse_start(k, y, error, now))
        if self.settings.on_inconsistency == "widen":
            self._widened = widen(self.engine, y)
            if self._widened is not None:
                self.downgrade_guarantee("learned")
                cause = f"{error}; r widened by {self._widened:.6g}"
                return Updated("ok", brought, cause, [self._widened_event(k, error, now)])
        epoch = self.epochs.number
        messages = self._drop(k, y, now)
        return Updated("inconsistent", brought if epoch == self.epochs.number else Brought(), str(error), messages)

    def _agrees_without_transfers(self, y: Vector, before: object) -> bool:
        """Update the set as it was before the transfers; False, and as it was after them, where y misses that too."""
        after = self.engine.snapshot()
        self.engine.restore(before)
        try:
            self.engine.update(y)
        except InconsistentData:
            self.engine.restore(after)
            return False
        return True

    def _widened_event(self, k: int, error: InconsistentData, now: int) -> Message:
        text = f"step {k}: {error}; r was widened by {self._widened:.4g} in this step, the set is no longer guaranteed"
        return self.event("WARN", "widened", text, now, k, {"step": k, "factor": self._widened})

    def _drop(self, k: int, y: Vector, now: int) -> list[Message]:
        """Leave out what contradicts the prediction; reset when it goes on."""
        self._inconsistent.add(k)
        dropped = update_without_contradicting_strips(self.engine, y)
        messages = [self._dropped_event(k, row, y, dropped, now) for row in (*dropped.alone, *dropped.together)]
        if self.settings.on_inconsistency == "reset" and len(self._inconsistent) >= self.settings.reset_after:
            messages.append(self._reset(k, y, now))
        return messages

    def _dropped_event(self, k: int, row: int, y: Vector, dropped: Dropped, now: int) -> Message:
        sensor = next(name for name, rows in self._rows.items() if rows.start <= row < rows.stop)
        output, gap = self.engine.model.outputs[row], dropped.gap(row, y)
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
        return self.event("WARN", "contradiction", text, now, k, about)

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
            return self.event("ERROR", "reset", text, now, k, {"step": k, "epoch": self.epochs.number})
        text = (
            f"step {k}: {count} steps in a row contradicted the set and there is nothing sound to "
            "start again from; give the model a domain, or check the declared bounds"
        )
        return self.event("ERROR", "reset-impossible", text, now, k, {"step": k})

    def _refuse_start(self, k: int, y: Vector, error: InconsistentData, now: int) -> list[Message]:
        """The set that the node started from misses the first data: it was not sound."""
        self._is_tested = True
        event = self._abandon(k, y, f"the set that it started from contradicts the data: {error}", {}, now)
        if not self.unsound:
            self.engine.update(y)
        return [event]

    def _repair(self, k: int, y: Vector, now: int) -> list[Message]:
        """Leave an epoch that a source has abandoned; where there was nothing sound to start from, look again."""
        source = self.epochs.abandoned
        if source is not None:
            return [self._abandon(k, y, f"{source} has abandoned its epoch", {"source": source}, now)]
        start = self._start_again(k, y, abandons=False) if self.unsound else None
        if start is None:
            return []
        self._hold(start)
        text = f"step {k}: started again from {start.words}"
        return [self.event("INFO", "found-start", text, now, k, {"step": k, "epoch": self.epochs.number})]

    def _abandon(self, k: int, y: Vector, why: str, about: About, now: int) -> Message:
        """A new epoch at once, so that others learn of it; held is something sound, or nothing that may be believed."""
        start = self._start_again(k, y, abandons=True)
        self.abandon_epoch(f"{why}; there is nothing sound to start again from")
        about = about | {"step": k, "epoch": self.epochs.number}
        if start is None:
            return self.event("ERROR", "epoch-lost", f"step {k}: {self.unsound}", now, k, about)
        self._hold(start)
        text = f"step {k}: {why}; started again from {start.words}"
        return self.event("WARN", "epoch-left", text, now, k, about)

    def _hold(self, start: Start) -> None:
        self.engine.restore(start.set)
        self.start_from(start.base, start.used)
        if start.message is not None:
            self.add_dependency(start.message)

    def _start_again(self, k: int, y: Vector, *, abandons: bool) -> Start | None:
        """A set of step k, before its data, that is sound and meets them; ``None`` where there is none."""
        return self._restart_search.find(self.engine, k, y, self.reach.box, self.inputs(), abandons=abandons)

    def _start_from_candidate(self) -> bool:
        if not super()._start_from_candidate():
            return False
        assert self.current is not None
        self._is_tested, self._started_at = False, self.current
        return True

    # -- messages out

    def posterior(self, k: int, step: Step, combined: Combined, support: SupportMessage, now: int) -> Posterior:
        return Posterior(
            **self.stamp("posterior", k, now, combined.origin),
            **described(self.engine),
            kind=self.settings.kind,
            support=support,
            status=combined.status,
            revision=step.revision,
            epoch=self.epochs.number,
            descent=self.epochs.descent,
            guarantee=self.guarantee,
            base=self._base,
            used=list(combined.used),
            bounds=self._bounds_in_force(),
            missing=list(combined.missing),
            cause=combined.cause,
            gain=None if combined.gain is None else finite_or_none(combined.gain),
        )

    def _bounds_in_force(self) -> Bounds:
        rho, r = self.engine.half_widths
        return Bounds(rho=rho.tolist(), r=(r * (self._widened or 1.0)).tolist())

    def prediction(self, k: int, now: int) -> list[Message]:
        return [
            Prediction(
                **self.stamp("prediction", k, now),
                **foretold(self.engine),
                support=to_message(self.engine.support),
                epoch=self.epochs.number,
                descent=self.epochs.descent,
                guarantee=self.guarantee,
            )
        ]
