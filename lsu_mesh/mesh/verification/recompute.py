"""The sets of one filter or fusion again, each from its base and from what it used."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.held_inputs import Input as Drive
from lsu_mesh.fusion.policies import POLICIES
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.estimation.adoption import adopted_model, filter_algorithm, is_due, make_engine
from lsu_mesh.mesh.estimation.filter_step import Transfers, contradiction_rule, filter_step
from lsu_mesh.mesh.estimation.fusion_step import (
    OUTVOTED,
    FusionEngine,
    Source,
    fused_point,
    fusion_algorithm,
    fusion_step,
)
from lsu_mesh.mesh.estimation.message_fields import (
    density_of,
    described,
    described_fusion,
    finite_or_none,
    foretold,
    smoothed,
)
from lsu_mesh.mesh.estimation.open_loop import MAX_LISTED, OpenLoop
from lsu_mesh.mesh.estimation.step_data import DataOfSteps
from lsu_mesh.mesh.estimation.time_update import Origin, predict_step
from lsu_mesh.mesh.estimation.transfer import Transfer
from lsu_mesh.mesh.messages import Base, Bounds, Fused, Input, Posterior, Prediction, Reference, Smoothed, Suggestion
from lsu_mesh.mesh.sets import to_message, to_support
from lsu_mesh.mesh.verification.archive import Archive, DoesNotFit, Unverifiable
from lsu_mesh.mesh.verification.provenance_steps import Brought, provenance_steps
from lsu_mesh.mesh.verification.recomputed import Recomputed, told_by
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support

MAX_KEPT = 8192
"""So many states are remembered of a filter whose messages do not tell all that it holds."""


class Recomputation(ABC):
    """Recomputes the sets of one peer. ``configuration`` is that of the run."""

    def __init__(self, configuration: Configuration, archive: Archive, engine: Filter) -> None:
        self._configuration = configuration
        self._archive = archive
        self._engine = engine
        self._kept: OrderedDict[Reference, object] = OrderedDict()
        self._origin: Origin | None = None
        """The set of the step before, where the data between the steps are reached from it."""

    @property
    @abstractmethod
    def algorithm(self) -> tuple[str, int]:
        """What computes the sets, and the number of its arithmetic."""

    def posterior(self, recorded: Posterior) -> Recomputed:
        """What a posterior has by its provenance.

        Raises :class:`Unverifiable` where something of it is not in the recording, :class:`DoesNotFit` where it
        contradicts itself.
        """
        first = self._hold_base(recorded, recorded.base)
        acts_late = self._configuration.input_delay_ns > 0
        steps = provenance_steps(recorded, first, self._archive, acts_late=acts_late)
        found, is_widened = Recomputed({}), False
        try:
            for k, brought in steps.items():
                found = self._combine(k, brought, recorded)
                is_widened |= found.is_widened
                if k < recorded.step:
                    self._advance(k, brought)
        except InconsistentData as error:
            raise DoesNotFit("used", "sets that have a point in common", str(error)) from None
        if not self._engine.is_resumable:
            self._keep(recorded.reference)
        fields = {**found.fields, "support": to_message(self._engine.support)}
        return replace(found, fields=told_by(recorded, fields), is_widened=is_widened)

    def prediction(self, recorded: Prediction) -> Recomputed:
        """What a prediction has by its base and the input of the step before."""
        if recorded.base is None:  # of an older peer, which does not say what it was made from
            before = self._archive.posterior_before(recorded)
            self._hold(before)
            predict_step(self._engine, self._configuration, before.step, self._input(before.step))
        elif (k := self._hold_base(recorded, recorded.base)) < recorded.step:
            predict_step(self._engine, self._configuration, k, *self._own_inputs(recorded))
        bounds = {} if recorded.bounds is None else {"bounds": self._noise_bounds()}
        told = foretold(self._engine, self._configuration.input_box)
        fields = {**told, **bounds, "support": to_message(self._engine.support)}
        return Recomputed(told_by(recorded, fields))

    def smoothed(self, recorded: Smoothed) -> Recomputed:
        """What a smoothed set has by its posterior: the filter that held the one held the other too."""
        base = self._archive.find(recorded.base, Posterior)
        if (base.src, base.boot) != (recorded.src, recorded.boot):
            raise DoesNotFit("base", f"{base.topic} {base.seq} of {base.src}", "a posterior of the same process")
        if base.status == "inconsistent":
            raise DoesNotFit("base", f"a set of status {base.status}", "one whose data were believed")
        self._hold(base)
        fields = smoothed(self._engine, base)
        if not fields:
            held = f"the lag is {self._engine.lag}, {self._engine.held_steps} steps are there"
            raise DoesNotFit("lag", recorded.lag, f"no smoothed set: {held}")
        return Recomputed({**fields, "step": base.step - self._engine.lag})

    def other_algorithm(self, recorded: Posterior | Prediction | Smoothed) -> str | None:
        """The number of the arithmetic that computed a set, in words, where it is not today's: its bits may differ."""
        what, number = self.algorithm
        found = recorded.algorithm if recorded.algorithm is not None else 1
        return None if found == number else f"{what} algorithm {found}, this is {number}"

    def _own_inputs(self, recorded: Prediction) -> tuple[Drive, Drive, int | None]:
        """The input, or the input box, that drove a prediction on; the input before, if it was used; since when."""
        if not self._engine.model.input_count:
            return None, None, None
        used = [self._archive.find(reference, Input) for reference in recorded.used]
        inputs = [message for message in used if message.step != recorded.step - 2]
        earlier = next((np.array(message.u) for message in used if message not in inputs), None)
        if [message.step for message in inputs] == [recorded.step - 1] and not recorded.missing:
            return np.array(inputs[0].u), earlier, inputs[0].time_ns
        box = self._configuration.input_box
        if inputs or recorded.missing != ["input"]:
            words = f"the input of step {recorded.step - 1}"
            raise DoesNotFit(
                "used", f"{len(inputs)} inputs, missing {recorded.missing}", f"{words}, or that it is missing"
            )
        if box is None:
            raise DoesNotFit("missing", recorded.missing, "nothing, because the configuration has no input_box")
        return box, earlier, None

    @abstractmethod
    def _combine(self, k: int, brought: Brought, recorded: Posterior) -> Recomputed:
        """Bring the step's data to the engine's set; what a message about it has, but for the set itself."""

    # -- where a set begins

    def _hold_base(self, recorded: Posterior | Prediction, base: Base) -> int:
        """Hold the set that a message was made from; returns its step."""
        self._origin = None
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
            self._engine.reset(self._reach(recorded))
            return recorded.step
        if base == "sources":
            return recorded.step
        message = self._archive.find(base, Posterior)
        if (message.src, message.boot) == (recorded.src, recorded.boot):
            self._hold(message)
        else:
            self._engine.reset(to_support(message.support))
            if message.src == recorded.src:
                self._take_density(message)
        return message.step

    def _take_density(self, message: Posterior) -> None:
        density = density_of(message)
        if density is not None:
            self._engine.take_density(density)

    def _reach(self, recorded: Posterior | Prediction) -> Orthotope:
        """The prior carried to a step; the set lists the inputs of it where a box may have stood in for one."""
        k, known = recorded.step, self._archive.inputs
        if self._engine.model.input_count and self._configuration.input_box is not None:
            if recorded.algorithm is None or k - 1 > MAX_LISTED:  # of an older peer, or longer than a list may be
                raise Unverifiable(f"which inputs before step {k} were known in time is not told")
            found = [self._archive.find(reference, Input) for reference in recorded.used if reference[0] == Input.topic]
            known = {message.step: message for message in found if message.step < k}
        reach = OpenLoop(self._configuration, self._engine.model)
        reach.begin(self._configuration.prior)
        for j in range(1, k):
            u = self._driven(j, known.get(j))
            reach.predict(u, j, self._earlier(known.get(j - 1)), since=_since(known.get(j)))
        if reach.box is None:
            raise DoesNotFit("base", "the prior carried forward", "something that is bounded")
        return reach.box

    def _hold(self, own: Posterior) -> None:
        """Hold what the same process held when it published a posterior."""
        if self._engine.is_resumable:
            self._engine.resume(to_support(own.support), np.array(own.lower), np.array(own.upper))
            self._take_density(own)
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
        if self._engine.model.input_count and brought.input is None and self._configuration.input_box is None:
            raise DoesNotFit("used", f"no input of step {k}", "one, because the model has inputs and no input_box")
        u, earlier, since = self._driven(k, brought.input), self._earlier(brought.earlier), _since(brought.input)
        if self._configuration.continuous is not None:
            self._origin = Origin(self._engine.snapshot(), u, earlier, since)
        predict_step(self._engine, self._configuration, k, u=u, earlier=earlier, since=since)

    def _earlier(self, message: Input | None) -> Drive:
        """The input before, where inputs may act late."""
        return np.array(message.u) if message is not None and self._configuration.input_delay_ns else None

    def _input(self, k: int) -> Vector | Orthotope | None:
        return self._driven(k, self._archive.inputs.get(k))

    def _driven(self, k: int, message: Input | None) -> Vector | Orthotope | None:
        """What drives step k on: the input, or the box of all inputs where it is not known."""
        if not self._engine.model.input_count:
            return None
        if message is not None:
            return np.array(message.u)
        if self._configuration.input_box is None:
            raise Unverifiable(f"the input of step {k} is not in the recording")
        return self._configuration.input_box

    def _noise_bounds(self, factor: float = 1.0) -> Bounds:
        rho, r = self._engine.half_widths
        return Bounds(rho=rho.tolist(), r=(r * factor).tolist())


