"""Cost of one step of each filter: called once from Python, in a compiled loop, in a bank; beside plain NumPy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.experiments.kernel_speed import plain_numpy
from lsu_mesh.experiments.kernel_speed.other_libraries import installed, kalman_step
from lsu_mesh.experiments.kernel_speed.stopwatch import Candidate, compare
from lsu_mesh.filters.bank import FilterBank
from lsu_mesh.filters.compiled_loop import CompiledLoop
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.registry import filter_class
from lsu_mesh.filters.run import run_filter
from lsu_mesh.model import LSUModel
from lsu_mesh.simulation import Simulation, simulate
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.systems import get

KINDS = ("LSUO", "LSUP", "LSUPB", "LSUCZ", "ZonotopicKalman")
PLAIN: dict[str, Callable[..., Any]] = {"LSUO": plain_numpy.lsuo, "LSUP": plain_numpy.lsup}
OUTPUTS = 2
LOOP_ROWS = 1000
PLAIN_ROWS = 50
SINGLE_ROWS = 20
BANK_INSTANCES = 100
BANK_ROWS = 20


class StepCost(NamedTuple):
    """Seconds per step of one filter with n states; ``None`` where there is no such thing."""

    kind: str
    n: int
    single: float
    loop: float | None
    bank: float | None
    numpy: float | None
    filterpy: float | None


class BankSpeed(NamedTuple):
    """A bank on one core: instances, rows of data, steps a second."""

    instances: int
    rows: int
    steps_per_second: float


def stable_model(n: int) -> LSUModel:
    """The system P3 for n = 3, else an orthogonal matrix scaled to absolute row sums ≤ 0.9, from a fixed seed.

    One input, two outputs. Boxes, too, stay bounded under such a matrix.
    """
    if n == 3:
        return get("P3")
    random = np.random.default_rng(n)
    A = np.linalg.qr(random.normal(size=(n, n)))[0]
    A *= 0.9 / np.abs(A).sum(axis=1).max()
    return LSUModel(A, random.normal(size=(n, 1)), random.normal(size=(OUTPUTS, n)), rho=0.1, r=0.3)


def options_of(kind: str, n: int) -> dict[str, int]:
    """The defaults, with room for as many states as there are."""
    if kind == "LSUCZ":
        return {"max_generators": max(20, n + 8), "max_constraints": 8}
    return {"order": max(15, n + 5)} if kind == "ZonotopicKalman" else {}


def step_costs(sizes: Sequence[int], rounds: int, seconds: float) -> list[StepCost]:
    """The cost of each filter for each number of states, all ways of one (filter, n) in turns."""
    return [_cost(kind, n, rounds, seconds) for n in sizes for kind in KINDS]


def _cost(kind: str, n: int, rounds: int, seconds: float) -> StepCost:
    model, prior = stable_model(n), unit_box(n)
    data = simulate(model, LOOP_ROWS, seed=1)
    candidates = {"single": _one_by_one(kind, model, data)}
    kind_class: Any = filter_class(kind)
    options = options_of(kind, n)
    candidates["loop"] = _loop(kind_class(model, prior, point="centre", **options), data)
    candidates["bank"] = _bank(kind_class, model, BANK_INSTANCES, BANK_ROWS, **options)
    if kind in PLAIN:
        candidates["numpy"] = Candidate(lambda: plain_run(kind, model, data, PLAIN_ROWS), PLAIN_ROWS)
    if kind == "ZonotopicKalman" and installed("filterpy"):
        candidates["filterpy"] = Candidate(kalman_step(model, data.Y, data.U))
    cost = compare(candidates, rounds, seconds)
    others = (cost.get(name) for name in StepCost._fields[3:])
    return StepCost(kind, n, cost["single"], *others)


def unit_box(n: int) -> Orthotope:
    """The prior |x_i| ≤ 1."""
    return Orthotope(np.full(n, -1.0), np.full(n, 1.0))


def plain_run(kind: str, model: LSUModel, data: Simulation, rows: int) -> list[plain_numpy.Bounds]:
    """The first rows of the data through the plain NumPy version of a filter, from :func:`unit_box`."""
    n = model.state_count
    shape = np.ones(n) if kind == "LSUO" else np.eye(n)
    arrays = plain_numpy.plain_model(model)
    return plain_numpy.run(PLAIN[kind], arrays, np.zeros(n), shape=shape, Y=data.Y[:rows], U=data.U[:rows])


def bank_speed(instances: int, rows: int, rounds: int, seconds: float) -> BankSpeed:
    """Steps a second of a bank of LSUO on P3, on the one core that this process is kept on."""
    bank = _bank(filter_class("LSUO"), stable_model(3), instances, rows)
    return BankSpeed(instances, rows, 1.0 / compare({"bank": bank}, rounds, seconds)["bank"])


def _one_by_one(kind: str, model: LSUModel, data: Simulation) -> Candidate:
    """Output prediction, update, bounds and prediction, each called from Python; the same rows again and again."""
    kind_class, n = cast("Any", filter_class(kind)), model.state_count
    engine: Filter = kind_class(model, unit_box(n), point="centre", **options_of(kind, n))
    rows = list(zip(data.Y, data.U, strict=True))[: 2 * SINGLE_ROWS]

    def steps(some: list[tuple[NDArray[np.float64], NDArray[np.float64]]]) -> None:
        for y, u in some:
            engine.predict_output()
            engine.update(y)
            engine.bounds()
            engine.predict(u)

    steps(rows[:SINGLE_ROWS])
    ready, repeated = engine.snapshot(), rows[SINGLE_ROWS:]

    def again() -> None:
        engine.restore(ready)
        steps(repeated)

    return Candidate(again, SINGLE_ROWS)


def _loop(engine: CompiledLoop, data: Simulation) -> Candidate:
    start = engine.snapshot()

    def again() -> None:
        engine.restore(start)
        run_filter(engine, data.Y, data.U, volumes=None if engine.has_compiled_volumes else False)

    return Candidate(again, len(data.Y))


def _bank(kind: Any, model: LSUModel, instances: int, rows: int, **options: int) -> Candidate:
    """A plant at rest with noisy outputs, other noise for each instance; runs continue from the sets before."""
    random = np.random.default_rng(1)
    Y = random.uniform(-1.0, 1.0, (instances, rows, model.output_count)) * model.r
    U = np.zeros((instances, rows, model.input_count))
    bank = FilterBank(kind, model, [unit_box(model.state_count)] * instances, threads=1, point="centre", **options)

    def again() -> None:
        _, done = bank.run(Y, U)
        assert int(done.min()) == rows, "the bank has stopped early: its time would say nothing"

    return Candidate(again, instances * rows)
