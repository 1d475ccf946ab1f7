"""The fields of a message that are computed from the engine, besides the set itself."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.filters.density import Density
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.point_rule import PointRule
from lsu_mesh.mesh.messages import Posterior
from lsu_mesh.mesh.sets import to_message
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.parallelotope import Parallelotope


def described(engine: Filter) -> dict[str, Any]:
    """The fields of a posterior that the engine's set gives."""
    lower, upper = engine.bounds()
    own = engine.support
    is_plain = isinstance(own, Orthotope | Parallelotope)
    log_volume = own.log_volume() if is_plain else Orthotope(lower, upper).log_volume()
    return {
        "lower": lower.tolist(),
        "upper": upper.tolist(),
        "point": engine.point.tolist(),
        "point_rule": engine.point_rule,
        **told_density(engine.density),
        "log_volume": finite_or_none(log_volume),
        "volume_of": "support" if is_plain else "hull",
    }


def can_foretell(engine: Filter, input_box: Orthotope | None) -> bool:
    """Whether outputs can be bounded before the input that they see has come."""
    return engine.model.D is None or input_box is not None


def foretold(engine: Filter, input_box: Orthotope | None) -> dict[str, Any]:
    """What a prediction says of the engine's set and its outputs, which may see any input of the box."""
    lower, upper = engine.bounds()
    band = engine.predict_output() if engine.model.D is None else engine.predict_output(input_box)
    return {
        "lower": lower.tolist(),
        "upper": upper.tolist(),
        "y_lower": band.lower.tolist(),
        "y_upper": band.upper.tolist(),
        "y_point": band.point.tolist(),
        "point_rule": engine.point_rule,
    }


def told_density(density: Density | None) -> dict[str, Any]:
    """The fields of the density beside a set."""
    if density is None:
        return {"mean": None, "covariance": None}
    return {"mean": density.mean.tolist(), "covariance": density.covariance.tolist()}


def density_of(message: Posterior) -> Density | None:
    """The density that a message tells of."""
    if message.mean is None or message.covariance is None:
        return None
    return Density(np.array(message.mean), np.array(message.covariance).reshape(len(message.mean), -1))


def smoothed(engine: Filter, posterior: Posterior) -> dict[str, Any]:
    """The fields of the smoothed set beside a posterior; none where its data were not believed.

    None either where the engine, which has published it, holds no state of ``lag`` steps back.
    """
    lag = engine.lag
    if posterior.status == "inconsistent" or not lag or engine.held_steps < lag:
        return {}
    lower, upper = engine.smoothed_bounds(lag)
    return {
        "lag": lag,
        "support": to_message(engine.smoothed(lag)),
        "lower": lower.tolist(),
        "upper": upper.tolist(),
        "base": posterior.reference,
        "revision": posterior.revision,
        "epoch": posterior.epoch,
        "guarantee": posterior.guarantee,
        "algorithm": posterior.algorithm if posterior.algorithm is not None else 1,
    }


def described_fusion(lower: Vector, upper: Vector, point: Vector, rule: PointRule) -> dict[str, Any]:
    """The fields of a fused set that its bounds (n,), (n,) and its point (n,) by a rule give."""
    return {
        "lower": lower.tolist(),
        "upper": upper.tolist(),
        "point": point.tolist(),
        "point_rule": rule,
        "log_volume": finite_or_none(Orthotope(lower, upper).log_volume()),
        "volume_of": "hull",
    }


def finite_or_none(value: float) -> float | None:
    """A logarithm of volumes for a message: None where a set is flat, or became flat."""
    return value if math.isfinite(value) else None
