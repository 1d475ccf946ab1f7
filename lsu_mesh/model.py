"""The linear state-space model with uniform noise (LSU model), in steps and in continuous time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Array
from lsu_mesh.errors import ModelError
from lsu_mesh.model_arguments import (
    domain_argument,
    feedthrough_argument,
    half_widths_argument,
    matrix_argument,
    names_argument,
    offset_argument,
    period_argument,
    read_only,
)

if TYPE_CHECKING:
    from lsu_mesh.supports.orthotope import Orthotope


MAX_CACHED_STRETCHES = 4096


class Radii(NamedTuple):
    """What is not known of a step: the true matrices are within A (n, n), B (n, p), a (n,) of the model's."""

    A: Array
    B: Array
    a: Array


class LSUModel:
    """``x⁺ = A x + B u + a + N w``, ``|w| ≤ rho``;  ``y = C x + D u + d + v``, ``|v| ≤ r`` (entry by entry).

    Parameters
    ----------
    A:
        (n, n) state matrix.
    B:
        (n, p) input matrix, or ``None`` for a model without inputs.
    C:
        (m, n) output matrix; m = 0 is legal.
    rho:
        (q,) half-widths of the process noise, ≥ 0; a scalar stands for all entries.
    r:
        (m,) half-widths of the output noise, ≥ 0; a scalar stands for all entries.
    noise_map:
        N, (n, q); ``None`` is the identity, q = n.
    domain:
        A box that holds the state at *every* step (physical limits), as ``Orthotope`` or pair ``(lower, upper)``.
    D, a, d:
        (m, p) feedthrough, (n,) and (m,) offsets; ``None`` is 0. The u of an output is the one that acts from its
        moment on.
    period:
        (m,) period of each output such as 360 for an angle in degrees, 0 or ``None`` where it has none: y is then
        known up to a multiple of it. A period that is no whole number is known to a unit in its last place, so that
        ``2 * math.pi`` means 2π.
    states, inputs, outputs, units:
        Optional names of the n states, p inputs, m outputs, and units of the states.
    radii:
        What is not known of A, B and a; each time update is widened by ``radii.A |x| + radii.B |u| + radii.a``.

    Raises
    ------
    ModelError
        Names every argument that is wrong, its value and what was expected.

    Arrays are copied, read-only and float64. Source: Pavelková & Jirsa 2018, eq. (4); the noise map after Chisci et al.
    1996.
    """

    noise_share: Array | None = None
    """Of a discretised model: the share (n,) of the box in the hull of the noise of the stretch."""

    def __init__(
        self,
        A: ArrayLike,
        B: ArrayLike | None,
        C: ArrayLike,
        rho: ArrayLike,
        r: ArrayLike,
        noise_map: ArrayLike | None = None,
        domain: Orthotope | tuple[ArrayLike, ArrayLike] | None = None,
        *,
        D: ArrayLike | None = None,
        a: ArrayLike | None = None,
        d: ArrayLike | None = None,
        period: ArrayLike | Sequence[float | None] | None = None,
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
        units: Sequence[str] | None = None,
        radii: Radii | None = None,
    ) -> None:
        problems: list[str] = []
        self.A = matrix_argument("A", A, problems)
        n = self.A.shape[0]
        if self.A.shape != (n, n) or n == 0:
            problems.append(f"A must be square and not empty, it has shape {self.A.shape}")
        self.B = None if B is None else matrix_argument("B", B, problems)
        if self.B is not None and self.B.shape[0] != n:
            problems.append(f"B must have {n} rows, one per state, it has shape {self.B.shape}")
        self.C = matrix_argument("C", C, problems, columns=n)
        if self.C.shape[1] != n:
            problems.append(f"C must have {n} columns, one per state, it has shape {self.C.shape}")
        self.noise_map = None if noise_map is None else matrix_argument("noise_map", noise_map, problems)
        if self.noise_map is not None and self.noise_map.shape[0] != n:
            problems.append(f"noise_map must have {n} rows, one per state, it has shape {self.noise_map.shape}")
        m, p = self.C.shape[0], 0 if self.B is None else self.B.shape[1]
        q = n if self.noise_map is None else self.noise_map.shape[1]
        self.rho = half_widths_argument("rho", rho, q, of="process noise", problems=problems)
        self.r = half_widths_argument("r", r, m, of="output", problems=problems)
        self.domain = domain_argument(domain, n, problems)
        self.D = feedthrough_argument(D, m, p, problems)
        self.a = offset_argument("a", a, n, of="state", problems=problems)
        self.d = offset_argument("d", d, m, of="output", problems=problems)
        self.period = period_argument(period, m, problems)
        self.radii = None if radii is None else _radii(radii, n, p, problems)
        self.states = names_argument("states", states, n, default="x", problems=problems)
        self.inputs = names_argument("inputs", inputs, p, default="u", problems=problems)
        self.outputs = names_argument("outputs", outputs, m, default="y", problems=problems)
        self.units = names_argument("units", units, n, default="", problems=problems)
        self.has_plain_outputs = self.D is None and self.d is None and self.period is None
        """Whether ``y = C x + v``: no feedthrough, offset or period."""
        self.flow: ContinuousModel | None = None
        """Of a discretised model: the continuous one."""
        self.length_ns: int | None = None
        """Of a discretised model: the length of its stretch in nanoseconds."""
        if problems:
            raise ModelError(*problems)

    @classmethod
    def continuous(
        cls,
        A: ArrayLike,
        B: ArrayLike | None,
        C: ArrayLike,
        rho: ArrayLike,
        r: ArrayLike,
        noise_map: ArrayLike | None = None,
        domain: Orthotope | tuple[ArrayLike, ArrayLike] | None = None,
        **options: Any,
    ) -> ContinuousModel:
        """``ẋ = A x + B u + a + N w(t)``, ``|w(t)| ≤ rho`` at every moment, in seconds; arguments as of the class.

        rho is a *rate*: state units per second through N. See :class:`ContinuousModel`.
        """
        return ContinuousModel(cls(A, B, C, rho=rho, r=r, noise_map=noise_map, domain=domain, **options))

    @property
    def state_count(self) -> int:
        """n"""
        return int(self.A.shape[0])

    @property
    def input_count(self) -> int:
        """p, 0 without B"""
        return 0 if self.B is None else int(self.B.shape[1])

    @property
    def output_count(self) -> int:
        """m"""
        return int(self.C.shape[0])

    def replace(self, **changes: object) -> LSUModel:
        """A copy with some arguments changed; names are kept where they still fit.

        A change of C drops D, d and period, one of B drops D, unless they are given too. A change of the dynamics
        drops the radii, and of a discretised model that it is one.
        """
        dynamics, outputs = ("A", "B", "a"), ("D", "d", "period")
        arguments: dict[str, object] = {
            "A": self.A, "B": self.B, "C": self.C, "rho": self.rho, "r": self.r,
            "noise_map": self.noise_map, "domain": self.domain, "states": self.states, "units": self.units,
            "D": self.D, "a": self.a, "d": self.d, "period": self.period, "radii": self.radii,
        }  # fmt: skip
        unknown = set(changes) - {*arguments, "inputs", "outputs"}
        if unknown:
            raise ModelError(f"LSUModel has no argument {', '.join(sorted(unknown))}")
        if "B" not in changes:
            arguments["inputs"] = self.inputs
        if "C" not in changes:
            arguments["outputs"] = self.outputs
        else:
            arguments |= dict.fromkeys(outputs)
        if "B" in changes:
            arguments["D"] = None
        if any(name in changes for name in dynamics):
            arguments["radii"] = None
        model = LSUModel(**{**arguments, **changes})  # type: ignore[arg-type]
        if not {*dynamics, "rho", "noise_map", "radii"} & set(changes):
            model.flow, model.noise_share, model.length_ns = self._flow_of(changes), self.noise_share, self.length_ns
        return model

    def _flow_of(self, changes: dict[str, object]) -> ContinuousModel | None:
        """The continuous model behind this one, with the same changes of outputs and names."""
        return None if self.flow is None else self.flow.replace(**changes)

    def __repr__(self) -> str:
        return f"LSUModel(states={self.state_count}, inputs={self.input_count}, outputs={self.output_count})"


