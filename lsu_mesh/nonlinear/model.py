"""Nonlinear models: ``x⁺ = f(x, u, w)`` or ``ẋ = f(x, u, w)``, ``y = g(x, u) + v``."""

from __future__ import annotations

import keyword
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.errors import ModelError
from lsu_mesh.model import LSUModel
from lsu_mesh.nonlinear.functions import affine, compiled
from lsu_mesh.nonlinear.graph import Graph
from lsu_mesh.nonlinear.language import FUNCTIONS, parse
from lsu_mesh.nonlinear.periodic import free_of_branches

if TYPE_CHECKING:
    from lsu_mesh.supports.orthotope import Orthotope


class NonlinearModel:
    """``x⁺ = f(x, u, w)``, or ``ẋ = f(x, u, w)`` with ``continuous``; ``y = g(x, u) + v``; ``|w| ≤ rho``, ``|v| ≤ r``.

    Parameters
    ----------
    f:
        n expressions of states, inputs, noises and parameters, such as ``"x + h*v*cos(th)"``; see ``language.py``.
    g:
        m expressions of states, inputs and parameters.
    states:
        Names of the n states.
    rho:
        Half-widths (q,) of the noises, or of the noise that is added to each state where ``noises`` is empty. Of a
        continuous model a rate: state units per second.
    r:
        Half-widths (m,) of the output noise.
    inputs, noises:
        Names of the p inputs and of the q noises that f uses.
    parameters:
        Known numbers by name; a decimal means the nearest double.
    domain:
        A box that holds the state at every step (of a continuous model: at every moment).
    period:
        As of :class:`lsu_mesh.LSUModel`: outputs that are angles, known up to a multiple of it.
    continuous:
        Whether f is the rate of x; w may then be any measurable function within its bounds, u is held.
    outputs, units:
        Optional names of the outputs and units of the states.

    Raises
    ------
    ModelError
        Names every argument that is wrong; an expression with row, column and the nearest name.

    A row that is affine in everything with coefficients that are doubles is taken as it is. A model all of whose rows
    are is an :class:`LSUModel` (:attr:`linear`), and its sets are bit by bit the same.
    """

    def __init__(
        self,
        f: Sequence[str],
        g: Sequence[str],
        states: Sequence[str],
        rho: ArrayLike,
        r: ArrayLike,
        *,
        inputs: Sequence[str] = (),
        noises: Sequence[str] = (),
        parameters: Mapping[str, float] | None = None,
        domain: Orthotope | tuple[ArrayLike, ArrayLike] | None = None,
        period: ArrayLike | Sequence[float | None] | None = None,
        continuous: bool = False,
        outputs: Sequence[str] | None = None,
        units: Sequence[str] | None = None,
    ) -> None:
        self.f, self.g = _texts("f", f), _texts("g", g)
        self.states, self.inputs, self.noises = tuple(states), tuple(inputs), tuple(noises)
        self.parameters = {name: float(value) for name, value in (parameters or {}).items()}
        self.is_continuous = continuous
        self._check_names()
        n, p, m = len(self.states), len(self.inputs), len(self.g)
        if len(self.f) != n:
            raise ModelError(f"f has {len(self.f)} expressions, there are {n} states: give one each")
        graph = self.graph = Graph([*self.states, *self.inputs, *self.noises])
        variables = [graph.variable(i) for i in range(len(graph.names))]
        known = dict(zip(graph.names, variables, strict=True))
        known |= {name: graph.constant(value) for name, value in self.parameters.items()}
        outside = {name: node for name, node in known.items() if name not in self.noises}
        rows_f = [parse(text, graph, known, f"f[{i}]") for i, text in enumerate(self.f)]
        rows_g = [parse(text, graph, outside, f"g[{i}]") for i, text in enumerate(self.g)]
        q = len(self.noises)
        nominal = LSUModel(
            A=np.eye(n),
            B=np.zeros((n, p)) if p else None,
            C=np.zeros((m, n)),
            rho=rho,
            r=r,
            noise_map=np.zeros((n, q)) if q else None,
            domain=domain,
            period=period,
            states=self.states,
            inputs=self.inputs or None,
            outputs=outputs,
            units=units,
        )
        rows_g = [
            free_of_branches(graph, row, 0.0 if nominal.period is None else float(nominal.period[i]))
            for i, row in enumerate(rows_g)
        ]
        self.linear = self._linear(rows_f, rows_g, nominal)
        """The same model with matrices, where every row is affine; else ``None``."""
        sees = [sorted(j - n for j in graph.variables_of(row) if n <= j < n + p) for row in rows_g]
        self.sees_inputs = any(sees)
        """Whether a row of g has an input, so that an update needs u."""
        if self.linear is None and self.sees_inputs:
            D = np.zeros((m, p))
            for i, seen in enumerate(sees):
                D[i, seen] = 1.0
            nominal = nominal.replace(D=D)
        everything = list(range(n + p + q))
        self.nominal = nominal if self.linear is None else self.linear
        """A linear model with the same sizes, names and bounds, to make filters with; its matrices say nothing."""
        self.dynamics = compiled(graph, rows_f, everything)
        """f and its derivatives by states, inputs, noises."""
        self.measured = compiled(graph, rows_g, everything[: n + p])
        """g and its derivatives by states and inputs."""

    def _check_names(self) -> None:
        names = [*self.states, *self.inputs, *self.noises, *self.parameters]
        problems = [
            f"the name {name!r} stands for {count} things" for name, count in Counter(names).items() if count > 1
        ]
        for name in names:
            if not isinstance(name, str) or not name.isidentifier() or keyword.iskeyword(name):
                problems.append(f"{name!r} is no name: take letters, digits and _, such as 'th'")
            elif name in FUNCTIONS or name == "pi":
                problems.append(f"{name!r} is taken by the language; give it another name")
        problems += [
            f"the parameter {k} must be finite, it is {v}" for k, v in self.parameters.items() if not np.isfinite(v)
        ]
        if not self.states:
            problems.append("a model has at least one state")
        if problems:
            raise ModelError(*problems)

    def _linear(self, rows_f: Sequence[int], rows_g: Sequence[int], nominal: LSUModel) -> LSUModel | None:
        n, p, q = len(self.states), len(self.inputs), len(self.noises)
        every = list(range(n + p + q))
        found_f = [affine(self.graph, row, every) for row in rows_f]
        found_g = [affine(self.graph, row, every[: n + p]) for row in rows_g]
        if any(row is None for row in [*found_f, *found_g]):
            return None
        slopes = np.array([row[0] for row in found_f if row is not None]).reshape(n, n + p + q)
        outputs = np.array([row[0] for row in found_g if row is not None]).reshape(len(rows_g), n + p)
        return nominal.replace(
            A=slopes[:, :n], B=slopes[:, n : n + p] if p else None, a=[row[1] for row in found_f if row is not None],
            noise_map=slopes[:, n + p :] if q else None, C=outputs[:, :n], D=outputs[:, n:] if p else None,
            d=[row[1] for row in found_g if row is not None], period=nominal.period, outputs=nominal.outputs,
            inputs=nominal.inputs if p else None,
        )  # fmt: skip

    @property
    def state_count(self) -> int:
        """n"""
        return len(self.states)

    @property
    def input_count(self) -> int:
        """p"""
        return len(self.inputs)

    @property
    def output_count(self) -> int:
        """m"""
        return len(self.g)

    def __repr__(self) -> str:
        kind = "continuous, " if self.is_continuous else ""
        return (
            f"NonlinearModel({kind}states={self.state_count}, inputs={self.input_count}, outputs={self.output_count})"
        )


def _texts(name: str, rows: Sequence[str]) -> tuple[str, ...]:
    if isinstance(rows, str):
        raise ModelError(f"{name} must be a list of expressions, it is one text: {rows!r}; put it in brackets")
    return tuple(rows)