def _since(message: Input | None) -> int | None:
    """When an input began to act, where its message says so."""
    return None if message is None else message.time_ns


class FilterRecomputation(Recomputation):
    """The posteriors and predictions of one filter."""

    def __init__(self, configuration: Configuration, archive: Archive, name: str) -> None:
        self._settings = settings = configuration.filters[name]
        engine = make_engine(settings, configuration.model(settings.sensors), configuration.prior)
        super().__init__(configuration, archive, engine)
        self._transfer = Transfer(configuration, settings)
        self._data_of_steps = DataOfSteps(configuration, settings.sensors, settings.kind)
        self._declared = engine
        self._adopted: dict[str, dict[int, Filter]] = {}
        """By process, the epoch at which bounds were adopted and the filter that goes by them."""

    def posterior(self, recorded: Posterior) -> Recomputed:
        for reference in recorded.used:
            if reference[0] == Suggestion.topic:
                self._adopt(recorded, self._archive.find(reference, Suggestion))
        self._engine = self._in_force(recorded)
        return super().posterior(recorded)

    def prediction(self, recorded: Prediction) -> Recomputed:
        self._engine = self._in_force(recorded)
        return super().prediction(recorded)

    def smoothed(self, recorded: Smoothed) -> Recomputed:
        self._engine = self._in_force(recorded)
        return super().smoothed(recorded)

    def _adopt(self, recorded: Posterior, message: Suggestion) -> None:
        if not is_due(message, recorded.step):
            raise DoesNotFit("used", f"bounds for step {message.adopt_at}", f"ones for step {recorded.step} or before")
        model = adopted_model(self._configuration, self._settings, message)
        engines = self._adopted.setdefault(recorded.boot, {})
        if recorded.epoch not in engines:
            engines[recorded.epoch] = make_engine(self._settings, model, self._configuration.prior)

    def _in_force(self, recorded: Posterior | Prediction | Smoothed) -> Filter:
        """The filter with the bounds that the process went by at this epoch."""
        engines = self._adopted.get(recorded.boot, {})
        epochs = [epoch for epoch in engines if epoch <= recorded.epoch]
        if epochs:
            return engines[max(epochs)]
        if self._settings.adopt and recorded.guarantee == "learned" and self._settings.on_inconsistency != "widen":
            raise Unverifiable("the message whose bounds were adopted is not in the recording")
        return self._declared

    @property
    def algorithm(self) -> tuple[str, int]:
        return self._settings.kind, filter_algorithm(self._settings, self._engine)

    def _combine(self, k: int, brought: Brought, recorded: Posterior) -> Recomputed:
        foreign = sorted({message.name for message in brought.measurements} - set(self._settings.sensors))
        if foreign:
            raise DoesNotFit("used", f"sensors {', '.join(foreign)}", f"those of {self._settings.name}")
        r = self._engine.model.r
        data = self._data_of_steps.gather(k, brought.measurements, r, origin=self._origin, known=brought.known)
        rule = contradiction_rule(self._settings.on_inconsistency)
        gain = None if recorded.gain_of is None else self._settings.transfer_gain
        transfers = Transfers(brought.transfers, lambda message: self._as_set(message, k), gain)
        outcome = filter_step(self._engine, data, transfers, rule)
        if outcome.rejected:
            one = outcome.rejected[0]
            raise DoesNotFit("used", f"the {one.message.topic} of {one.message.src}", f"it left out: {one.reason}")
        fields = {
            **described(self._engine),
            "kind": self._settings.kind,
            "gain": None if outcome.gain is None else finite_or_none(outcome.gain),
            "gain_of": outcome.gain_of,
            "bounds": self._noise_bounds(outcome.factor),
        }
        return Recomputed(fields, outcome.status, outcome.factor > 1.0)

    def _as_set(self, message: Any, k: int) -> Support:
        try:
            return self._transfer.as_set(message, k, self._engine, self._archive.inputs)
        except KeyError as error:
            raise Unverifiable(f"the input of step {error} is not in the recording") from None