class ContinuousModel:
    """``ẋ = A x + B u + a + N w(t)``, ``y(t) = C x(t) + D u(t) + d + v``; any measurable ``|w(t)| ≤ rho``.

    Made by :meth:`LSUModel.continuous`. Time is in seconds, so A is in 1/s and rho, through N, in state units per
    second: never a per-step rho, nor one divided by the step. ``domain`` holds the state at every moment.
    """

    def __init__(self, rates: LSUModel) -> None:
        if rates.radii is not None:
            raise ModelError("a continuous model has no radii")
        self.rates = rates
        """The arguments, as an LSU model whose A, B, a and N say rates."""
        active = rates.rho > 0.0
        N = np.eye(rates.state_count) if rates.noise_map is None else rates.noise_map
        self._N, self._rho = np.ascontiguousarray(N[:, active]), np.array(rates.rho[active])
        columns = [] if rates.B is None else [rates.B]
        columns += [] if rates.a is None else [rates.a.reshape(-1, 1)]
        self._inputs = np.ascontiguousarray(np.hstack([np.zeros((rates.state_count, 0)), *columns]))
        self._stretches: dict[int, LSUModel] = {}

    @property
    def state_count(self) -> int:
        """n"""
        return self.rates.state_count

    @property
    def input_count(self) -> int:
        """p"""
        return self.rates.input_count

    @property
    def output_count(self) -> int:
        """m"""
        return self.rates.output_count

    @property
    def arrays(self) -> tuple[Array, Array, Array, Array]:
        """A (n, n), ``[B  a]``, N (n, q) and rho (q,) of the noises that are not 0, as kernels take them."""
        return np.array(self.rates.A), self._inputs, self._N, self._rho

    def replace(self, **changes: object) -> ContinuousModel:
        """A copy with some arguments changed, see :meth:`LSUModel.replace`."""
        return ContinuousModel(self.rates.replace(**changes))

    def discretised(self, h_ns: int) -> LSUModel:
        """The model of a stretch of ``h_ns`` nanoseconds (a whole number above 0), for ``predict(model=…)``.

        ``A_h = e^{Ah}``, ``B_h = ∫₀ʰ e^{As} ds B``, a_h likewise, rounded to doubles with proved ``radii``; its noise
        holds ``∫₀ʰ e^{As} N w ds`` for every measurable w: generators in ``noise_map`` (the last n are a box), whose
        share of the hull is ``noise_share``. The same object is given again for the same h.

        Raises
        ------
        ModelError
            h is no whole number above 0, or so long that ``e^{Ah}`` overflows.
        """
        step = self._stretches.get(h_ns)
        if step is None:
            step = self._discretise(h_ns)
            if len(self._stretches) >= MAX_CACHED_STRETCHES:
                self._stretches.clear()
            self._stretches[step_key(h_ns)] = step
        return step

    def _discretise(self, h_ns: int) -> LSUModel:
        from lsu_mesh.kernels.discretisation.stretch import discretise

        rates, n, p = self.rates, self.state_count, self.input_count
        h_ns = step_key(h_ns)
        finite, A, A_radius, B, B_radius, G, rho, share = discretise(*self.arrays, float(h_ns))
        if not finite:
            raise ModelError(
                f"a stretch of {h_ns} ns is too long for this model: its exponential overflows; take shorter steps"
            )
        step = LSUModel.__new__(LSUModel)
        step.__dict__.update(rates.__dict__)
        step.A, step.noise_map, step.rho, step.noise_share = map(read_only, (A, G, rho, share))
        if rates.B is not None:
            step.B = read_only(np.ascontiguousarray(B[:, :p]))
        a_radius = np.zeros(n)
        if rates.a is not None:
            step.a, a_radius = read_only(np.array(B[:, p])), np.array(B_radius[:, p])
        step.radii = Radii(read_only(A_radius), read_only(np.ascontiguousarray(B_radius[:, :p])), read_only(a_radius))
        step.flow, step.length_ns = self, h_ns
        return step

    def __repr__(self) -> str:
        return repr(self.rates).replace("LSUModel", "ContinuousModel", 1)


def step_key(h_ns: int) -> int:
    """A length in nanoseconds as an ``int``; raises ``ModelError`` where it is no whole number above 0."""
    if isinstance(h_ns, bool) or not isinstance(h_ns, int | np.integer) or not 0 < h_ns < 2**53:
        raise ModelError(f"the length of a stretch must be a whole number of nanoseconds, 1 … 2⁵³, it is {h_ns!r}")
    return int(h_ns)


def _radii(given: Radii, n: int, p: int, problems: list[str]) -> Radii:
    shapes = {"A": (n, n), "B": (n, p), "a": (n,)}
    arrays = [np.array(part, dtype=np.float64) for part in given]
    for (name, shape), array in zip(shapes.items(), arrays, strict=True):
        if array.shape != shape or not (array >= 0).all():
            problems.append(f"radii.{name} must be of shape {shape} and not negative, it is {array.tolist()}")
    return Radii(*map(read_only, arrays))
