"""``lsu-mesh bench kernels``: how fast filters and hulls are beside other implementations, in one run on one core."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from lsu_mesh_services.benchmarks.table import new_console, print_rows
from lsu_mesh_services.exit_codes import COULD_NOT_START, OK

if TYPE_CHECKING:
    from rich.console import Console

    from lsu_mesh.experiments.kernel_speed.report import Demand, Report


def main(options: argparse.Namespace) -> int:
    from lsu_mesh.experiments.kernel_speed import figures, report

    if options.out is not None and not _can_draw():
        print("the figure needs matplotlib: pip install matplotlib, or leave out --out", file=sys.stderr)
        return COULD_NOT_START
    found = report.measure(report.QUICK if options.quick else report.FULL, lambda words: _tell(words))
    made = report.as_dictionary(found) | {"growth": figures.growth(found)}
    if options.json:
        print(json.dumps(made))
    else:
        print_tables(found, made["growth"])
    if options.out is not None:
        folder = Path(options.out)
        print(f"figure: {figures.draw(found, folder)}", file=sys.stderr)
        (folder / "kernel-speed.json").write_text(json.dumps(made, indent=1) + "\n", encoding="utf-8")
    return OK


def _can_draw() -> bool:
    from importlib.util import find_spec

    return find_spec("matplotlib") is not None


def _tell(words: str) -> None:
    print(f"measuring {words} …", file=sys.stderr, flush=True)


def print_tables(report: Report, growth: dict[str, float]) -> None:
    """Everything for people, on stdout."""
    console = new_console()
    named = [f"{name} {value}" for name, value in report.machine.items() if value is not None]
    console.print(", ".join(named), markup=False, soft_wrap=True)
    _print_steps(console, report)
    _print_others(console, report)
    _print_growth(console, report, growth)
    _print_demands(console, report.demands)


def _print_steps(console: Console, report: Report) -> None:
    heads = (
        "filter",
        "n",
        "from Python",
        "loop",
        "bank",
        "plain NumPy",
        "÷ loop",
        "filterpy",
        "÷ from Python",
    )
    rows = [
        (
            cost.kind, str(cost.n), _time(cost.single), _time(cost.loop), _time(cost.bank), _time(cost.numpy),
            _ratio(cost.numpy, cost.loop), _time(cost.filterpy), _ratio(cost.filterpy, cost.single),
        )
        for cost in report.steps
    ]  # fmt: skip
    print_rows(console, "One step: output prediction, update, bounds, prediction", heads, rows)


def _print_others(console: Console, report: Report) -> None:
    hull, step = report.hull, report.constrained_step
    rows = [
        (name, _time(seconds), _ratio(seconds, hull.seconds["own"]), _small(hull.difference.get(name)))
        for name, seconds in hull.seconds.items()
    ]
    heads = ("solver", "one hull", "÷ own", "largest difference")
    print_rows(console, "Hull of 20 generators, 8 constraints, dimension 3", heads, rows)
    console.print(
        f"safe bounds: {report.safe_bounds.share:.1%} of a hull's time, "
        f"relative loss at most {report.safe_bounds.loss:.1e}"
    )
    rows = [("own", _time(step.own), "1", "1")]
    if step.zonoopt is not None:
        rows.append(("zonoopt", _time(step.zonoopt), _ratio(step.zonoopt, step.own), f"{step.width_ratio:.3f}"))
    print_rows(console, "Step of LSUCZ(20, 8) on P3 with hull", ("", "one step", "÷ own", "width ÷ own"), rows)
    bank = report.bank
    console.print(f"\nbank of {bank.instances} LSUO on P3: {bank.steps_per_second:,.0f} steps a second on one core")
    console.print(f"import lsu_mesh loads of zenoh, rerun, msgspec: {', '.join(report.imported) or 'none'}")
    for first in report.first_steps:
        console.print(
            f"new process, warm cache, with a first step of {first.kind}: "
            f"{first.processor:.2f} s of a processor, {first.wall:.2f} s by the clock"
        )


def _print_growth(console: Console, report: Report, growth: dict[str, float]) -> None:
    rows = [
        (str(cost.generators), str(cost.constraints), _time(cost.hull), _time(cost.step)) for cost in report.generators
    ]
    print_rows(
        console,
        "Cost against generators, dimension 3",
        ("generators", "constraints", "hull", "LSUCZ step"),
        rows,
    )
    console.print("growth, exponent of the upper half: " + ", ".join(f"{what} {p:.1f}" for what, p in growth.items()))


def _print_demands(console: Console, demands: Sequence[Demand]) -> None:
    verdicts = {True: "met", False: "MISSED", None: "not measured"}
    rows = [
        (
            demand.what,
            _number(demand.measured),
            f"{demand.relation} {_number(demand.limit)}",
            verdicts[demand.met],
        )
        for demand in demands
    ]
    print_rows(console, "Demanded", ("", "measured", "demanded", ""), rows)


def _time(seconds: float | None) -> str:
    if seconds is None:
        return "–"
    return f"{seconds * 1e6:.2f} µs" if seconds < 1e-4 else f"{seconds * 1e6:.0f} µs"


def _ratio(other: float | None, own: float | None) -> str:
    return "–" if other is None or own is None else f"{other / own:.3g}"


def _small(value: float | None) -> str:
    return "–" if value is None else f"{value:.1e}"


def _number(value: float | None) -> str:
    if value is None:
        return "–"
    if value == 0.0 or 1e-3 <= value < 1e4:
        return f"{value:.3g}"
    return f"{value:.1e}"
