"""The linear state-space model with uniform noise (LSU model)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Array
from lsu_mesh.errors import ModelError

if TYPE_CHECKING:
    from lsu_mesh.supports.orthotope import Orthotope


class LSUModel:
    """``x⁺ = A x + B u + N w``, ``|w| ≤ rho``;  ``y = C x + v``, ``|v| ≤ r`` (entry by entry).

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
    states, inputs, outputs, units:
        Optional names of the n states, p inputs, m outputs, and units of the states.

    Raises
    ------
    ModelError
        Names every argument that is wrong, its value and what was expected.

    Arrays are copied, read-only and float64. Source: Pavelková & Jirsa 2018, eq. (4); the noise map after Chisci et al.
    1996.
    """

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
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
        units: Sequence[str] | None = None,
    ) -> None:
        problems: list[str] = []
        self.A = _matrix("A", A, problems)
        n = self.A.shape[0]
        if self.A.shape != (n, n) or n == 0:
            problems.append(f"A must be square and not empty, it has shape {self.A.shape}")
        self.B = None if B is None else _matrix("B", B, problems)
        if self.B is not None and self.B.shape[0] != n:
            problems.append(f"B must have {n} rows, one per state, it has shape {self.B.shape}")
        self.C = _matrix("C", C, problems, columns=n)
        if self.C.shape[1] != n:
            problems.append(f"C must have {n} columns, one per state, it has shape {self.C.shape}")
        self.noise_map = None if noise_map is None else _matrix("noise_map", noise_map, problems)
        if self.noise_map is not None and self.noise_map.shape[0] != n:
            problems.append(f"noise_map must have {n} rows, one per state, it has shape {self.noise_map.shape}")
        q = n if self.noise_map is None else self.noise_map.shape[1]
        self.rho = _half_widths("rho", rho, q, of="process noise", problems=problems)
        self.r = _half_widths("r", r, self.C.shape[0], of="output", problems=problems)
        self.domain = self._domain(domain, n, problems)
        p = 0 if self.B is None else self.B.shape[1]
        self.states = _names("states", states, n, default="x", problems=problems)
        self.inputs = _names("inputs", inputs, p, default="u", problems=problems)
        self.outputs = _names("outputs", outputs, self.C.shape[0], default="y", problems=problems)
        self.units = _names("units", units, n, default="", problems=problems)
        if problems:
            raise ModelError(*problems)

    @staticmethod
    def _domain(
        domain: Orthotope | tuple[ArrayLike, ArrayLike] | None, n: int, problems: list[str]
    ) -> Orthotope | None:
        if domain is None:
            return None
        from lsu_mesh.supports.orthotope import Orthotope

        try:
            box = domain if isinstance(domain, Orthotope) else Orthotope(*domain)
        except (ModelError, TypeError) as error:
            problems.append(f"domain must be a box (lower, upper): {error}")
            return None
        if box.dim != n:
            problems.append(f"domain must have {n} coordinates, one per state, it has {box.dim}")
        return box

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
        """A copy with some arguments changed; names are kept where they still fit."""
        arguments: dict[str, object] = {
            "A": self.A, "B": self.B, "C": self.C, "rho": self.rho, "r": self.r,
            "noise_map": self.noise_map, "domain": self.domain, "states": self.states, "units": self.units,
        }  # fmt: skip
        if "B" not in changes:
            arguments["inputs"] = self.inputs
        if "C" not in changes:
            arguments["outputs"] = self.outputs
        unknown = set(changes) - {*arguments, "inputs", "outputs"}
        if unknown:
            raise ModelError(f"LSUModel has no argument {', '.join(sorted(unknown))}")
        return LSUModel(**{**arguments, **changes})  # type: ignore[arg-type]

    def __repr__(self) -> str:
        return f"LSUModel(states={self.state_count}, inputs={self.input_count}, outputs={self.output_count})"


def _matrix(name: str, value: ArrayLike, problems: list[str], columns: int = 0) -> Array:
    try:
        matrix = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        problems.append(f"{name} must be a matrix of numbers: {error}")
        return _read_only(np.zeros((1, 1)))
    if matrix.size == 0 and matrix.ndim < 2:
        matrix = matrix.reshape(0, columns)
    if matrix.ndim != 2:
        problems.append(f"{name} must be a matrix (a list of rows), it has {matrix.ndim} dimension(s)")
        matrix = np.atleast_2d(matrix.ravel())
    if not np.isfinite(matrix).all():
        problems.append(f"{name} must hold finite numbers only")
    return _read_only(np.ascontiguousarray(matrix))


def _half_widths(name: str, value: ArrayLike, size: int, of: str, problems: list[str]) -> Array:
    try:
        vector = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        problems.append(f"{name} must be a list of numbers: {error}")
        return _read_only(np.zeros(size))
    if vector.ndim == 0:
        vector = np.full(size, float(vector))
    if vector.shape != (size,):
        problems.append(f"{name} must have {size} entries, one per {of}, it has shape {vector.shape}")
    elif not np.isfinite(vector).all() or (vector < 0).any():
        problems.append(f"{name} must be finite and not negative, it is {vector.tolist()}")
    return _read_only(vector)


def _names(name: str, value: Sequence[str] | None, size: int, default: str, problems: list[str]) -> tuple[str, ...]:
    if value is None:
        return tuple(f"{default}{i + 1}" if default else "" for i in range(size))
    if len(value) != size:
        problems.append(f"{name} must have {size} entries, it has {len(value)}: {list(value)}")
    return tuple(value)


def _read_only(array: Array) -> Array:
    array.setflags(write=False)
    return array
