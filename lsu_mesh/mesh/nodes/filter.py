"""A filter as a node: measurements, inputs and transfers in, predictions and posteriors out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lsu_mesh.errors import InconsistentData
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.registry import filter_class
from lsu_mesh.mesh.access import PUBLISHES, subscriptions
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.messages import (
    Bounds,
    Fused,
    Input,
    Measurement,
    Message,
    Posterior,
    Prediction,
    Reference,
    SupportMessage,
)
from lsu_mesh.mesh.nodes.contradiction import Dropped, update_without_contradicting_strips, widen
from lsu_mesh.mesh.nodes.estimator import Base, Combined, Estimator, Status, Step, finite_or_none
from lsu_mesh.mesh.nodes.node import SECOND
from lsu_mesh.mesh.nodes.transfer import OLDEST_BOX, Transfer
from lsu_mesh.mesh.sets import to_message, to_support
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.parallelotope import Parallelotope
from lsu_mesh.supports.support import Support, Vector

About = dict[str, str | int | float | None]


class FilterNode(Estimator):
    """Runs one filter of the library on the measurements of its sensors."""

    role = "filter"
    publishes = PUBLISHES["filter"]
    answers = ("posterior",)

    def __init__(self, configuration: Configuration, name: str, boot: str) -> None:
        settings = configuration.filters[name]
        self.settings = settings
        model = configuration.model(settings.sensors)
        engine = filter_class(settings.kind)(model, configuration.prior, **settings.options)  # type: ignore[call-arg]
        super().__init__(configuration, name, boot, engine, settings.sensors)
        self._rows: dict[str, slice] = {}
        start = 0
        for sensor in settings.sensors:
            self._rows[sensor] = slice(start, start + len(configuration.sensors[sensor].C))
            start = self._rows[sensor].stop
        self._inconsistent: set[int] = set()
        """Steps in a row, up to the current one, whose data contradicted the set."""
        self._fused: Fused | None = None
        self._transfer = Transfer(configuration, settings)
        self._widened: float | None = None
        """Factor by which r was widened in the current step."""
        self._counts["transfers rejected"] = 0

    @property
    def deadline(self) -> int:
        return int(self.settings.deadline * SECOND)

    @property
    def history(self) -> int:
        return self.settings.history

    def subscriptions(self) -> Sequence[tuple[str, str]]:
        return subscriptions(self.configuration, self.role, self.name)

    def receive(self, message: Message, now: int) -> list[Message]:
        if isinstance(message, Measurement):
            return self._receive_measurement(message, now)
        if isinstance(message, Input):
            return self.take_input(message, now)
        if isinstance(message, Prediction):
            if self.watch_epoch(message):
                self._transfer.note(message)
        elif isinstance(message, Posterior):
            self._receive_set(message)
        return []

    def _receive_set(self, message: Posterior) -> None:
        if message.name != self.name and not self.watch_epoch(message):
            return
        if isinstance(message, Fused):
            if message.name in self.settings.transfer_from:
                self._transfer.note(message)
            if message.status in ("ok", "predicted"):
                self._fused = message
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
        y, used, origin = self._stack(step)
        missing = [name for name in self.sources if name not in step.arrived]
        messages = [] if self.abandoned is None else self._leave_epoch(k, y, now)
        transferred, gain, told = self._bring_transfers(k, step, now)
        epoch = self.epoch
        status, cause, complaints = self._update(k, y, now)
        if self.epoch > epoch:  # reset: what was transferred went into the set that was given up
            transferred, gain = [], None
        if self.abandoned is not None:
            status, cause = "inconsistent", f"descends from an epoch that {self.abandoned} has abandoned"
        combined = Combined(status, [*transferred, *used], missing, origin, cause, gain)
        return combined, [*messages, *told, *complaints]

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

    def _bring_transfers(self, k: int, step: Step, now: int) -> tuple[list[Reference], float | None, list[Message]]:
        """Condition the prediction on what others know: references, gain in nats, events."""
        if self._transfer.way == "off":
            return [], None, []
        inputs, is_replay = self.inputs(), step.transfers is not None
        if step.transfers is None:
            step.transfers = self._transfer.available(k, inputs, needs_inputs=self.engine.model.input_count > 0)
            self._transfer.forget_before(k - OLDEST_BOX)
        used: list[Reference] = []
        gain = 0.0
        messages: list[Message] = []
        for message in step.transfers:
            try:
                gain += self.engine.condition(self._transfer.as_set(message, k, self.engine, inputs))
            except InconsistentData as error:
                if not is_replay:
                    messages.append(self._transfer_event(k, message, error, now))
                continue
            used.append(message.reference)
            self.rely(message)
            if self._transfer.way == "data-predictor":
                self.weaken("none")
        return used, gain if used else None, messages

    def _transfer_event(self, k: int, message: Message, error: InconsistentData, now: int) -> Message:
        self._counts["transfers rejected"] += 1
        text = f"step {k}: the transfer from {message.src} was left out: {error}"
        return self.event("WARN", "transfer-rejected", text, now, k, {"source": message.src, "step": k})

    def _update(self, k: int, y: Vector, now: int) -> tuple[Status, str | None, list[Message]]:
        """Data update; status, cause and events."""
        if np.isnan(y).all():
            return "predicted", None, []
        try:
            self.engine.update(y)
            self._inconsistent.clear()
        except InconsistentData as error:
            self._counts["contradictions"] += 1
            if self.settings.on_contradiction == "widen":
                self._widened = widen(self.engine, y)
                if self._widened is not None:
                    self.weaken("learned")
                    return "ok", f"{error}; r widened by {self._widened:.6g}", [self._widened_event(k, error, now)]
            return "inconsistent", str(error), self._drop(k, y, now)
        return "ok", None, []

    # -- contradictions

    def _widened_event(self, k: int, error: InconsistentData, now: int) -> Message:
        text = f"step {k}: {error}; r was widened by {self._widened:.4g} in this step, the set is no longer guaranteed"
        return self.event("WARN", "widened", text, now, k, {"step": k, "factor": self._widened})

    def _drop(self, k: int, y: Vector, now: int) -> list[Message]:
        """Leave out what contradicts the prediction; reset when it goes on."""
        self._inconsistent.add(k)
        dropped = update_without_contradicting_strips(self.engine, y)
        messages = [self._dropped_event(k, row, y, dropped, now) for row in (*dropped.alone, *dropped.together)]
        if self.settings.on_contradiction == "reset" and len(self._inconsistent) >= self.settings.reset_after:
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
        words = self._restart(k, y)
        if words:
            self.engine.update(y)
            text = f"step {k}: {count} steps in a row contradicted the set; started again from {words}"
            return self.event("ERROR", "reset", text, now, k, {"step": k, "epoch": self.epoch})
        text = (
            f"step {k}: {count} steps in a row contradicted the set and there is nothing sound to "
            "start again from; give the model a domain, or check the declared bounds"
        )
        return self.event("ERROR", "reset-impossible", text, now, k, {"step": k})

    def _leave_epoch(self, k: int, y: Vector, now: int) -> list[Message]:
        """A source that was relied on has abandoned its epoch: start again from something sound, or say so."""
        source = str(self.abandoned)
        self._transfer.forget_source(source.rpartition("/")[2])
        words = self._restart(k, y)
        if words:
            text = f"step {k}: {source} has abandoned its epoch; started again from {words}"
            return [self.event("WARN", "epoch-left", text, now, k, {"source": source, "step": k, "epoch": self.epoch})]
        text = f"step {k}: {source} has abandoned its epoch and there is nothing sound to start again from"
        return [self.event("ERROR", "epoch-lost", text, now, k, {"source": source, "step": k})]

    def _restart(self, k: int, y: Vector) -> str:
        """Hold, in a new epoch, the step's fused set or the domain, whichever meets the data; "" where neither does.

        The data themselves are not brought to it yet.
        """
        fused, domain = self._fused, self.engine.model.domain
        candidates: list[tuple[Support, Base, str]] = []
        if fused is not None and fused.step == k and fused.epoch == self.epoch_of(fused.src):
            candidates.append((to_support(fused.support), fused.reference, f"the fused set of step {k}"))
        if domain is not None:
            candidates.append((domain, "domain", "the domain"))
        before = self.engine.snapshot()
        for support, base, words in candidates:
            self.engine.reset(support)
            start = self.engine.snapshot()
            try:
                self.engine.update(y)
            except InconsistentData:
                self.engine.restore(before)
                continue
            self.engine.restore(start)
            self.begin_epoch(base)
            if fused is not None and base == fused.reference:
                self.rely(fused)
            return words
        return ""

    # -- messages out

    def posterior(self, k: int, step: Step, combined: Combined, support: SupportMessage, now: int) -> Posterior:
        return Posterior(
            **self.stamp("posterior", k, now, combined.origin),
            **described(self.engine),
            kind=self.settings.kind,
            support=support,
            status=combined.status,
            revision=step.revision,
            epoch=self.epoch,
            guarantee=self.guarantee,
            base=self._base,
            used=list(combined.used),
            bounds=self._bounds_in_force(),
            missing=list(combined.missing),
            cause=combined.cause,
            gain=None if combined.gain is None else finite_or_none(combined.gain),
        )

    def _bounds_in_force(self) -> Bounds:
        model = self.engine.model
        return Bounds(rho=model.rho.tolist(), r=(model.r * (self._widened or 1.0)).tolist())

    def prediction(self, k: int, now: int) -> list[Message]:
        return [
            Prediction(
                **self.stamp("prediction", k, now),
                **foretold(self.engine),
                support=to_message(self.engine.support),
                epoch=self.epoch,
                guarantee=self.guarantee,
            )
        ]


def described(engine: Filter) -> dict[str, Any]:
    """What a posterior says of the engine's set, beside the set itself."""
    lower, upper = engine.bounds()
    own = engine.support
    is_plain = isinstance(own, Orthotope | Parallelotope)
    log_volume = own.log_volume() if is_plain else Orthotope(lower, upper).log_volume()
    return {
        "lower": lower.tolist(),
        "upper": upper.tolist(),
        "point": engine.point.tolist(),
        "log_volume": finite_or_none(log_volume),
        "volume_of": "support" if is_plain else "hull",
    }


def foretold(engine: Filter) -> dict[str, Any]:
    """What a prediction says of the engine's set, beside the set itself."""
    lower, upper = engine.bounds()
    band = engine.predict_output()
    return {
        "lower": lower.tolist(),
        "upper": upper.tolist(),
        "y_lower": band.lower.tolist(),
        "y_upper": band.upper.tolist(),
        "y_point": band.point.tolist(),
    }
