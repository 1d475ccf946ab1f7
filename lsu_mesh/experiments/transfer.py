"""Bayesian transfer from a source filter to a target filter, against the noise of the source's sensors.

Both filters watch the same state. Before the target's data of a step the source hands over what it knows *before* its
own data of that step (Kuklišová Pavelková, Jirsa, Quinn 2022): its state predictor, whose intersection with that of the
target is the optimal conditioning; or, for study, its data predictor: the strip ``ŷ_hi − r ≤ C x ≤ ŷ_lo + r``, which
can cut off the truth. Beside them runs the isolated target, with the same data.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from lsu_mesh import systems
from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData
from lsu_mesh.experiments.fusion import Make
from lsu_mesh.experiments.outcome import Check, Column, Outcome, Table, percent
from lsu_mesh.experiments.transfer_result import Result
from lsu_mesh.experiments.workers import Watch, spread, unwatched
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.lsucz import LSUCZ
from lsu_mesh.filters.lsuo import LSUO
from lsu_mesh.filters.lsup import LSUP
from lsu_mesh.filters.lsupb import LSUPB
from lsu_mesh.metrics import tnse
from lsu_mesh.model import LSUModel
from lsu_mesh.simulation import measure, random_uniform, simulate
from lsu_mesh.supports.orthotope import Orthotope

if TYPE_CHECKING:
    from matplotlib.figure import Figure


KINDS: Mapping[str, Make] = {
    "LSUO lp": lambda model, prior: LSUO(model, prior, hull="lp"),
    "LSUP": lambda model, prior: LSUP(model, prior),
    "LSUPB": lambda model, prior: LSUPB(model, prior),
    "LSUCZ": lambda model, prior: LSUCZ(model, prior),
}
"""LSUO with exact hulls is monotone: who starts with less knows less wide bounds at *every* step."""
SYSTEMS: Mapping[str, tuple[str, ...]] = {"S2": ("LSUPB", "LSUCZ"), "P3": tuple(KINDS)}
"""Systems, each with its kinds of filters. A box cannot hold what a position says of a velocity: on S2 the velocity of
LSUO grows without end, with and without transfer, so that there is nothing to compare."""
NOISE = {"S2": (0.01, 0.1), "P3": (0.03, 0.3)}
"""rho and the target's r: the state is less noisy than the sensors; then a good source has something to tell."""
RATIOS = np.logspace(-2.0, 1.0, 13)
SHOWN_RATIOS = RATIOS[[0, 4, 5, 6, 8, 12]]
"""Those of the printed table, and all there are in a quick run."""
WAYS = ("predictor", "data-predictor")
WELL_BELOW = 0.7
GAINS_LITTLE = ("LSUP",)
"""A parallelotope alone takes the faces of a sharp source in place of edges that its later data need: its hull may be
wider on average than without transfer. The table shows it, and no check asks for less."""
CAPTION = "Transfer against the source's noise: solid lines are the state predictor, dashed ones the data predictor"


@dataclass
class Sums:
    """What one target has done, over all steps and seeds."""

    widths: list[Vector] = field(default_factory=list)
    """Widths (n,) of the interval hull after the data."""
    isolated: list[Vector] = field(default_factory=list)
    """The same of the isolated filter."""
    held: list[bool] = field(default_factory=list)
    """Whether bounds and support hold the truth."""
    gains: list[float] = field(default_factory=list)
    """Nats of each step's transfer, by the hulls: volumes of supports by enumeration would take most of the time."""
    rejected: int = 0
    """Steps whose transfer was empty, or contradicted the target."""
    restarts: int = 0
    """Steps in which the target's own data contradicted it, so that it started again from the isolated filter's set."""
    points: list[Vector] = field(default_factory=list)
    isolated_points: list[Vector] = field(default_factory=list)
    truth: list[Vector] = field(default_factory=list)


def run(quick: bool = False, seed: int = 1, watch: Watch = unwatched) -> Outcome:
    """The curves over r_S ∈ [.01 r, 10 r] for all systems, kinds of filters and ways."""
    seeds, steps = range(seed, seed + (2 if quick else 5)), 60 if quick else 100
    points = [
        (system, kind, way, float(ratio))
        for system, kinds in SYSTEMS.items()
        for kind in kinds
        for way in WAYS
        for ratio in (SHOWN_RATIOS if quick else RATIOS)
    ]
    results = spread(partial(_result_at, seeds=seeds, steps=steps), points, watch)

    def draw() -> Figure:
        from lsu_mesh.experiments.transfer_figure import draw_transfer

        return draw_transfer(results)

    tables = [_table("transfer", results, len(seeds), steps)]
    if not quick:
        shown = [point for point in results if point.ratio in SHOWN_RATIOS]
        tables = [_table("transfer", shown, len(seeds), steps), _table("transfer-curves", results, len(seeds), steps)]
    return Outcome(tables, _checks(results), {"transfer": draw}, captions={"transfer": CAPTION})


def _result_at(point: tuple[str, str, str, float], seeds: range, steps: int) -> Result:
    return result(*point, seeds, steps)


