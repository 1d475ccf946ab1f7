"""A filter as a node: measurements and inputs in, predictions and posteriors out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lsu_mesh.errors import InconsistentData
from lsu_mesh.filters.registry import filter_class
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.messages import Fused, Input, Measurement, Message, Posterior, Prediction, SupportMessage
from lsu_mesh.mesh.nodes.estimator import Base, Combined, Estimator, Status, Step, finite_or_none
from lsu_mesh.mesh.nodes.node import SECOND
from lsu_mesh.mesh.sets import to_message, to_support
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.parallelotope import Parallelotope
from lsu_mesh.supports.support import Support, Vector


class FilterNode(Estimator):
    """Runs one filter of the library on the measurements of its sensors."""

    role = "filter"
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

    @property
    def deadline(self) -> int:
        return int(self.settings.deadline * SECOND)

    @property
    def history(self) -> int:
        return self.settings.history

    def subscriptions(self) -> Sequence[tuple[str, str]]:
        listed = [("measurement", sensor) for sensor in self.configuration.filters[self.name].sensors]
        if self.configuration.plant is not None and self.configuration.base_model.input_count:
            listed.append(("input", self.configuration.plant.name))
        fusions = self.configuration.fusion.values()
        listed += [("fused", fusion.name) for fusion in fusions if self.name in fusion.sources]
        return listed

    def receive(self, message: Message, now: int) -> list[Message]:
        if isinstance(message, Measurement):
            return self._receive_measurement(message, now)
        if isinstance(message, Input):
            return self.take_input(message, now)
        if isinstance(message, Posterior):
            if isinstance(message, Fused) and message.status in ("ok", "predicted"):
                self._fused = message
            if self.current is None:
                self.take_candidate(message)
        return []

    def _receive_measurement(self, message: Measurement, now: int) -> list[Message]:
        first = self.arrived(message.step, message.name)
        if first is None:
            self.take(message.name, message, now)
        elif isinstance(first, Measurement) and first.y != message.y:
            text = f"{message.name} sent step {message.step} again with another value; the first counts"
            about: dict[str, str | int | float | None] = {"sensor": message.name, "step": message.step}
            return [self.event("WARN", "measurement-changed", text, now, message.step, about)]
        return []

    # -- data update

    def combine(self, k: int, step: Step, now: int) -> tuple[Combined, list[Message]]:
        y, used, origin = self._stack(step)
        missing = [name for name in self.sources if name not in step.arrived]
        if np.isnan(y).all():
            return Combined("predicted", used, missing, origin), []
        status: Status = "ok"
        cause, messages = None, []
        try:
            self.engine.update(y)
            self._inconsistent.clear()
        except InconsistentData as error:
            status, cause = "inconsistent", str(error)
            messages = self._contradiction(k, y, error, now)
        return Combined(status, used, missing, origin, cause), messages

    def _stack(self, step: Step) -> tuple[Vector, list[tuple[str, str, str, int]], int | None]:
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

    def _contradiction(self, k: int, y: Vector, error: InconsistentData, now: int) -> list[Message]:
        """Drop the strips that alone contradict the prediction, or all of the step; reset when it goes on."""
        self._counts["contradictions"] += 1
        self._inconsistent.add(k)
        band = self.engine.predict_output()
        alone = (y < band.lower) | (y > band.upper)
        some_alone = bool(alone.any())
        dropped = alone if some_alone else ~np.isnan(y)
        messages: list[Message] = [
            self._dropped_event(k, row, y, band, some_alone, now) for row in np.flatnonzero(dropped).tolist()
        ]
        kept = np.where(dropped, np.nan, y)
        if not np.isnan(kept).all():
            try:
                self.engine.update(kept)
            except InconsistentData:
                rest = np.flatnonzero(~np.isnan(kept)).tolist()
                messages += [self._dropped_event(k, row, y, band, False, now) for row in rest]
        if len(self._inconsistent) >= self.settings.reset_after:
            messages += self._reset(k, y, now)
        return messages

    def _dropped_event(self, k: int, row: int, y: Vector, band: tuple[Vector, ...], alone: bool, now: int) -> Message:
        sensor = next(name for name, rows in self._rows.items() if rows.start <= row < rows.stop)
        output = self.engine.model.outputs[row]
        lower, upper = float(band[0][row]), float(band[1][row])
        gap = max(lower - y[row], y[row] - upper)
        if alone:
            why = f"lies {gap:.4g} outside [{lower:.6g}, {upper:.6g}], all that the declared bounds allow"
        else:
            why = "contradicts the prediction together with the step's other measurements"
        text = f"step {k}: {output} = {y[row]:.6g} of sensor {sensor} {why}; left out"
        about: dict[str, str | int | float | None] = {
            "sensor": sensor, "output": output, "step": k, "y": float(y[row]), "lower": lower, "upper": upper,
            "gap": float(gap) if alone else None,
        }  # fmt: skip
        return self.event("WARN", "contradiction", text, now, k, about)

    def _reset(self, k: int, y: Vector, now: int) -> list[Message]:
        """Start again, in a new epoch, from the newest fused set or the domain, whichever meets the data."""
        fused, domain = self._fused, self.engine.model.domain
        self._inconsistent.clear()
        candidates: list[tuple[Support, Base, str]] = []
        if fused is not None and fused.step == k:
            candidates.append((to_support(fused.support), fused.reference, f"the fused set of step {k}"))
        if domain is not None:
            candidates.append((domain, "domain", "the domain"))
        for support, base, words in candidates:
            before = self.engine.snapshot()
            self.engine.reset(support)
            try:
                self.engine.update(y)
            except InconsistentData:
                self.engine.restore(before)
                continue
            self.begin_epoch(base)
            text = (
                f"step {k}: {self.settings.reset_after} steps in a row contradicted the set; started again from {words}"
            )
            return [self.event("ERROR", "reset", text, now, k, {"step": k, "epoch": self.epoch})]
        text = (
            f"step {k}: {self.settings.reset_after} steps in a row contradicted the set and there is nothing sound to "
            "start again from; give the model a domain, or check the declared bounds"
        )
        return [self.event("ERROR", "reset-impossible", text, now, k, {"step": k})]

    # -- messages out

    def posterior(self, k: int, step: Step, combined: Combined, support: SupportMessage, now: int) -> Posterior:
        lower, upper = self.engine.bounds()
        own = self.engine.support
        plain = isinstance(own, Orthotope | Parallelotope)
        log_volume = own.log_volume() if plain else Orthotope(lower, upper).log_volume()
        return Posterior(
            **self.stamp("posterior", k, now, combined.origin),
            kind=self.settings.kind,
            support=support,
            lower=lower.tolist(),
            upper=upper.tolist(),
            point=self.engine.point.tolist(),
            log_volume=finite_or_none(log_volume),
            volume_of="support" if plain else "hull",
            status=combined.status,
            revision=step.revision,
            epoch=self.epoch,
            guarantee="declared",
            base=self._base,
            used=list(combined.used),
            bounds=self.noise_bounds(),
            missing=list(combined.missing),
            cause=combined.cause,
        )

    def prediction(self, k: int, now: int) -> list[Message]:
        lower, upper = self.engine.bounds()
        band = self.engine.predict_output()
        return [
            Prediction(
                **self.stamp("prediction", k, now),
                support=to_message(self.engine.support),
                lower=lower.tolist(),
                upper=upper.tolist(),
                y_lower=band.lower.tolist(),
                y_upper=band.upper.tolist(),
                y_point=band.point.tolist(),
                epoch=self.epoch,
            )
        ]
