"""One step of a fusion: the sets of its sources with its own prediction. The node and the verification both call it.

The same prediction, sources and policy give the same set, bit by bit.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.lsucz import LSUCZ
from lsu_mesh.filters.point_rule import PointRule
from lsu_mesh.fusion.point import point_of
from lsu_mesh.fusion.policies import Policy
from lsu_mesh.mesh.config.settings import Configuration, FusionSettings
from lsu_mesh.mesh.estimation.held_set import WEAKNESS
from lsu_mesh.mesh.messages import Guarantee, Posterior
from lsu_mesh.mesh.sets import to_support
from lsu_mesh.supports.support import Support

ABANDONED = "descends from an epoch that was abandoned"
OUTVOTED = "contradicts what the other sources and the own prediction agree on"
"""Reasons for which a source is rejected, besides its status."""
MAX_FAMILIES = 64
"""So many families of contradicting sources are tried, the largest first, to find out whom to leave out."""


@dataclass(frozen=True)
class Source:
    """One source's set of a step."""

    name: str
    message: Posterior
    support: Support

    @classmethod
    def of(cls, message: Posterior) -> Source:
        """The set that a message tells of."""
        return cls(message.name, message, to_support(message.support))

    @property
    def bounds(self) -> tuple[Vector, Vector]:
        """The bounds that the source published."""
        return np.array(self.message.lower), np.array(self.message.upper)


@dataclass(frozen=True)
class FusionOutcome:
    """What the engine holds after a step.

    ``basis`` is ``"both"`` (the prediction met with the ``used`` sources), ``"sources"`` (these alone, because the
    prediction has no point in common with them, or there is none), ``"family"`` (the prediction met with the largest
    family of sources that agree, because all together do not), ``"prediction"`` (too few sources), or
    ``"contradiction"`` (the prediction, because the sources contradict one another).
    """

    basis: Literal["both", "sources", "family", "prediction", "contradiction"]
    bounds: tuple[Vector, Vector]
    """Bounds of the set met with those of every used source, (n,) each."""
    used: Sequence[Source] = ()
    rejected: Sequence[Source] = ()
    """Sources that contradict the others."""


def fusion_engine(configuration: Configuration, settings: FusionSettings) -> Filter:
    """What holds the set of a fusion: a constrained zonotope of limited complexity, met with every source in turn."""
    engine = LSUCZ(
        configuration.base_model,
        configuration.prior,
        max_generators=settings.max_generators,
        max_constraints=settings.max_constraints,
        point="centre",
    )
    engine.skips_met = False
    return engine


def fused_point(support: Support, bounds: tuple[Vector, Vector], used: Sequence[Source], rule: PointRule) -> Vector:
    """The point (n,) of a fused set with these bounds, by the points and bounds of the sources that went into it.

    Without any source, where a step is only predicted, it is the point that is nearest to the centre of the hull.
    """
    told = [(np.array(one.message.point), *one.bounds) for one in sorted(used, key=lambda one: one.name)]
    return point_of(support, bounds, told, rule)


def fusion_algorithm(policy: Policy) -> int:
    """Number of the arithmetic of a fused set: it rises with that of the policy and with that of the engine."""
    return policy.algorithm + LSUCZ.algorithm - 1


def fusion_step(
    engine: Filter, sources: Sequence[Source], policy: Policy, faults: int, *, has_prediction: bool
) -> FusionOutcome:
    """Bring the sources of one step, by name, into the engine's set.

    ``has_prediction``: whether the engine's set may be believed; else it is left out. What is told afterwards (support
    and bounds) is all that the next step depends on.
    """
    meeting = _Meeting(engine)
    if len(sources) < policy.sources_needed(faults) or not sources:
        outcome = FusionOutcome("prediction", meeting.bounds)
    elif policy.is_intersection:
        outcome = _one_by_one(meeting, sources, has_prediction)
    else:
        outcome = _together(meeting, sources, policy, faults=faults, has_prediction=has_prediction)
    engine.resume(engine.support, *outcome.bounds)
    return outcome


def family_step(engine: Filter, sources: Sequence[Source]) -> FusionOutcome:
    """Meet the engine's set with the largest family of sources that has a point in common with it."""
    outcome = _largest_family(_Meeting(engine), sources)
    engine.resume(engine.support, *outcome.bounds)
    return outcome


