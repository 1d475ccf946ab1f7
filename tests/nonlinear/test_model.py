"""Nonlinear models: arguments, affine models, angles, and the steps that enclose them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lsu_mesh.errors import ModelError, UnboundedSupport
from lsu_mesh.kernels.intervals.operations import ATAN2, ATAN2_ANY
from lsu_mesh.nonlinear.graph import Graph
from lsu_mesh.nonlinear.language import parse
from lsu_mesh.nonlinear.model import NonlinearModel
from lsu_mesh.nonlinear.periodic import free_of_branches
from lsu_mesh.nonlinear.steps import data_step, time_step

NOTHING = np.zeros(0)


def test_every_wrong_argument_is_named() -> None:
    with pytest.raises(ModelError, match="f has 1 expressions, there are 2 states"):
        NonlinearModel(["x"], [], ["x", "y"], rho=0, r=[])
    with pytest.raises(ModelError, match="'x' stands for 2 things"):
        NonlinearModel(["x"], [], ["x"], rho=0, r=[], inputs=["x"])
    with pytest.raises(ModelError, match="'sin' is taken by the language"):
        NonlinearModel(["x"], [], ["x"], rho=0, r=[], parameters={"sin": 1.0})
    with pytest.raises(ModelError, match="'2x' is no name"):
        NonlinearModel(["x"], [], ["2x"], rho=0, r=[])
    with pytest.raises(ModelError, match="parameter a must be finite"):
        NonlinearModel(["x"], [], ["x"], rho=0, r=[], parameters={"a": math.nan})
    with pytest.raises(ModelError, match="f must be a list of expressions"):
        NonlinearModel("x", [], ["x"], rho=0, r=[])
    with pytest.raises(ModelError, match=r"g\[0\], row 1, column 1: unknown name 'w'"):
        NonlinearModel(["x + w"], ["w"], ["x"], rho=0, r=[1], noises=["w"])
    with pytest.raises(ModelError, match="rho must have 1 entries"):
        NonlinearModel(["x + w"], ["x"], ["x"], rho=[1, 2], r=[1], noises=["w"])
    with pytest.raises(ModelError, match="at least one state"):
        NonlinearModel([], [], [], rho=0, r=[])


def test_an_affine_model_has_matrices() -> None:
    model = NonlinearModel(
        ["x + 0.1*v + 0.5*w", "0.9*v + u + 2"], ["x - 1", "v + 3*u"], ["x", "v"], rho=[0.1], r=[0.2, 0.3],
        inputs=["u"], noises=["w"], period=[360, None], outputs=["where", "speed"], units=["m", "m/s"],
    )  # fmt: skip
    linear = model.linear
    assert linear is not None
    assert linear.A.tolist() == [[1.0, 0.1], [0.0, 0.9]]
    assert linear.B is not None
    assert linear.B.tolist() == [[0.0], [1.0]]
    assert linear.noise_map is not None
    assert linear.noise_map.tolist() == [[0.5], [0.0]]
    assert linear.a is not None
    assert linear.a.tolist() == [0.0, 2.0]
    assert linear.C.tolist() == [[1.0, 0.0], [0.0, 1.0]]
    assert linear.D is not None
    assert linear.D.tolist() == [[0.0], [3.0]]
    assert linear.d is not None
    assert linear.d.tolist() == [-1.0, 0.0]
    assert linear.period is not None
    assert linear.period.tolist() == [360.0, 0.0]
    assert (linear.states, linear.inputs, linear.outputs, linear.units) == (
        ("x", "v"), ("u",), ("where", "speed"), ("m", "m/s"),
    )  # fmt: skip
    assert NonlinearModel(["x*x"], ["x"], ["x"], rho=1, r=1).linear is None


def test_a_time_step_holds_every_successor() -> None:
    model = NonlinearModel(
        ["x + h*v*cos(th) + w1", "th + h*om*om + x*w2"], [], ["x", "th"], rho=[0.01, 0.02], r=[],
        inputs=["v", "om"], noises=["w1", "w2"], parameters={"h": 0.1},
    )  # fmt: skip
    rng = np.random.default_rng(1)
    lower, upper = np.array([1.0, 0.2]), np.array([1.5, 0.9])
    u_lower, u_upper = np.array([2.0, -0.3]), np.array([2.0, 0.3])
    step = time_step(model, lower, upper, u_lower, u_upper)
    assert step.noise_map is not None
    assert step.a is not None
    assert step.rho.shape == (2 + 1 + 2,)
    for _ in range(2_000):
        x, om = lower + rng.random(2) * (upper - lower), rng.choice([-0.3, 0.3, rng.uniform(-0.3, 0.3)])
        w = rng.choice([-1.0, 1.0], 2) * step.rho[:2]
        successor = np.array([x[0] + 0.1 * 2.0 * math.cos(x[1]) + w[0], x[1] + 0.1 * om * om + x[0] * w[1]])
        rest = successor - step.A @ x - step.a - step.noise_map[:, :2] @ w - step.noise_map[:, 2] * om
        assert (np.abs(rest) <= step.rho[3:] + 1e-12).all()


def test_a_data_step_holds_every_measurement_and_says_which_rows_hold() -> None:
    model = NonlinearModel(
        ["x", "y"], ["hypot(x, y)", "log(x - 1.2)", "x + b*y"], ["x", "y"], rho=0, r=[0.1] * 3, inputs=["b"]
    )
    rng = np.random.default_rng(2)
    lower, upper = np.array([1.0, 2.0]), np.array([1.4, 2.9])
    step, holds = data_step(model, lower, upper, np.array([0.5]), np.array([0.7]), np.array([0.1, 0.1, 0.1]))
    assert holds == [True, False, True]
    assert step.C[1].tolist() == [0.0, 0.0]
    assert step.d is not None
    for _ in range(1_000):
        x, b = lower + rng.random(2) * (upper - lower), rng.choice([0.5, 0.7])
        y = np.array([math.hypot(*x), x[0] + b * x[1]]) + rng.choice([-0.1, 0.1], 2)
        assert (np.abs(y - step.C[[0, 2]] @ x - step.d[[0, 2]]) <= step.r[[0, 2]] + 1e-12).all()


def test_a_step_that_cannot_be_enclosed_is_named() -> None:
    model = NonlinearModel(["x", "sqrt(y)"], [], ["x", "y"], rho=0, r=[])
    with pytest.raises(UnboundedSupport, match=r"f\[1\] = 'sqrt\(y\)' cannot be enclosed over x in .*y in \[-1, 1\]"):
        time_step(model, np.array([0.0, -1.0]), np.array([1.0, 1.0]), NOTHING, NOTHING)


@pytest.mark.parametrize(
    ("text", "period", "is_free"),
    [
        ("atan2(y, x)", 2 * math.pi, True),
        ("atan2(y, x) - th", 2 * math.pi, True),
        ("th - atan2(y, x) + 1", 2 * math.pi, True),
        ("-atan2(y, x)", 2 * math.pi, True),
        ("atan2(y, x)", math.pi, True),
        ("atan2(y, x)*180/pi", 360.0, True),
        ("180/pi*atan2(y, x)", 360.0, False),  # a quotient that is no constant of its own
        ("atan2(y, x)/pi*180", 360.0, True),
        ("3*atan2(y, x)", 2 * math.pi, True),
        ("atan2(y, x)", 0.0, False),
        ("atan2(y, x)", 360.0, False),
        ("atan2(y, x)*180/pi", 270.0, False),
        ("0.5*atan2(y, x)", 2 * math.pi, False),
        ("sin(atan2(y, x))", 2 * math.pi, False),
        ("atan2(y, x)*th", 2 * math.pi, False),
    ],
)
def test_a_period_frees_an_angle_of_its_branch(text: str, period: float, is_free: bool) -> None:
    graph = Graph(["x", "y", "th"])
    node = parse(text, graph, {name: graph.variable(i) for i, name in enumerate(graph.names)}, "g[0]")
    found = free_of_branches(graph, node, period)
    operations = {graph.nodes[k].operation for k in graph.below([found])}
    assert (ATAN2_ANY in operations, ATAN2 in operations) == (is_free, not is_free)
