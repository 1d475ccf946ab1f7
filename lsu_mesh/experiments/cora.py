"""The benchmark systems of Althoff and Rath 2021: our filters beside the published estimators, against exact hulls."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import ModelError
from lsu_mesh.experiments.outcome import NOTHING, Cell, Check, Column, Outcome, Table
from lsu_mesh.experiments.tightness import FILTERS, Benchmark, fits, read_benchmark
from lsu_mesh.experiments.workers import Watch, spread, unwatched
from lsu_mesh.filters.filter import Filter

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Box = tuple[Vector, Vector]

TITLE = "Althoff, Rath (2021): Comparison of guaranteed state estimators, Automatica 130; numbers of the CORA toolbox"
QUICK = ("LSUO", "LSUPB", "LSUCZ(20, 8)")
OURS, PUBLISHED = "here", "published"
TICKS = (1, 2, 5, 10, 20, 50, 100, 200, 500)
"""Of the axis of ratios."""
ROUNDING = 1e-6
"""Share of a radius by which published numbers may fall short of the exact hull: they come from other solvers."""


class Job(NamedTuple):
    """One filter on the system of one file."""

    path: Path
    name: str


class Result(NamedTuple):
    """Hulls after the data of each row, (T, n), and microseconds of processor time per step."""

    lower: Matrix
    upper: Matrix
    microseconds: float


class Ratio(NamedTuple):
    """Radius ÷ exact radius: mean and largest coordinate of the last hull, and the mean over all exact hulls."""

    mean: float
    largest: float
    over_time: float
    holds: bool
    """Whether the exact hulls are inside."""


def run(quick: bool = False, seed: int = 1, watch: Watch = unwatched, folder: Path = Path()) -> Outcome:
    """Tightness on every system of a folder. Nothing is random: ``seed`` has no part in it."""
    benchmarks = read_folder(folder)
    names = [name for name in FILTERS if not quick or name in QUICK]
    jobs = [Job(folder / f"{b.name}.json", name) for b in benchmarks for name in names if fits(name, b)]
    found = dict(zip(jobs, spread(result, jobs, watch), strict=True))
    tables, times, checks = [], [], []
    figures: dict[str, Callable[[], Figure]] = {}
    for b in benchmarks:
        own = {job.name: one for job, one in found.items() if job.path.stem == b.name}
        ratios = {name: ratio(b, one) for name, one in own.items()}
        tables.append(_table(b, ratios))
        times += [(b.name, name, one.microseconds) for name, one in own.items()]
        checks += list(_checks(b, ratios))
        figures[f"cora-{b.name}"] = partial(draw, b, ratios)
    columns = (Column("system"), Column("filter"), Column("µs per step", ".3g"))
    title = "Processor time per step, measured, steps from Python one by one; the publication has other machines"
    tables.append(Table("cora-times", title, columns, times))
    captions = {f"cora-{b.name}": f"{b.name}: mean radius of the last hull ÷ exact" for b in benchmarks}
    notes = (
        "Radius of the interval hull after the last data ÷ that of the exact hull (batch linear programming), mean and "
        "largest over coordinates; *all steps*: the mean over all steps whose exact hull is known. The numbers of "
        "*published* estimators are computed from their published hulls. The data are not shipped: "
        "`reproduce cora --benchmarks DIR` reads them. "
        + " ".join(dict.fromkeys(b.source for b in benchmarks if b.source))
    )
    return Outcome(tables=tables, checks=checks, figures=figures, title=TITLE, notes=notes, captions=captions)


def read_folder(folder: Path) -> list[Benchmark]:
    """Every system of a folder, by name; ``ModelError`` where there is none, or a file is not one."""
    paths = sorted(folder.glob("*.json"))
    if not paths:
        raise ModelError(f"{folder}: there is no JSON file of a published system")
    return [read_benchmark(path) for path in paths]


def result(job: Job) -> Result:
    """Run a filter over the data of a system."""
    b = read_benchmark(job.path)
    filter = FILTERS[job.name](b.model, b.prior)
    lower, upper = (np.empty((len(b.Y), b.model.state_count)) for _ in range(2))
    for row in range(2):  # loads the kernels
        _step(filter, b, row)
    filter = FILTERS[job.name](b.model, b.prior)
    began = time.process_time()
    for row in range(len(b.Y)):
        lower[row], upper[row] = _step(filter, b, row)
    return Result(lower, upper, 1e6 * (time.process_time() - began) / len(b.Y))


def _step(filter: Filter, b: Benchmark, row: int) -> Box:
    filter.update(b.Y[row])
    hull = filter.bounds()
    filter.predict(b.U[row])
    return hull


def ratio(b: Benchmark, found: Result) -> Ratio:
    """Tightness of one of our filters."""
    last = b.last
    at_rows = [_radii((found.lower[row], found.upper[row]), exact) for row, exact in b.exact.items()]
    holds = all(_contains((found.lower[row], found.upper[row]), exact, 1e-9) for row, exact in b.exact.items())
    final = _radii((found.lower[last], found.upper[last]), b.exact[last])
    return Ratio(float(final.mean()), float(final.max()), float(np.mean(at_rows)), holds)


def _radii(hull: Box, exact: Box) -> Matrix:
    """Radius ÷ exact radius, (n,)."""
    return np.asarray((hull[1] - hull[0]) / (exact[1] - exact[0]))


def _contains(hull: Box, exact: Box, rounding: float) -> bool:
    slack = rounding * max(1.0, float(np.abs(exact).max()))
    return bool((hull[0] <= exact[0] + slack).all() and (hull[1] >= exact[1] - slack).all())


def _table(b: Benchmark, ratios: Mapping[str, Ratio]) -> Table:
    exact = b.exact[b.last]
    rows: list[tuple[Cell, ...]] = []
    for name, one in ratios.items():
        rows.append((name, OURS, one.mean, one.largest, one.over_time, "yes" if one.holds else "no"))
    for name, hull in b.published_hulls.items():
        radii = _radii(hull, exact)
        holds = _contains(hull, exact, ROUNDING)
        rows.append((name, PUBLISHED, float(radii.mean()), float(radii.max()), NOTHING, "yes" if holds else "no"))
    rows.sort(key=lambda row: row[2])
    columns = (
        Column("estimator"), Column("from"), Column("mean", ".4g"), Column("largest", ".4g"),
        Column("all steps", ".4g"), Column("holds the exact hull"),
    )  # fmt: skip
    n, m, steps = b.model.state_count, b.model.output_count, len(b.Y)
    title = f"{b.name}: {n} states, {m} output(s), {steps} steps; radius ÷ exact radius of the last hull"
    return Table(f"cora-{b.name}", title, columns, rows)


def _checks(b: Benchmark, ratios: Mapping[str, Ratio]) -> Iterator[Check]:
    holding = float(np.mean([one.holds for one in ratios.values()]))
    yield Check(f"cora: {b.name}, share of our filters that hold every exact hull", holding, 1.0, "at least")
    exact = b.exact[b.last]
    others = [
        float(_radii(hull, exact).mean()) for name, hull in b.published_hulls.items() if not name.startswith("CZ")
    ]
    if others:
        best = ratios["LSUCZ(20, 8)"].mean / min(others)
        yield Check(f"cora: {b.name}, LSUCZ(20, 8) ÷ best published that is no constrained zonotope", best, 1.0)


def draw(b: Benchmark, ratios: Mapping[str, Ratio]) -> Figure:
    """All estimators by their mean ratio, on a logarithmic axis."""
    from matplotlib.figure import Figure

    exact = b.exact[b.last]
    bars = [(name, one.mean, OURS) for name, one in ratios.items()]
    bars += [(name, float(_radii(hull, exact).mean()), PUBLISHED) for name, hull in b.published_hulls.items()]
    bars.sort(key=lambda bar: -bar[1])
    colours = {OURS: "#1f5fa8", PUBLISHED: "#b8b8b8"}
    figure = Figure(figsize=(6.4, 0.22 * len(bars) + 1.0), layout="constrained")
    axes = figure.subplots()
    for origin, colour in colours.items():
        places = [i for i, bar in enumerate(bars) if bar[2] == origin]
        axes.barh(places, [bars[i][1] for i in places], color=colour, label=origin)
    axes.set_yticks(range(len(bars)), [bar[0] for bar in bars], fontsize=8)
    axes.set_xscale("log")
    axes.set_xlim(left=0.9)
    axes.axvline(1.0, color="black", linewidth=0.8)
    highest = max(ratio for _, ratio, _ in bars)
    ticks = [tick for tick in TICKS if tick <= 1.2 * highest]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_xticks([], minor=True)
    axes.grid(True, axis="x", linewidth=0.3)
    axes.set_axisbelow(True)
    axes.set_xlabel("mean radius ÷ exact radius (line: exact hull)")
    axes.set_title(b.name, fontsize=10)
    axes.legend(loc="upper right", fontsize=8)
    return figure