class FusionRecomputation(Recomputation):
    """The fused sets of one fusion."""

    _engine: FusionEngine

    def __init__(self, configuration: Configuration, archive: Archive, name: str) -> None:
        self._settings = configuration.fusion[name]
        self._policy = POLICIES[self._settings.policy]
        super().__init__(configuration, archive, FusionEngine(configuration, self._settings))

    @property
    def algorithm(self) -> tuple[str, int]:
        return self._policy.name, fusion_algorithm(self._policy)

    def _combine(self, k: int, brought: Brought, recorded: Posterior) -> Recomputed:
        sources = [Source.of(message) for message in brought.sources]
        alone = recorded.base == "sources" and k == recorded.step
        outvoted: frozenset[str] | None = frozenset()
        if k == recorded.step and self._policy.is_intersection and isinstance(recorded, Fused):
            outvoted = self._outvoted(sources, recorded)
        outcome = fusion_step(self._engine, sources, self._policy, self._settings.faults, has_prediction=not alone)
        expected = "prediction" if not sources else "sources" if alone else "both"
        if outcome.basis != expected:
            raise DoesNotFit("used", f"sources of step {k} held by {expected}", f"by {outcome.basis}")
        if not self._policy.is_intersection:
            outvoted = frozenset(source.name for source in outcome.rejected)
        rule, bounds = self._settings.point, self._engine.bounds()
        point = fused_point(self._engine.support, bounds, outcome.used, rule)
        fields = {**described_fusion(*bounds, point, rule), "kind": "fusion", "bounds": self._noise_bounds()}
        return Recomputed(fields, "ok" if sources else "predicted", outvoted=outvoted)

    def _outvoted(self, used: Sequence[Source], recorded: Fused) -> frozenset[str] | None:
        """Which of the sources that are said to contradict the used ones do; ``None`` where their sets are not known.

        The newest set of each at that time is taken; which revision it was is not told.
        """
        said = {one.source for one in recorded.rejected if one.reason == OUTVOTED}
        candidates = [self._archive.newest(name, recorded.step, recorded.sent_ns) for name in sorted(said)]
        if not said:
            return frozenset()
        if any(candidate is None for candidate in candidates):
            return None
        others = [Source.of(message) for message in candidates if message is not None]
        before = self._engine.snapshot()
        together = sorted([*used, *others], key=lambda source: source.name)
        outcome = fusion_step(self._engine, together, self._policy, self._settings.faults, has_prediction=True)
        self._engine.restore(before)
        return frozenset(source.name for source in outcome.rejected)
