"""One step of a fusion: the sets of its sources with its own prediction. The node and the verification both call it.

The same prediction, sources and policy give the same set, bit by bit.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData
from lsu_mesh.filters.lsucz import LSUCZ
from lsu_mesh.filters.point_rule import PointRule
from lsu_mesh.fusion.point import point_of
from lsu_mesh.fusion.policies import Policy
from lsu_mesh.fusion.stack import Families, Stack, Told
from lsu_mesh.mesh.config.settings import Configuration, FusionSettings
from lsu_mesh.mesh.estimation.held_set import WEAKNESS
from lsu_mesh.mesh.messages import Guarantee, Posterior
from lsu_mesh.mesh.sets import to_support
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from lsu_mesh.supports.reduction import Limits, Settled
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

    @property
    def told(self) -> Told:
        """The set and the bounds."""
        return self.support, self.bounds


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


class FusionEngine(LSUCZ):
    """What holds the set of a fusion: a constrained zonotope of limited complexity."""

    def __init__(self, configuration: Configuration, settings: FusionSettings) -> None:
        super().__init__(
            configuration.base_model,
            configuration.prior,
            max_generators=settings.max_generators,
            max_constraints=settings.max_constraints,
            point="centre",
        )

    @property
    def limits(self) -> Limits:
        """Generators and constraints of the fused set."""
        return self._limits

    def stack(self) -> Stack:
        """A stack that begins with the set, and the box beside it."""
        held = self.snapshot()
        return Stack.of(held.body, held.lower, held.upper, self.limits)

    def hold(self, settled: Settled) -> tuple[Vector, Vector]:
        """Hold this set, and the box beside it; the box."""
        self.resume(ConstrainedZonotope.of_arrays(*settled.body), settled.lower, settled.upper)
        return settled.lower, settled.upper


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
    engine: FusionEngine, sources: Sequence[Source], policy: Policy, faults: int, *, has_prediction: bool
) -> FusionOutcome:
    """Bring the sources of one step, by name, into the engine's set: one intersection, one reduction.

    ``has_prediction``: whether the engine's set may be believed; else it is left out. What is told afterwards (support
    and bounds) is all that the next step depends on.
    """
    if len(sources) < policy.sources_needed(faults) or not sources:
        return _as_it_is(engine, "prediction")
    if policy.is_intersection:
        return _intersected(engine, sources, has_prediction)
    return _together(engine, sources, policy, faults=faults, has_prediction=has_prediction)


def family_step(engine: FusionEngine, sources: Sequence[Source]) -> FusionOutcome:
    """Meet the engine's set with the largest family of sources that has a point in common with it."""
    return _largest_family(
        engine, Families(engine.stack(), [source.told for source in sources], engine.limits), sources
    )


def rehearse(engine: FusionEngine) -> None:
    """Intersect sets of all kinds, so that nothing is loaded when the first ones come; the engine is left as it was."""
    hull, stack = engine.support.interval_hull(), engine.stack()
    for support in (hull, hull.to_parallelotope(), hull.to_constrained_zonotope()):
        stack = stack.met(support, hull.bounds())
    with suppress(InconsistentData):  # the set may be flat
        stack.settled()


def _as_it_is(engine: FusionEngine, basis: Literal["prediction", "contradiction"]) -> FusionOutcome:
    """Nothing is met."""
    bounds = engine.bounds()
    engine.resume(engine.support, *bounds)
    return FusionOutcome(basis, bounds)


def _intersected(engine: FusionEngine, sources: Sequence[Source], has_prediction: bool) -> FusionOutcome:
    """Every source with the prediction; without the prediction where only that is wrong."""
    told, everyone = [source.told for source in sources], tuple(range(len(sources)))
    with_prediction = Families(engine.stack(), told, engine.limits)
    met = with_prediction.settled(everyone) if has_prediction else None
    if met is not None:
        return FusionOutcome("both", engine.hold(met), sources)
    alone = Families(None, told, engine.limits).settled(everyone)
    if alone is not None:
        return FusionOutcome("sources", engine.hold(alone), sources)
    return _largest_family(engine, with_prediction, sources) if has_prediction else _as_it_is(engine, "contradiction")


def _largest_family(engine: FusionEngine, families: Families, sources: Sequence[Source]) -> FusionOutcome:
    """As many sources as have a point in common with the set, the first by name of equal size."""
    family, met = _find_family(families, len(sources))
    bounds = _as_it_is(engine, "prediction").bounds if met is None else engine.hold(met)
    used = [sources[i] for i in family]
    return FusionOutcome("family", bounds, used, [source for source in sources if source not in used])


def _find_family(families: Families, count: int) -> tuple[tuple[int, ...], Settled | None]:
    """The indices of the family and its set; none and ``None`` where no source has a point in common with the set."""
    by_size = (f for size in range(count - 1, 0, -1) for f in itertools.combinations(range(count), size))
    for family in itertools.islice(by_size, MAX_FAMILIES):
        met = families.settled(family)
        if met is not None:
            return family, met
    greedy: tuple[int, ...] = ()
    found: Settled | None = None
    for i in range(count):
        met = families.settled((*greedy, i))
        if met is not None:
            greedy, found = (*greedy, i), met
    return greedy, found


def _together(
    engine: FusionEngine, sources: Sequence[Source], policy: Policy, faults: int, has_prediction: bool
) -> FusionOutcome:
    """What the policy makes of all sources, with the prediction; without it where they have no point in common."""
    try:
        together = policy.function([source.support for source in sources], faults)
    except InconsistentData:
        return _as_it_is(engine, "contradiction")
    rejected = [sources[i] for i in together.rejected]
    told = [(together.support, together.bounds)]
    met = Families(engine.stack(), told, engine.limits).settled((0,)) if has_prediction else None
    if met is not None:
        return FusionOutcome("both", engine.hold(met), sources, rejected)
    alone = Families(None, told, engine.limits).settled((0,))
    if alone is None:
        return _as_it_is(engine, "contradiction")
    return FusionOutcome("sources", engine.hold(alone), sources, rejected)


def fused_guarantee(guarantees: Sequence[Guarantee], faults: int) -> Guarantee:
    """Of a set that holds the state although ``faults`` sources are wrong: the weakest sources count as wrong."""
    return sorted(guarantees, key=WEAKNESS.index, reverse=True)[min(faults, len(guarantees) - 1)]
