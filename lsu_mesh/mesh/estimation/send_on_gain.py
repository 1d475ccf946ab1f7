"""Which predictions a filter publishes: those that tell others enough beyond what they hold of it already.

The sender keeps a *shadow*: the last prediction that it published, carried forward by the model. Whoever took that
prediction holds a set inside of the shadow, as far as its class can. A new prediction is worth a message where it would
gain more than ``publish_when`` nats on the shadow. Leaving a message out is sound: it costs width, as a lost one does.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from lsu_mesh.errors import InconsistentData, UnboundedSupport
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.held_inputs import Input as Drive
from lsu_mesh.filters.transfer_gain import MAX_EXACT_VOLUME, hull_gain, log_volume
from lsu_mesh.mesh.config.settings import Configuration, FilterSettings
from lsu_mesh.mesh.estimation.adoption import make_engine
from lsu_mesh.mesh.estimation.held_set import HeldSet
from lsu_mesh.mesh.estimation.time_update import predict_step
from lsu_mesh.mesh.messages import Guarantee, Input, Mark
from lsu_mesh.supports.intersection import Intersection


class Worth(NamedTuple):
    """What a receiver may believe of a set, besides the set."""

    epoch: int
    descent: tuple[Mark, ...]
    guarantee: Guarantee

    def leaves_epoch_of(self, earlier: Worth) -> bool:
        """Whether an epoch of the earlier set is no epoch of this one: somebody has started again."""
        return self.epoch != earlier.epoch or not set(earlier.descent) <= set(self.descent)


class Sent(NamedTuple):
    """A prediction that was published."""

    step: int
    worth: Worth


class SendOnGain:
    """Decides for one filter, prediction after prediction."""

    def __init__(self, configuration: Configuration, settings: FilterSettings) -> None:
        self._configuration = configuration
        self._settings = settings
        self._last: Sent | None = None
        """The last prediction that was published."""
        self._shadow: Filter | None = None
        """Holds the set of ``_last`` carried to step ``_at``; ``None`` where that cannot be told."""
        self._at = 0
        self._epoch_began: int | None = None
        """The step at which an epoch that was told before was first left."""
        self._newest = 0
        """The newest step that was decided on."""

    def publishes(self, k: int, held: HeldSet, inputs: Mapping[int, Input]) -> bool:
        """Whether the prediction of step k, which is held, is worth a message; if so it counts as published."""
        if not self._settings.publish_when:
            return True
        worth = Worth(held.epochs.number, tuple(held.descent), held.guarantee)
        is_due = self._is_due(k, worth, held.engine, inputs)
        self._newest = k if is_due else max(k, self._newest)
        if is_due:
            self._record(k, worth, held.engine)
        return is_due

    def _is_due(self, k: int, worth: Worth, engine: Filter, inputs: Mapping[int, Input]) -> bool:
        """By gain, and without asking for it: the first; each after ``history`` steps without any, because a receiver's
        loss is not seen; where what the set is worth has changed, and then ``history`` steps on, so that no loss hides
        a new epoch. Never one of a step that is done again while later ones were decided on: nobody waits for it.
        """
        last, history = self._last, self._settings.history
        if last is None or k < self._newest - history:
            return True
        if k < self._newest:
            return False
        if k - last.step >= history or worth != last.worth:
            return True
        if self._epoch_began is not None and k - self._epoch_began < history:
            return True
        return self._gain(k, engine, inputs) > self._settings.publish_when

    def _record(self, k: int, worth: Worth, engine: Filter) -> None:
        if self._last is not None and worth.leaves_epoch_of(self._last.worth):
            self._epoch_began = k
        shadow = make_engine(self._settings, engine.model, self._configuration.prior)
        if shadow.is_resumable:
            shadow.resume(engine.support, *engine.bounds())
        else:
            shadow.reset(engine.support)
        self._last, self._shadow, self._at = Sent(k, worth), shadow, k

    def _gain(self, k: int, engine: Filter, inputs: Mapping[int, Input]) -> float:
        """What whoever holds the shadow would gain by the engine's set, in nats; endless where that cannot be told."""
        self._carry(k, inputs)
        shadow = self._shadow
        if shadow is None:
            return math.inf
        before, own = shadow.bounds(), engine.bounds()
        met = np.maximum(before[0], own[0]), np.minimum(before[1], own[1])
        if (met[0] > met[1]).any():
            return math.inf
        if self._settings.transfer_gain == "support" and engine.model.state_count <= MAX_EXACT_VOLUME:
            volume = log_volume(shadow.support, before)
            left = log_volume(Intersection([shadow.support, engine.support]), met)
            if min(volume, left) > -math.inf:
                return volume - left
        return hull_gain(before, met)

    def _carry(self, k: int, inputs: Mapping[int, Input]) -> None:
        """Bring the shadow to step k."""
        while self._shadow is not None and self._at < k:
            j, self._at = self._at, self._at + 1
            u: Drive = None
            if self._shadow.model.input_count:
                u = np.array(inputs[j].u) if j in inputs else self._configuration.input_box
                if u is None:
                    self._shadow = None
                    return
            has_earlier = self._configuration.input_delay_ns and j - 1 in inputs
            earlier = np.array(inputs[j - 1].u) if has_earlier else None
            try:
                predict_step(self._shadow, self._configuration, j, u=u, earlier=earlier)
            except (InconsistentData, UnboundedSupport):
                self._shadow = None
