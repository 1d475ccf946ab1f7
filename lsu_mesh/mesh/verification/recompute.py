"""The sets of one filter or fusion again, each from its base and from what it used."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.lsucz import LSUCZ
from lsu_mesh.fusion.fuse import fuse
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.estimation.adoption import adopted_model, is_due, make_engine
from lsu_mesh.mesh.estimation.inconsistency import update_without_contradicting_strips, widen
from lsu_mesh.mesh.estimation.message_fields import described, described_box, finite_or_none, foretold
from lsu_mesh.mesh.estimation.open_loop import OpenLoop
from lsu_mesh.mesh.estimation.transfer import Transfer
from lsu_mesh.mesh.messages import Bounds, Measurement, Posterior, Prediction, Reference, Suggestion
from lsu_mesh.mesh.sets import to_message, to_support
from lsu_mesh.mesh.verification.archive import Archive, DoesNotFit, Unverifiable
from lsu_mesh.mesh.verification.provenance_steps import Brought, provenance_steps
from lsu_mesh.supports.orthotope import Orthotope

Fields = Mapping[str, Any]
"""Fields of a message and their values."""
MAX_KEPT = 8192
"""So many states are remembered of a filter whose messages do not tell all that it holds."""


class Recomputation(ABC):
    """Recomputes the sets of one peer. ``configuration`` is that of the run."""

    def __init__(self, configuration: Configuration, archive: Archive, engine: Filter) -> None:
        self._configuration = configuration
        self._archive = archive
        self._engine = engine
        self._kept: OrderedDict[Reference, object] = OrderedDict()

    def posterior(self, recorded: Posterior) -> Fields:
        """The fields that a posterior has by its provenance.

        Raises :class:`Unverifiable` where something of it is not in the recording, :class:`DoesNotFit` where it
        contradicts itself.
        """
        first = self._hold_base(recorded)
        steps = provenance_steps(recorded, first, self._archive)
        fields: Fields = {}
        try:
            for k, brought in steps.items():
                fields = self._combine(k, brought, recorded)
                if k < recorded.step:
                    self._advance(k, brought)
        except InconsistentData as error:
            raise DoesNotFit("used", "sets that have a point in common", str(error)) from None
        if not self._engine.is_resumable:
            self._keep(recorded.reference)
        return {**fields, "support": to_message(self._engine.support)}

    def prediction(self, recorded: Prediction) -> Fields:
        """The fields that a prediction has by the posterior and the input of the step before."""
        base = self._archive.posterior_before(recorded)
        self._hold(base)
        self._engine.predict(self._input(base.step))
        return {**foretold(self._engine), "support": to_message(self._engine.support)}

    @abstractmethod
    def _combine(self, k: int, brought: Brought, recorded: Posterior) -> Fields:
        """Bring the step's data to the engine's set; the fields of a message about it."""

    # -- where a set begins

    def _hold_base(self, recorded: Posterior) -> int:
        """Hold the set that a posterior was made from; returns its step."""
        base = recorded.base
        if base == "prior":
            self._engine.reset(self._configuration.prior)
            return 1
        if base == "domain":
            domain = self._engine.model.domain
            if domain is None:
                raise DoesNotFit("base", "the domain", "something that the model has")
            self._engine.reset(domain)
            return recorded.step
        if base == "reach":
            self._engine.reset(self._reach(recorded.step))
            return recorded.step
        if base == "sources":
            return recorded.step
        message = self._archive.find(base, Posterior)
        if (message.src, message.boot) == (recorded.src, recorded.boot):
            self._hold(message)
        else:
            self._engine.reset(to_support(message.support))
        return message.step

    def _reach(self, k: int) -> Orthotope:
        """The prior carried to step k."""
        if self._engine.model.input_count and self._configuration.input_box is not None:
            raise Unverifiable(f"which inputs before step {k} were known in time is not told")
        reach = OpenLoop(self._engine.model)
        reach.begin(self._configuration.prior)
        for j in range(1, k):
            reach.predict(self._input(j))
        if reach.box is None:
            raise DoesNotFit("base", "the prior carried forward", "something that is bounded")
        return reach.box

    def _hold(self, own: Posterior) -> None:
        """Hold what the same process held when it published a posterior."""
        if self._engine.is_resumable:
            self._engine.resume(to_support(own.support), np.array(own.lower), np.array(own.upper))
        elif own.reference in self._kept:
            self._engine.restore(self._kept[own.reference])
        else:
            text = f"{self._engine.kind} holds more than it publishes, and the sets before step {own.step}"
            raise Unverifiable(f"{text} are not all in the recording")

    def _keep(self, reference: Reference) -> None:
        self._kept[reference] = self._engine.snapshot()
        if len(self._kept) > MAX_KEPT:
            self._kept.popitem(last=False)

    # -- time update

    def _advance(self, k: int, brought: Brought) -> None:
        if not self._engine.model.input_count:
            self._engine.predict()
        elif brought.input is not None:
            self._engine.predict(np.array(brought.input.u))
        elif self._configuration.input_box is not None:
            self._engine.predict(self._configuration.input_box)
        else:
            raise DoesNotFit("used", f"no input of step {k}", "one, because the model has inputs and no input_box")

    def _input(self, k: int) -> Any:
        if not self._engine.model.input_count:
            return None
        u = self._archive.input_vector(k)
        if u is not None:
            return u
        if self._configuration.input_box is None:
            raise Unverifiable(f"the input of step {k} is not in the recording")
        return self._configuration.input_box

    def _noise_bounds(self, factor: float = 1.0) -> Bounds:
        rho, r = self._engine.half_widths
        return Bounds(rho=rho.tolist(), r=(r * factor).tolist())


class FilterRecomputation(Recomputation):
    """The posteriors and predictions of one filter."""

    def __init__(self, configuration: Configuration, archive: Archive, name: str) -> None:
        self._settings = settings = configuration.filters[name]
        engine = make_engine(settings, configuration.model(settings.sensors), configuration.prior)
        super().__init__(configuration, archive, engine)
        self._transfer = Transfer(configuration, settings)
        self._declared = engine
        self._adopted: dict[str, dict[int, Filter]] = {}
        """By process, the epoch at which bounds were adopted and the filter that goes by them."""

    def posterior(self, recorded: Posterior) -> Fields:
        for reference in recorded.used:
            if reference[0] == Suggestion.topic:
                self._adopt(recorded, self._archive.find(reference, Suggestion))
        self._engine = self._in_force(recorded)
        return super().posterior(recorded)

    def prediction(self, recorded: Prediction) -> Fields:
        self._engine = self._in_force(recorded)
        return super().prediction(recorded)

    def _adopt(self, recorded: Posterior, message: Suggestion) -> None:
        if not is_due(message, recorded.step):
            raise DoesNotFit("used", f"bounds for step {message.adopt_at}", f"ones for step {recorded.step} or before")
        model = adopted_model(self._configuration, self._settings, message)
        engines = self._adopted.setdefault(recorded.boot, {})
        if recorded.epoch not in engines:
            engines[recorded.epoch] = make_engine(self._settings, model, self._configuration.prior)

    def _in_force(self, recorded: Posterior | Prediction) -> Filter:
        """The filter with the bounds that the process went by at this epoch."""
        engines = self._adopted.get(recorded.boot, {})
        epochs = [epoch for epoch in engines if epoch <= recorded.epoch]
        if epochs:
            return engines[max(epochs)]
        if self._settings.adopt and recorded.guarantee == "learned" and self._settings.on_inconsistency != "widen":
            raise Unverifiable("the message whose bounds were adopted is not in the recording")
        return self._declared

    def _combine(self, k: int, brought: Brought, recorded: Posterior) -> Fields:
        gain = self._bring_transfers(k, brought)
        status, factor = self._update(self._stack(brought.measurements))
        if status != "inconsistent" and recorded.status in ("restarted", "inconsistent"):
            status = recorded.status  # where a process began, and whose epoch ended, is no matter of this set's data
        return {
            **described(self._engine),
            "kind": self._settings.kind,
            "gain": gain,
            "status": status,
            "bounds": self._noise_bounds(factor),
        }

    def _bring_transfers(self, k: int, brought: Brought) -> float | None:
        gains = [self._engine.condition(self._as_set(message, k)) for message in brought.transfers]
        return finite_or_none(sum(gains)) if gains else None

    def _as_set(self, message: Any, k: int) -> Any:
        try:
            return self._transfer.as_set(message, k, self._engine, self._archive.inputs)
        except KeyError as error:
            raise Unverifiable(f"the input of step {error} is not in the recording") from None

    def _stack(self, measurements: Sequence[Measurement]) -> Vector:
        """Measured outputs by sensor name, then row, NaN where missing."""
        given = {message.name: message for message in measurements}
        y: list[float] = []
        for sensor in self._settings.sensors:
            message, size = given.pop(sensor, None), len(self._configuration.sensors[sensor].C)
            values = [None] * size if message is None else message.y
            y += [np.nan if value is None else value for value in values]
        if given:
            raise DoesNotFit("used", f"sensors {', '.join(given)}", f"those of {self._settings.name}")
        return np.array(y, dtype=np.float64)

    def _update(self, y: Vector) -> tuple[str, float]:
        """Data update by the rules of the filter; the status, and by how much r was widened."""
        if np.isnan(y).all():
            return "predicted", 1.0
        try:
            self._engine.update(y)
        except InconsistentData:
            if self._settings.on_inconsistency == "widen":
                factor = widen(self._engine, y)
                if factor is not None:
                    return "ok", factor
            update_without_contradicting_strips(self._engine, y)
            return "inconsistent", 1.0
        return "ok", 1.0


class FusionRecomputation(Recomputation):
    """The fused sets of one fusion."""

    def __init__(self, configuration: Configuration, archive: Archive, name: str) -> None:
        self._settings = settings = configuration.fusion[name]
        engine = LSUCZ(
            configuration.base_model,
            configuration.prior,
            max_generators=settings.max_generators,
            max_constraints=settings.max_constraints,
        )
        super().__init__(configuration, archive, engine)
        self._met: tuple[Vector, Vector] = engine.bounds()

    def _combine(self, k: int, brought: Brought, recorded: Posterior) -> Fields:
        alone = recorded.base == "sources" and k == recorded.step
        if not alone:
            self._met = self._engine.bounds()
        if self._settings.policy == "relaxed":
            self._relaxed(brought.sources, alone)
        else:
            self._intersected(brought.sources, alone)
        self._engine.resume(self._engine.support, *self._met)
        return {**described_box(*self._met), "kind": "fusion", "bounds": self._noise_bounds()}

    def _intersected(self, sources: Sequence[Posterior], alone: bool) -> None:
        if alone:
            first, *sources = sources
            self._engine.reset(to_support(first.support))
            self._met = np.array(first.lower), np.array(first.upper)
        for source in sources:
            bounds = np.array(source.lower), np.array(source.upper)
            self._engine.condition(to_support(source.support))
            self._meet(bounds)
            self._meet(self._engine.bounds())

    def _relaxed(self, sources: Sequence[Posterior], alone: bool) -> None:
        if not sources:
            return
        together = fuse([to_support(source.support) for source in sources], "relaxed", self._settings.faults)
        if alone:
            self._engine.reset(together.support)
            self._met = together.bounds
            return
        self._engine.condition(together.support)
        self._meet(together.bounds)
        self._meet(self._engine.bounds())

    def _meet(self, bounds: tuple[Vector, Vector]) -> None:
        self._met = np.maximum(self._met[0], bounds[0]), np.minimum(self._met[1], bounds[1])
