"""Bayesian transfer into a filter node: what others know about the state, intersected with the own prediction.

Three ways (Kuklišová Pavelková, Jirsa, Quinn 2022, and the design of this mesh):

``predictor``
    The supports of the other filters' state predictors of the same step. Conditioning on their intersection minimises
    the Kullback–Leibler divergence; the minimum ``ln vol X − ln vol (X ∩ X_1 ∩ …)`` is the gain in nats.
``fused``
    The newest fused box of an earlier step, carried forward by the model.
``data-predictor``
    The strip ``ŷ_hi − r ≤ C x ≤ ŷ_lo + r`` from a source's predictor of the same output, with the target's r.
    Formally optimal, but it can cut off the truth: sets that used it carry ``guarantee = "none"``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import assert_never

import numpy as np

from lsu_mesh.errors import InconsistentData
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.lsuo import LSUO
from lsu_mesh.mesh.config.settings import Configuration, FilterSettings
from lsu_mesh.mesh.estimation.epochs import Epochs
from lsu_mesh.mesh.estimation.time_update import predict_step
from lsu_mesh.mesh.messages import Fused, Input, Message, Prediction
from lsu_mesh.mesh.sets import to_support
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support

SOUND = ("ok", "predicted")
MAX_BOX_AGE = 16
"""A fused box that is older than so many steps is not carried forward any more."""
MAX_STEPS = 4096
"""Steps whose messages are kept while the filter waits for something else."""


class Transfer:
    """Keeps what came from others and turns it into sets of a step."""

    def __init__(self, configuration: Configuration, settings: FilterSettings) -> None:
        self._configuration = configuration
        self.way = settings.transfer
        self._predictions: dict[int, dict[str, Prediction]] = {}
        self._fused: dict[int, dict[str, Fused]] = {}

    @property
    def takes_predictions(self) -> bool:
        """Whether the predictions of other filters are transferred."""
        match self.way:
            case "predictor" | "data-predictor":
                return True
            case "fused" | "off":
                return False
            case _:
                assert_never(self.way)

    def record(self, message: Message) -> None:
        """Remember a prediction or a fused set."""
        if isinstance(message, Prediction) and self.takes_predictions:
            self._predictions.setdefault(message.step, {})[message.name] = message
        elif isinstance(message, Fused) and self.way == "fused":
            boxes = self._fused.setdefault(message.step, {})
            known = boxes.get(message.name)
            if known is None or known.boot != message.boot or known.seq < message.seq:
                boxes[message.name] = message
        for kept in (self._predictions, self._fused):
            while len(kept) > MAX_STEPS:
                del kept[next(iter(kept))]

    def forget_before(self, k: int) -> None:
        """Drop what belongs to steps before k."""
        for kept in (self._predictions, self._fused):
            for old in [step for step in kept if step < k]:
                del kept[old]

    def available(
        self, k: int, inputs: Mapping[int, Input], epochs: Epochs, *, needs_inputs: bool
    ) -> Sequence[Prediction | Fused]:
        """What can be brought to the prediction of step k, sources by name; nothing of an abandoned epoch."""
        if self.takes_predictions:
            predictions = sorted(self._predictions.get(k, {}).items())
            return [message for _, message in predictions if not epochs.is_abandoned(message)]
        for j in range(k - 1, max(0, k - 1 - MAX_BOX_AGE), -1):
            if needs_inputs and j not in inputs:
                return []
            boxes = [message for _, message in sorted(self._fused.get(j, {}).items()) if message.status in SOUND]
            if sound := [message for message in boxes if not epochs.is_abandoned(message)]:
                return sound
        return []

    def as_set(self, message: Prediction | Fused, k: int, engine: Filter, inputs: Mapping[int, Input]) -> Support:
        """The set of step k that a message stands for; ``InconsistentData`` for an empty strip."""
        if isinstance(message, Fused):
            return carried(message, k, engine.model, configuration=self._configuration, inputs=inputs)
        return self._strip(message, engine) if self.way == "data-predictor" else to_support(message.support)

    def _strip(self, message: Prediction, engine: Filter) -> Support:
        """Strips of the outputs that source and target both have (equal rows of C), with the target's r."""
        target = engine.model
        source = self._configuration.model(self._configuration.filters[message.name].sensors)
        middle, radius = np.full(target.output_count, np.nan), np.zeros(target.output_count)
        for i in range(target.output_count):
            for j in range(source.output_count):
                low, high = message.y_upper[j] - target.r[i], message.y_lower[j] + target.r[i]
                if np.array_equal(target.C[i], source.C[j]) and low <= high:
                    middle[i], radius[i] = 0.5 * (low + high), 0.5 * (high - low)
        if np.isnan(middle).all():
            raise InconsistentData(f"the output predictor of {message.name} is wider than 2 r, or of other outputs")
        return engine.support.to_constrained_zonotope().meet_strips(target.C, middle, radius)


def carried(
    message: Fused, k: int, model: LSUModel, configuration: Configuration, inputs: Mapping[int, Input]
) -> Orthotope:
    """The fused box of a step, carried to step k by the model; ``InconsistentData`` where it leaves the domain."""
    box, earlier = LSUO(model, Orthotope(message.lower, message.upper)), None
    for j in range(message.step, k):
        u, since = (np.array(inputs[j].u), inputs[j].time_ns) if model.input_count else (None, None)
        predict_step(box, configuration, j, u=u, earlier=earlier, since=since)
        earlier = u
    return Orthotope(*box.bounds())
