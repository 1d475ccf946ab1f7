"""Linear steps that enclose a nonlinear model over a box of states: what every filter can take."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lsu_mesh.array_types import Indices, Matrix, Vector
from lsu_mesh.errors import UnboundedSupport
from lsu_mesh.kernels.intervals.enclosure import NOT_ENCLOSED, Functions, Linear, enclose, offsets
from lsu_mesh.model import LSUModel
from lsu_mesh.model_arguments import read_only
from lsu_mesh.nonlinear.model import NonlinearModel


class Enclosed:
    """``f_i(z) ∈ M_i z_x + middle_i ± radius_i`` over a box, plus what the other coordinates add."""

    def __init__(self, functions: Functions, lower: Vector, upper: Vector, columns: Indices) -> None:
        rows, p = functions.values.size, functions.variables.size
        center = 0.5 * lower + 0.5 * upper
        self.linear = Linear(np.zeros((rows, p)), np.zeros(rows), np.zeros(rows), np.zeros(rows, dtype=np.int64))
        enclose(functions, lower, upper, center, self.linear)
        self.center = center
        self.middle, self.radius = np.zeros(rows), np.zeros(rows)
        offsets(self.linear, center, columns, self.middle, self.radius)

    @property
    def slopes(self) -> Matrix:
        """M (rows, variables)"""
        return self.linear.slopes

    @property
    def is_enclosed(self) -> list[bool]:
        """Of each row."""
        finite = np.isfinite(self.middle) & np.isfinite(self.radius) & np.isfinite(self.slopes).all(axis=1)
        return [bool(order != NOT_ENCLOSED and fine) for order, fine in zip(self.linear.order, finite, strict=True)]


def time_step(model: NonlinearModel, lower: Vector, upper: Vector, u_lower: Vector, u_upper: Vector) -> LSUModel:
    """``x⁺ = A x + a + N w`` that holds ``f(x, u, w)`` for every x in [lower, upper], u in its box, ``|w| ≤ rho``.

    The noises are those of the model, then the unknown part of each input, then the remainder of each row: boxes.
    The result has no inputs: what is known of u is in the offset. Source: Taylor's theorem, ``enclosure.py``.

    Raises
    ------
    UnboundedSupport
        Names the row of f that cannot be enclosed: the box leaves the domain of a function, or a bound overflows.
    """
    n, p = model.state_count, model.input_count
    rho, is_added = np.array(model.nominal.rho), not model.noises
    w = np.zeros(0) if is_added else rho
    low, high = np.concatenate([lower, u_lower, -w]), np.concatenate([upper, u_upper, w])
    found = Enclosed(model.dynamics, low, high, columns=np.arange(n))
    _refuse_open(model.f, "f", found.is_enclosed, model.states, lower=lower, upper=upper)
    unknown = [j for j in range(n, n + p) if u_lower[j - n] < u_upper[j - n]]
    used = [*range(n + p, n + p + w.size), *unknown]
    widths = [np.nextafter(max(high[j] - found.center[j], found.center[j] - low[j]), np.inf) for j in unknown]
    rest = found.radius if not is_added else np.nextafter(found.radius + rho, np.inf)
    return _trusted(
        model.nominal,
        A=np.ascontiguousarray(found.slopes[:, :n]),
        B=None,
        D=None,
        a=found.middle,
        noise_map=np.ascontiguousarray(np.hstack([found.slopes[:, used], np.eye(n)])),
        rho=np.concatenate([w, widths, rest]),
        inputs=(),
    )


def data_step(
    model: NonlinearModel, lower: Vector, upper: Vector, u_lower: Vector, u_upper: Vector, r: Vector
) -> tuple[LSUModel, list[bool]]:
    """``y = C x + d + v`` that holds ``g(x, u) + v``, ``|v| ≤ r`` (m,), for every x in [lower, upper]; which rows hold.

    A row that cannot be enclosed has C = 0 and must be left out. An unknown part of u widens r.
    """
    n = model.state_count
    low, high = np.concatenate([lower, u_lower]), np.concatenate([upper, u_upper])
    found = Enclosed(model.measured, low, high, columns=np.arange(n))
    holds = found.is_enclosed
    widths, slopes = np.array(r), found.slopes[:, :n].copy()
    unknown = np.where(
        u_lower < u_upper, np.nextafter(np.maximum(high - found.center, found.center - low)[n:], np.inf), 0
    )
    for i, is_enclosed in enumerate(holds):
        if is_enclosed:
            terms = [found.radius[i], *(abs(found.slopes[i, n + j]) * unknown[j] for j in range(unknown.size))]
            for term in terms:
                if term > 0.0:
                    widths[i] = np.nextafter(widths[i] + np.nextafter(term, np.inf), np.inf)
        else:
            slopes[i], found.middle[i] = 0.0, 0.0
    step = _trusted(model.nominal, C=np.ascontiguousarray(slopes), D=None, d=found.middle, r=widths)
    step.has_plain_outputs = False
    return step, holds


def _refuse_open(
    texts: Sequence[str], name: str, holds: Sequence[bool], states: Sequence[str], lower: Vector, upper: Vector
) -> None:
    for i, is_enclosed in enumerate(holds):
        if not is_enclosed:
            box = ", ".join(f"{s} in [{a:.6g}, {b:.6g}]" for s, a, b in zip(states, lower, upper, strict=True))
            raise UnboundedSupport(
                f"{name}[{i}] = {texts[i]!r} cannot be enclosed over {box}: the box leaves the domain of a function"
            )


def _trusted(nominal: LSUModel, **changes: object) -> LSUModel:
    """A copy of a model with arrays that need no check."""
    step = LSUModel.__new__(LSUModel)
    step.__dict__.update(nominal.__dict__)
    for name, value in changes.items():
        setattr(step, name, read_only(value) if isinstance(value, np.ndarray) else value)
    step.radii = step.flow = step.length_ns = None
    return step