def result(system: str, kind: str, way: str, ratio: float, seeds: Iterable[int], steps: int) -> Result:
    """One point of the curves."""
    sums = Sums()
    for seed in seeds:
        _simulate(sums, system, kind, way=way, ratio=ratio, seed=seed, steps=steps)
    widths, isolated = np.array(sums.widths), np.array(sums.isolated)
    shares = widths.mean(axis=0) / isolated.mean(axis=0)
    total = tnse(sums.points, sums.truth)
    return Result(
        system=system,
        kind=kind,
        way=way,
        ratio=ratio,
        width=float(shares.mean()),
        widest=float(shares.max()),
        worst_step=float((widths / isolated).max()),
        tnse=total,
        tnse_ratio=total / tnse(sums.isolated_points, sums.truth),
        gain=float(np.mean(sums.gains)),
        inside=float(np.mean(sums.held)),
        rejected=sums.rejected / len(widths),
        restarts=sums.restarts / len(widths),
    )


def _simulate(sums: Sums, system: str, kind: str, way: str, ratio: float, seed: int, steps: int) -> None:
    """One simulation of target, source and isolated target."""
    rho, r = NOISE[system]
    model = systems.get(system, rho=rho, r=r)
    sharper = model.replace(r=ratio * model.r)
    n = model.state_count
    prior = Orthotope([-5.0] * n, [5.0] * n)
    target, isolated, source = KINDS[kind](model, prior), KINDS[kind](model, prior), KINDS[kind](sharper, prior)
    made = simulate(model, steps, seed)
    for k in range(steps):
        _transfer(sums, way, target, source)
        isolated.update(made.Y[k])
        try:
            target.update(made.Y[k])
        except InconsistentData:
            sums.restarts += 1
            target.reset(isolated.support)
        noise = random_uniform(seed, "source", k + 1, model.output_count)
        source.update(measure(sharper.C, sharper.r, made.X[k], noise))
        _count(sums, made.X[k], target, isolated)
        for estimator in (target, isolated, source):
            estimator.predict(made.U[k])


def _transfer(sums: Sums, way: str, target: Filter, source: Filter) -> None:
    """Condition the target's prediction on what the source predicts; what contradicts is left out."""
    try:
        if way == "predictor":
            sums.gains.append(target.condition(source.support, gain="hull"))
        else:
            sums.gains.append(_meet_data_predictor(target, source, target.model))
    except InconsistentData:
        sums.rejected += 1
        sums.gains.append(0.0)


def _meet_data_predictor(target: Filter, source: Filter, model: LSUModel) -> float:
    """The strips ``ŷ_hi − r ≤ C x ≤ ŷ_lo + r``, as if they were data; empty ones are left out."""
    expected = source.predict_output()
    low, high = expected.upper - model.r, expected.lower + model.r
    if (low > high).all():
        raise InconsistentData("the source's output predictor is wider than 2 r")
    before = np.subtract(*target.bounds()[::-1])
    target.update(np.where(low <= high, 0.5 * (low + high), np.nan), r=np.maximum(0.5 * (high - low), 0.0))
    return max(0.0, float(np.log(before / np.subtract(*target.bounds()[::-1])).sum()))


def _count(sums: Sums, x: Vector, target: Filter, isolated: Filter) -> None:
    lower, upper = target.bounds()
    sums.widths.append(upper - lower)
    sums.isolated.append(np.subtract(*isolated.bounds()[::-1]))
    sums.held.append(bool((lower <= x).all() and (x <= upper).all() and target.support.contains(x)))
    sums.points.append(target.point)
    sums.isolated_points.append(isolated.point)
    sums.truth.append(x)


def _table(name: str, results: Iterable[Result], seeds: int, steps: int) -> Table:
    noises = "; ".join(f"{system}: rho = {rho:g}, r = {r:g}" for system, (rho, r) in NOISE.items())
    title = (
        f"Transfer against the source's noise r_S, {seeds} seeds × {steps} steps ({noises}): mean width of the hull "
        "÷ isolated, of all coordinates, of the one that gains least, and in the worst step"
    )
    columns = [
        Column("system"), Column("filter"), Column("transfer"), Column("r_S ÷ r", ".3g"), Column("width", ".3f"),
        Column("least gain", ".3f"), Column("worst step", ".3f"), Column("TNSE", ".3g"), Column("÷ isolated", ".3f"),
        Column("gain of hulls, nats", ".3f"), Column("truth inside, %", ".4g"), Column("rejected, %", ".4g"),
        Column("restarts, %", ".3g"),
    ]  # fmt: skip
    rows = [(*r[:10], percent(r.inside), percent(r.rejected), percent(r.restarts)) for r in results]
    return Table(name, title, tuple(columns), rows, is_for_files=name != "transfer")


def _checks(results: list[Result]) -> list[Check]:
    sound = [r for r in results if r.way == "predictor"]
    formal = [r for r in results if r.way == "data-predictor"]
    monotone = [r for r in sound if r.kind == "LSUO lp"]
    gaining = [r for r in sound if r.kind not in GAINS_LITTLE]
    sharp = [r.width for r in gaining if r.ratio <= 0.01]
    return [
        Check("transfer: share of steps with the truth inside", min(r.inside for r in sound), 1.0, "at least"),
        Check("transfer: mean width of any coordinate ÷ isolated", max(r.widest for r in gaining), 1.0),
        Check("transfer: width ÷ isolated in any step, LSUO lp", max(r.worst_step for r in monotone), 1.0 + 1e-9),
        Check("transfer: mean width ÷ isolated at r_S = 0.01 r", max(sharp), WELL_BELOW),
        Check("data-predictor: least share of steps with the truth inside", min(r.inside for r in formal), 0.95),
    ]
