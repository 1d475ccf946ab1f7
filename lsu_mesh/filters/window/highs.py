"""The window's program by HiGHS: vertices, and an answer where the interior-point method has none that holds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import Indices, Vector
from lsu_mesh.errors import InconsistentData
from lsu_mesh.kernels.linear_programs.banded_program import Limits, Rows
from lsu_mesh.kernels.linear_programs.window_program import checked, in_units_of

INFEASIBLE = 2
TOLERANCES: dict[str, float] = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}


def highs_answer(
    rows: Rows, limits: Limits, count: int, size: float, method: str
) -> tuple[Vector, float, float, float, int]:  # fmt: skip
    """z, objective, its lower bound from HiGHS's multipliers, violation, iterations; solved in units of ``size``.

    Raises ``InconsistentData`` where HiGHS finds the program infeasible.
    """
    from scipy.optimize import linprog

    scaled_rows, scaled = in_units_of(size, rows, limits, count)
    matrix, right, used = inequalities(scaled_rows, scaled, count)
    bounds = np.stack([scaled.lower, scaled.upper], axis=1)
    for way, options in ((method, TOLERANCES), (method, {}), ("highs-ipm", {})):
        answer = linprog(scaled.cost, A_ub=matrix, b_ub=right, bounds=bounds, method=way, options=options)
        if answer.status == 0:
            break
    if answer.status == INFEASIBLE:
        raise InconsistentData("no half-widths within their limits explain the data of the window")
    if answer.x is None:
        return np.zeros(limits.cost.size), np.inf, -np.inf, size, 0
    multipliers = np.zeros((rows.first.size, 2))
    multipliers[used] = -answer.ineqlin.marginals.reshape(2, -1).T
    z = np.array(answer.x)
    z[:count] *= size
    z[count + rows.g.shape[1] :] *= size
    exact, value, bound, violation = checked(rows, limits, z, multipliers, count)
    return exact, value, bound, violation, int(answer.nit)


def inequalities(rows: Rows, limits: Limits, count: int) -> tuple[object, Vector, NDArray[np.int64]]:
    """``M z <= right`` as a sparse matrix: first the upper, then the lower sides of the rows that are used."""
    from scipy.sparse import csr_array

    used = np.flatnonzero(rows.span > 0)
    coefficients = rows.g.shape[1]
    entries: list[tuple[Indices, Indices, Vector]] = []
    for j in range(rows.a.shape[1]):
        has = rows.span[used] > j
        entries.append((np.flatnonzero(has), rows.first[used][has] + j, np.array(rows.a[used][has, j])))
    every = np.arange(used.size)
    entries += [(every, np.full(used.size, count + j), np.array(rows.g[used, j])) for j in range(coefficients)]
    at, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
    with_width = np.flatnonzero(rows.width[used] >= 0)
    widths = count + coefficients + rows.width[used][with_width]
    factors = -rows.factor[used][with_width]
    size = used.size
    matrix = csr_array(
        (
            np.concatenate([values, factors, -values, factors]),
            (
                np.concatenate([at, with_width, at + size, with_width + size]),
                np.concatenate([columns, widths, columns, widths]),
            ),
        ),
        shape=(2 * size, limits.cost.size),
    )
    matrix.eliminate_zeros()
    d, reach = rows.d[used], rows.reach[used]
    return matrix, np.concatenate([reach - d, reach + d]), used
