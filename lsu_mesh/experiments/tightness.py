"""How much wider than the exact hull each filter's is, on published benchmarks, beside the estimators published there.

A benchmark is a JSON file: ``system`` with matrices A, B, C, zonotopes R0 (of x at the first row), W and V (``center``,
``generators``), columns ``y`` and ``u`` of outputs and inputs; ``exact_hulls`` with ``lo`` and ``hi`` of some rows;
``tightness`` with the row ``k`` at which the mean over the states of radius ÷ exact radius is compared, and the
``mean_ratio`` of each published estimator; where they are known, the published hulls of that row, ``cora_hulls.full``.
The source of the numbers stands in the file.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import ModelError
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.lsucz import LSUCZ
from lsu_mesh.filters.lsuo import LSUO
from lsu_mesh.filters.lsup import LSUP, MAX_EXHAUSTIVE_SIZE
from lsu_mesh.filters.lsupb import LSUPB
from lsu_mesh.filters.zonotopic_kalman import ZonotopicKalman
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope

FILTERS: dict[str, Callable[[LSUModel, Orthotope], Filter]] = {
    "LSUO": LSUO,
    "LSUO lp": lambda model, prior: LSUO(model, prior, hull="lp"),
    "LSUP image": LSUP,
    "LSUP cgz": lambda model, prior: LSUP(model, prior, time_update="cgz"),
    "LSUP edges": lambda model, prior: LSUP(model, prior, time_update="edges"),
    "LSUP strips": lambda model, prior: LSUP(model, prior, time_update="strips"),
    "LSUPB": LSUPB,
    "LSUCZ(12, 4)": lambda model, prior: LSUCZ(model, prior, 12, 4),
    "LSUCZ(20, 8)": LSUCZ,
    "LSUCZ unreduced": lambda model, prior: LSUCZ(model, prior, reduce=False),
    "ZonotopicKalman(15)": ZonotopicKalman,
}
MAX_UNREDUCED = 100
"""Rows up to which the filter without limits is run: its programs grow with every row."""


class Benchmark(NamedTuple):
    """Model, prior, outputs Y (T, m), inputs U (T, p), exact hulls by row, and what is published of row ``last``.

    ``published``: mean ratios by estimator; ``published_hulls``: (lower, upper) by estimator, where they are known.
    """

    name: str
    model: LSUModel
    prior: Orthotope
    Y: Matrix
    U: Matrix
    exact: dict[int, tuple[Vector, Vector]]
    last: int
    published: dict[str, float]
    published_hulls: dict[str, tuple[Vector, Vector]]
    source: str


class Tightness(NamedTuple):
    """A filter's mean of radius ÷ exact radius at the last row, and the worst that its hulls cut off anywhere.

    ``cut_off`` is relative to the largest bound of the row: not above rounding where every hull holds the exact one;
    ``excess`` is the same for what they have too much.
    """

    filter: str
    mean_ratio: float
    cut_off: float
    excess: float


def read_benchmark(path: Path) -> Benchmark:
    """Read a benchmark; ``ModelError`` names the file and what is missing in it."""
    try:
        data: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        system, tightness = data["system"], data["tightness"]
        W = np.array(system["W"]["generators"], dtype=np.float64)
        r = np.abs(np.array(system["V"]["generators"])).sum(axis=1)
        reach, center = np.abs(np.array(system["R0"]["generators"])).sum(axis=1), np.array(system["R0"]["center"])
        return Benchmark(
            name=path.stem,
            model=LSUModel(A=system["A"], B=system["B"], C=system["C"], rho=np.ones(W.shape[1]), r=r, noise_map=W),
            prior=Orthotope(center - reach, center + reach),
            Y=np.array(system["y"], dtype=np.float64).T,
            U=np.array(system["u"], dtype=np.float64).T,
            exact={int(k): _hull(hull) for k, hull in data["exact_hulls"].items()},
            last=int(tightness["k"]),
            published={name: float(entry["mean_ratio"]) for name, entry in tightness["estimators"].items()},
            published_hulls={name: _hull(hull) for name, hull in data.get("cora_hulls", {}).get("full", {}).items()},
            source=str(data.get("source", "")),
        )
    except OSError as error:
        raise ModelError(f"{path}: {error.strerror}") from error
    except json.JSONDecodeError as error:
        raise ModelError(f"{path} is not JSON: {error}") from error
    except (KeyError, TypeError, IndexError) as error:
        raise ModelError(f"{path} is no benchmark: {error!r} (see lsu_mesh/experiments/tightness.py)") from error


def _hull(hull: dict[str, Any]) -> tuple[Vector, Vector]:
    return np.array(hull["lo"], dtype=np.float64), np.array(hull["hi"], dtype=np.float64)


def measure(benchmark: Benchmark, filters: dict[str, Callable[[LSUModel, Orthotope], Filter]]) -> list[Tightness]:
    """Every filter that fits on the data of one benchmark."""
    return [_follow(benchmark, name, make) for name, make in filters.items() if fits(name, benchmark)]


def fits(name: str, benchmark: Benchmark) -> bool:
    """Whether a filter of ``FILTERS`` can be run on a benchmark in little time."""
    if "unreduced" in name:
        return benchmark.last < MAX_UNREDUCED
    return "edges" not in name or max(benchmark.model.state_count, benchmark.model.rho.size) <= MAX_EXHAUSTIVE_SIZE


def _follow(benchmark: Benchmark, name: str, make: Callable[[LSUModel, Orthotope], Filter]) -> Tightness:
    estimator = make(benchmark.model, benchmark.prior)
    cut_off, excess, ratio = -np.inf, -np.inf, np.nan
    for k in range(benchmark.last + 1):
        estimator.update(benchmark.Y[k])
        lower, upper = estimator.bounds()
        if k in benchmark.exact:
            low, high = benchmark.exact[k]
            scale = max(1.0, np.abs(low).max(), np.abs(high).max())
            cut_off = max(cut_off, float(np.maximum(lower - low, high - upper).max() / scale))
            excess = max(excess, float(np.maximum(low - lower, upper - high).max() / scale))
        if k == benchmark.last:
            low, high = benchmark.exact[k]
            ratio = float(((upper - lower) / (high - low)).mean())
        else:
            estimator.predict(benchmark.U[k])
    return Tightness(name, ratio, cut_off, excess)