class _Meeting:
    """The engine's set and its bounds, met with one source after another."""

    def __init__(self, engine: Filter) -> None:
        self._engine = engine
        self.bounds = engine.bounds()

    def snapshot(self) -> tuple[object, tuple[Vector, Vector]]:
        return self._engine.snapshot(), self.bounds

    def restore(self, snapshot: tuple[object, tuple[Vector, Vector]]) -> None:
        self._engine.restore(snapshot[0])
        self.bounds = snapshot[1]

    def hold(self, support: Support, bounds: tuple[Vector, Vector]) -> None:
        """Hold this alone; ``InconsistentData`` where it is empty."""
        self._engine.reset(support)
        self.bounds = bounds

    def meet_all(self, sources: Sequence[Source]) -> bool:
        return all(self.meet(source.support, source.bounds) for source in sources)

    def meet(self, support: Support, bounds: tuple[Vector, Vector]) -> bool:
        """Meet the set with another one; False, and unchanged, where the intersection is proved empty."""
        lower, upper = np.maximum(self.bounds[0], bounds[0]), np.minimum(self.bounds[1], bounds[1])
        if (lower > upper).any():
            return False
        before = self._engine.snapshot()
        try:
            self._engine.condition(support, gain=None)
        except InconsistentData:
            return False
        own_lower, own_upper = self._engine.bounds()
        lower, upper = np.maximum(lower, own_lower), np.minimum(upper, own_upper)
        if (lower > upper).any():
            self._engine.restore(before)
            return False
        self.bounds = (lower, upper)
        return True


def _one_by_one(meeting: _Meeting, sources: Sequence[Source], has_prediction: bool) -> FusionOutcome:
    """Every source with the prediction; without the prediction where only that is wrong."""
    before = meeting.snapshot()
    if has_prediction and meeting.meet_all(sources):
        return FusionOutcome("both", meeting.bounds, sources)
    meeting.restore(before)
    first, *others = sources
    try:
        meeting.hold(first.support, first.bounds)
        do_agree = meeting.meet_all(others)
    except InconsistentData:  # the source's own set is empty: it agrees with nobody
        do_agree = False
    if do_agree:
        return FusionOutcome("sources", meeting.bounds, sources)
    meeting.restore(before)
    if has_prediction:
        return _largest_family(meeting, sources)
    return FusionOutcome("contradiction", meeting.bounds)


def _largest_family(meeting: _Meeting, sources: Sequence[Source]) -> FusionOutcome:
    """As many sources as have a point in common with the set, the first by name of equal size."""
    family = _find_family(meeting, sources)
    rejected = [source for source in sources if source not in family]
    return FusionOutcome("family", meeting.bounds, family, rejected)


def _find_family(meeting: _Meeting, sources: Sequence[Source]) -> Sequence[Source]:
    before = meeting.snapshot()
    families = (f for size in range(len(sources) - 1, 0, -1) for f in itertools.combinations(sources, size))
    for family in itertools.islice(families, MAX_FAMILIES):
        if meeting.meet_all(family):
            return family
        meeting.restore(before)
    return [source for source in sources if meeting.meet(source.support, source.bounds)]


def _together(
    meeting: _Meeting, sources: Sequence[Source], policy: Policy, faults: int, has_prediction: bool
) -> FusionOutcome:
    """What the policy makes of all sources, with the prediction; without it where they have no point in common."""
    try:
        together = policy.function([source.support for source in sources], faults)
    except InconsistentData:
        return FusionOutcome("contradiction", meeting.bounds)
    rejected = [sources[i] for i in together.rejected]
    if has_prediction and meeting.meet(together.support, together.bounds):
        return FusionOutcome("both", meeting.bounds, sources, rejected)
    meeting.hold(together.support, together.bounds)
    return FusionOutcome("sources", meeting.bounds, sources, rejected)


def fused_guarantee(guarantees: Sequence[Guarantee], faults: int) -> Guarantee:
    """Of a set that holds the state although ``faults`` sources are wrong: the weakest sources count as wrong."""
    return sorted(guarantees, key=WEAKNESS.index, reverse=True)[min(faults, len(guarantees) - 1)]
