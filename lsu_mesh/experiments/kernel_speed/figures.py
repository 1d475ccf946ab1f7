"""Cost against the number of states and of generators, on doubly logarithmic axes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lsu_mesh.experiments.kernel_speed.report import Report
from lsu_mesh.experiments.kernel_speed.steps import KINDS

NAME = "kernel-speed.png"


def exponent(sizes: list[int], seconds: list[float]) -> float:
    """p of the least-squares fit ``seconds ≈ a sizes^p`` over the upper half of the sizes (at least two of them)."""
    half = max(2, (len(sizes) + 1) // 2)
    return float(np.polyfit(np.log(sizes[-half:]), np.log(seconds[-half:]), 1)[0])


def growth(report: Report) -> dict[str, float]:
    """Exponents of the growth: of each filter's step with n, of a hull and of a step of LSUCZ with g."""
    found = {}
    for kind in KINDS:
        sizes, seconds = _against_states(report, kind)
        found[f"{kind} with n"] = exponent(sizes, seconds)
    counts = [cost.generators for cost in report.generators]
    found["hull with g"] = exponent(counts, [cost.hull for cost in report.generators])
    found["LSUCZ step with g"] = exponent(counts, [cost.step for cost in report.generators])
    return found


def draw(report: Report, folder: Path) -> Path:
    """Write the figure into the folder, which is made; needs matplotlib."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.5), layout="constrained")
    left, right = figure.subplots(1, 2)
    exponents = growth(report)
    for kind in KINDS:
        sizes, seconds = _against_states(report, kind)
        _line(left, sizes, seconds, f"{kind}, ∝ n^{exponents[f'{kind} with n']:.1f}")
    _axes(left, "states n", "one step (compiled loop where there is one)")
    counts = [cost.generators for cost in report.generators]
    for name, key in (("hull", "hull with g"), ("step", "LSUCZ step with g")):
        seconds = [getattr(cost, name) for cost in report.generators]
        _line(right, counts, seconds, f"{key.removesuffix(' with g')}, ∝ g^{exponents[key]:.1f}")
    _axes(right, "generators g, with 2g/5 constraints, dimension 3", "constrained zonotopes")
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / NAME
    figure.savefig(path, dpi=130)
    return path


def _against_states(report: Report, kind: str) -> tuple[list[int], list[float]]:
    costs = [cost for cost in report.steps if cost.kind == kind]
    return [cost.n for cost in costs], [cost.single if cost.loop is None else cost.loop for cost in costs]


def _line(axes: Any, sizes: list[int], seconds: list[float], label: str) -> None:
    axes.loglog(sizes, np.array(seconds) * 1e6, "o-", label=label)
    axes.set_xticks(sizes, [str(size) for size in sizes])
    axes.minorticks_off()


def _axes(axes: Any, below: str, title: str) -> None:
    axes.set_xlabel(below)
    axes.set_ylabel("microseconds")
    axes.set_title(title, fontsize=10)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
