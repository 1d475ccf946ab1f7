"""The same work by other libraries, each where it is installed: SciPy's linprog, highspy, zonoopt, filterpy."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from typing import Any

import numpy as np

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.model import LSUModel

Body = tuple[Vector, Matrix, Matrix, Vector]


def installed(package: str) -> bool:
    """Whether the package can be imported."""
    return importlib.util.find_spec(package) is not None


def linprog_hull(c: Vector, G: Matrix, A: Matrix, b: Vector) -> Callable[[], tuple[Vector, Vector]]:
    """Interval hull (n,), (n,) of ``{c + G ξ : A ξ = b, |ξ|∞ ≤ 1}`` by 2n calls of ``scipy.optimize.linprog``."""
    from scipy.optimize import linprog

    def best(d: Vector) -> float:
        return -float(linprog(-d, A_eq=A, b_eq=b, bounds=(-1, 1), method="highs").fun)

    def hull() -> tuple[Vector, Vector]:
        return c - np.array([best(-row) for row in G]), c + np.array([best(row) for row in G])

    return hull


def warm_highs_hull(c: Vector, G: Matrix, A: Matrix, b: Vector) -> Callable[[], tuple[Vector, Vector]]:
    """The same by one ``highspy.Highs`` that holds the model already: 2n new costs, each solved from the last basis."""
    import highspy

    m, g = A.shape
    program = highspy.HighsLp()
    program.num_col_, program.num_row_ = g, m
    program.col_cost_, program.col_lower_, program.col_upper_ = np.zeros(g), np.full(g, -1.0), np.ones(g)
    program.row_lower_, program.row_upper_ = b, b
    program.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
    program.a_matrix_.start_ = np.arange(m + 1) * g
    program.a_matrix_.index_ = np.tile(np.arange(g), m)
    program.a_matrix_.value_ = A.ravel()
    make: Any = highspy.Highs
    solver = make()
    for option, value in (("output_flag", False), ("threads", 1), ("presolve", "off"), ("solver", "simplex")):
        solver.setOptionValue(option, value)
    solver.passModel(program)
    solver.changeObjectiveSense(highspy.ObjSense.kMaximize)
    columns = np.arange(g, dtype=np.int32)

    def best(d: Vector) -> float:
        solver.changeColsCost(g, columns, d)
        solver.run()
        return float(solver.getInfo().objective_function_value)

    def hull() -> tuple[Vector, Vector]:
        return c - np.array([best(-row) for row in G]), c + np.array([best(row) for row in G])

    return hull


def zonoopt_set(c: Vector, G: Matrix, A: Matrix, b: Vector) -> Any:
    """The constrained zonotope as one of zonoopt."""
    import zonoopt
    from scipy.sparse import csc_matrix

    return zonoopt.ConZono(csc_matrix(G), c, csc_matrix(A), b)


def zonoopt_hull(c: Vector, G: Matrix, A: Matrix, b: Vector) -> Callable[[], tuple[Vector, Vector]]:
    """The same by ``ConZono.bounding_box`` with zonoopt's own settings."""
    made = zonoopt_set(c, G, A, b)

    def hull() -> tuple[Vector, Vector]:
        box = made.bounding_box()
        return np.array(box.lower()), np.array(box.upper())

    return hull


def zonoopt_step(
    model: LSUModel, body: Body, u: Vector, y: Vector, max_constraints: int
) -> Callable[[], tuple[Vector, Vector]]:
    """Time update, data update, reduction and hull by zonoopt; its sets of noise and matrices are made beforehand.

    It has no reduction of a constrained zonotope's generators, so that the set keeps those which the reduction of
    constraints leaves.
    """
    import zonoopt
    from scipy.sparse import csc_matrix

    assert model.B is not None
    posterior = zonoopt_set(*body)
    A, C, shift = csc_matrix(model.A), csc_matrix(model.C), model.B @ u
    noise = zonoopt.Zono(csc_matrix(np.diag(model.rho)), np.zeros(model.state_count))
    R = csc_matrix(np.diag(model.r))

    def step() -> tuple[Vector, Vector]:
        prediction = zonoopt.minkowski_sum(zonoopt.affine_map(posterior, A, shift), noise)
        reduced = zonoopt.intersection(prediction, zonoopt.Zono(R, y), C)
        while reduced.get_nC() > max_constraints:
            reduced = reduced.constraint_reduction()
        box = reduced.bounding_box()
        return np.array(box.lower()), np.array(box.upper())

    return step


def kalman_step(model: LSUModel, Y: Matrix, U: Matrix) -> Callable[[], None]:
    """Update and prediction by ``filterpy.kalman.KalmanFilter``, noise of equal variance; each call takes a new row."""
    from filterpy.kalman import KalmanFilter

    assert model.B is not None
    n, m = model.state_count, model.output_count
    engine: Any = KalmanFilter(dim_x=n, dim_z=m, dim_u=model.input_count)
    engine.F, engine.B, engine.H = np.array(model.A), np.array(model.B), np.array(model.C)
    engine.Q, engine.R = np.diag(model.rho**2 / 3.0), np.diag(model.r**2 / 3.0)
    turn = 0

    def step() -> None:
        nonlocal turn
        engine.update(Y[turn % len(Y)])
        engine.predict(U[turn % len(U)])
        turn += 1

    return step
