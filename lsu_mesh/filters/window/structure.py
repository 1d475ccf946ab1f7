"""What the window estimators know of a model and what they do not: correlated noise, and unknown entries of matrices.

``E x_{k+1} = A x_k + B u_k + w``, ``F y_k = C x_k + v``: E and F, unit upper triangular, model noise whose entries are
correlated. With a noise map N instead, ``x_{k+1} = A x_k + B u_k + N w`` is multiplied by ``[N⁺; N⊥']``, so that its
first rows bound w and the others are equations.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple, TypeAlias, cast

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import ModelError
from lsu_mesh.model import LSUModel

MATRICES = ("A", "B", "C", "E", "F")


class Unknown(NamedTuple):
    """An unknown entry of a matrix: row and column count from 1, as in the papers; lower <= value <= upper."""

    matrix: str
    row: int
    column: int
    lower: float
    upper: float


UnknownEntries: TypeAlias = Iterable[Unknown | Sequence[object] | Mapping[str, object]]


class Structure:
    """Matrices of a model with their unknown entries.

    Parameters
    ----------
    model:
        A, B, C and the noise map; unknown entries start from the model's values.
    E, F:
        (n, n), (m, m), unit upper triangular; ``None`` is the identity. E and a noise map exclude each other.
    unknown:
        Entries such as ``Unknown("E", 1, 2, -1.0, 1.0)``, or the five values in a list, or a mapping of the names.

    Raises
    ------
    ModelError
        Names the entry or matrix that is wrong.
    """

    def __init__(
        self,
        model: LSUModel,
        E: ArrayLike | None = None,
        F: ArrayLike | None = None,
        unknown: UnknownEntries = (),
    ) -> None:
        n, m = model.state_count, model.output_count
        check_window_model(model)
        if E is not None and model.noise_map is not None:
            raise ModelError("E and a noise map exclude each other: both say how noise enters the states")
        self.model = model
        self.matrices: dict[str, Matrix] = {
            "A": model.A,
            "B": np.zeros((n, 0)) if model.B is None else model.B,
            "C": model.C,
            "E": unit_triangular("E", E, n),
            "F": unit_triangular("F", F, m),
        }
        self.entries = tuple(_entry(item, self.matrices, model.noise_map is not None) for item in unknown)
        _check_distinct(self.entries)
        self.lower = np.array([entry.lower for entry in self.entries])
        self.upper = np.array([entry.upper for entry in self.entries])
        start = [self.matrices[e.matrix][e.row - 1, e.column - 1] for e in self.entries]
        self.start = np.clip(np.array(start, dtype=np.float64), self.lower, self.upper)
        self.known = {name: self._without_unknown(name) for name in MATRICES}
        self.transform, self.noise_count = _transform(model)

    @property
    def has_unknown(self) -> bool:
        """Whether any entry is unknown."""
        return bool(self.entries)

    def of(self, matrix: str) -> list[tuple[int, int, int]]:
        """Unknown entries of a matrix as (number, row, column), all from 0."""
        return [(k, e.row - 1, e.column - 1) for k, e in enumerate(self.entries) if e.matrix == matrix]

    def unknown_part(self, matrix: str, theta: Vector) -> Matrix:
        """The matrix with the unknown entries at ``theta`` and zeros elsewhere."""
        part = np.zeros(self.matrices[matrix].shape)
        for k, i, j in self.of(matrix):
            part[i, j] = theta[k]
        return part

    def at(self, matrix: str, theta: Vector) -> Matrix:
        """The matrix with these values of the unknown entries."""
        return self.known[matrix] + self.unknown_part(matrix, theta)

    def settled(self, theta: Vector) -> Structure:
        """The same structure with these values and nothing unknown."""
        changes: dict[str, object] = {"A": self.at("A", theta), "C": self.at("C", theta)}
        changes["outputs"] = self.model.outputs
        if self.model.B is not None:
            changes["B"] = self.at("B", theta)
        E = None if self.model.noise_map is not None else self.at("E", theta)
        return Structure(self.model.replace(**changes), E, self.at("F", theta))

    def model_at(self, theta: Vector, rho: ArrayLike | None = None, r: ArrayLike | None = None) -> LSUModel:
        """The LSU model at these values and half-widths; a noise map ``E⁻¹`` where E is not the identity.

        Raises ``ModelError`` for F ≠ I: divide the outputs by F first.
        """
        E, F = self.at("E", theta), self.at("F", theta)
        if not np.array_equal(F, np.eye(len(F))):
            raise ModelError("a model with F ≠ I has no LSU form; multiply y by F and use F = I")
        changes: dict[str, object] = {"A": self.at("A", theta), "C": self.at("C", theta)}
        changes["outputs"] = self.model.outputs
        if self.model.B is not None:
            changes["B"] = self.at("B", theta)
        if not np.array_equal(E, np.eye(len(E))):
            inverse = np.linalg.inv(E)
            changes |= {"A": inverse @ self.at("A", theta), "noise_map": inverse}
            if self.model.B is not None:
                changes["B"] = inverse @ self.at("B", theta)
        return self.model.replace(
            **changes, rho=self.model.rho if rho is None else rho, r=self.model.r if r is None else r
        )

    def _without_unknown(self, matrix: str) -> Matrix:
        known = np.array(self.matrices[matrix])
        for _, i, j in self.of(matrix):
            known[i, j] = 0.0
        return known


def check_window_model(model: LSUModel) -> None:
    """Raises ``ModelError`` where the model has a part that the window programs do not know."""
    if not isinstance(model, LSUModel):
        raise ModelError(f"the window estimators know no continuous model, as {model!r} is one")
    parts = {"D": model.D, "a": model.a, "d": model.d, "period": model.period, "radii": model.radii}
    given = [name for name, part in parts.items() if part is not None]
    if given:
        raise ModelError(
            f"the window estimators know no {', '.join(given)}: take offsets and D u off the data, or another filter"
        )


def unit_triangular(name: str, value: ArrayLike | None, size: int) -> Matrix:
    """The matrix, checked to be upper triangular with ones on its diagonal; the identity for ``None``."""
    if value is None:
        return np.eye(size)
    matrix = np.array(value, dtype=np.float64)
    if matrix.shape != (size, size):
        raise ModelError(f"{name} must have shape ({size}, {size}), it has shape {matrix.shape}")
    if not np.isfinite(matrix).all() or (np.tril(matrix) != np.eye(size)).any():
        raise ModelError(f"{name} must be upper triangular with ones on its diagonal, it is {matrix.tolist()}")
    return matrix


def _entry(item: object, matrices: Mapping[str, Matrix], has_noise_map: bool) -> Unknown:
    try:
        entry = Unknown(**item) if isinstance(item, Mapping) else Unknown(*cast("Sequence[object]", item))  # type: ignore[arg-type]
        entry = Unknown(
            matrix=str(entry.matrix),
            row=int(entry.row),
            column=int(entry.column),
            lower=float(entry.lower),
            upper=float(entry.upper),
        )
    except (TypeError, ValueError) as error:
        raise ModelError(
            f'an unknown entry must be [matrix, row, column, lower, upper] such as ["A", 1, 2, -1.0, 1.0], not {item!r}'
        ) from error
    if entry.matrix not in MATRICES:
        near = difflib.get_close_matches(entry.matrix.upper(), MATRICES, n=1, cutoff=0.0)
        raise ModelError(f"there is no matrix {entry.matrix!r}; did you mean {near[0]!r}? (valid: A, B, C, E, F)")
    rows, columns = matrices[entry.matrix].shape
    if not (1 <= entry.row <= rows and 1 <= entry.column <= columns):
        raise ModelError(f"{entry.matrix} has {rows} rows and {columns} columns, it has no entry {tuple(entry[1:3])}")
    if entry.matrix in "EF" and entry.row >= entry.column:
        raise ModelError(f"only entries above the diagonal of {entry.matrix} can be unknown, not {tuple(entry[1:3])}")
    if entry.matrix == "E" and has_noise_map:
        raise ModelError("E and a noise map exclude each other: both say how noise enters the states")
    if not (np.isfinite(entry.lower) and np.isfinite(entry.upper) and entry.lower <= entry.upper):
        raise ModelError(f"the limits of {entry.matrix}{tuple(entry[1:3])} must be finite and in order: {entry[3:]}")
    return entry


def _check_distinct(entries: Sequence[Unknown]) -> None:
    places = [entry[:3] for entry in entries]
    twice = sorted({place for place in places if places.count(place) > 1})
    if twice:
        raise ModelError(f"the entry {twice[0]} is listed twice among the unknown ones")


def _transform(model: LSUModel) -> tuple[Matrix, int]:
    """What the state equation is multiplied by, (n, n), and how many of its rows bound a noise."""
    n = model.state_count
    if model.noise_map is None:
        return np.eye(n), n
    N = np.array(model.noise_map)
    q = N.shape[1]
    if q > n or np.linalg.matrix_rank(N) < q:
        raise ModelError(f"the columns of noise_map must be independent; it has shape {N.shape} and they are not")
    orthogonal = np.linalg.qr(N, mode="complete")[0][:, q:]
    return np.vstack([np.linalg.pinv(N), orthogonal.T]), q


def domain_bounds(model: LSUModel) -> tuple[Vector, Vector]:
    if model.domain is None:
        return np.full(model.state_count, -np.inf), np.full(model.state_count, np.inf)
    return model.domain.bounds()


def input_matrix(model: LSUModel) -> Matrix:
    return np.zeros((model.state_count, 0)) if model.B is None else model.B


def are_equal(one: Matrix | None, other: Matrix | None) -> bool:
    return one is other or (one is not None and other is not None and np.array_equal(one, other))


def noise_widths(model: LSUModel, inverse: Matrix) -> Matrix:
    """What brings the noise into the state, (n, q)."""
    return inverse if model.noise_map is None else np.asarray(model.noise_map)
