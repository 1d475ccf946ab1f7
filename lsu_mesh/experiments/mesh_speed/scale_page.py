"""``docs/scaling.md``: costs against sizes, how they grow, and projections, from a run of ``lsu-mesh bench scale``."""

from __future__ import annotations

from collections.abc import Sequence

from lsu_mesh.experiments.machine_facts import Facts
from lsu_mesh.experiments.mesh_speed.growth import exponent, fitted_line, projected
from lsu_mesh.experiments.mesh_speed.scale import PROCESSES, Cost

PROJECTED_FILTERS = (6, 12, 24, 48)
RATES = (50, 200)
FURTHER = (2, 4)
"""Projections stand at these multiples of the largest size that was measured."""
OTHER_PEERS = 5
"""Plant, three sensors and the fusion of the benchmark mesh."""
HEAD = """# Scaling

`lsu-mesh bench scale --page docs/scaling.md` measured this page and wrote it. [Performance](performance.md) tells how
the clocks work, and the [glossary](glossary.md) defines the words. Times are those of the machine below under its load:
exponents and ratios of two rows carry over to another machine, times do not.
"""
NOTES = """## How to read it
- **Processes**: the [benchmark mesh](performance.md#a-mesh-beside-its-relay) at 50 Hz with more and more filters. Every
  filter is one more process that reads one or two sensors and the input, and that the fusion awaits. The relay has the
  same processes without their work: the part of the cost that lies in Zenoh, in Python's threads and in the system.
- **Sources**, **states**: one node without a network, with decoding, admission and encoding. The kinds of the sources
  are LSUO, LSUP and LSUCZ in turn. The generators of LSUCZ grow with the states beyond 12, to n + 8.
- **Instances**: a bank of LSUO on P3, one thread; the cost is that of a step of all instances.
- **Exponent**: p of cost ∝ size^p over the upper half of the sizes; what does not grow dominates small ones.
- **Projected** is not measured: of processes it is a line through the points that kept up with their steps, of all else
  the exponent from the largest size on. No projection knows of busy processors, of full caches, or of a full link.
"""


def scale_page(costs: Sequence[Cost], *, date: str, commit: str | None, machine: Facts) -> str:
    """The whole page, from the costs of a run."""
    facts = ", ".join(f"{name} {value}" for name, value in machine.items() if value is not None)
    parts = [HEAD, f"Measured on {date[:10]}, commit {commit or 'unknown'}: {facts}.\n"]
    kinds = list(dict.fromkeys(cost.what for cost in costs))
    parts += [_section(what, [cost for cost in costs if cost.what == what]) for what in kinds]
    sound = _sound_points([cost for cost in costs if cost.what == PROCESSES])
    parts += [_cores(sound)] if len(sound) > 1 else []
    return "\n".join([*parts, NOTES])


def _section(what: str, costs: Sequence[Cost]) -> str:
    points = [(float(cost.count), cost.cost) for cost in costs]
    rows = [(f"{cost.count}", _number(cost.cost), _number(cost.cost / costs[0].cost), _basis(cost)) for cost in costs]
    end = ""
    if len(points) > 1:
        if what.startswith("processes"):
            end = _line_words(costs)
        else:
            for factor in FURTHER:
                count = factor * costs[-1].count
                cost = projected(points, count)
                rows.append((f"{count}", _number(cost), _number(cost / costs[0].cost), "projected"))
            end = f"\nGrowth: exponent {exponent(points):.2f}.\n"
    head = f"## {what[0].upper()}{what[1:]}\n| {what} | {costs[0].unit} | ÷ the first | |\n|---|---|---|---|\n"
    return head + "".join(f"| {' | '.join(row)} |\n" for row in rows) + end


def _basis(cost: Cost) -> str:
    return "measured" if cost.kept_up else "measured; it lost steps, which cost nothing"


def _sound_points(costs: Sequence[Cost]) -> list[tuple[float, float]]:
    """Those that kept up with their steps."""
    return [(float(cost.count), cost.cost) for cost in costs if cost.kept_up]


def _line_words(costs: Sequence[Cost]) -> str:
    sound = _sound_points(costs)
    if len(sound) < 2:
        return "\nFewer than two of them kept up with their steps on this busy machine: nothing is projected.\n"
    line = fitted_line(sound)
    words = f"{_number(line.fixed)} and {_number(line.each)} for each process; exponent {exponent(sound):.2f}"
    return f"\nA line: {words}.\n"


def _cores(points: Sequence[tuple[float, float]]) -> str:
    """How many cores a mesh keeps busy, by the line through the measured costs."""
    line = fitted_line(points)
    heads = " | ".join(f"cores at {rate} Hz" for rate in RATES)
    text = f"## Cores that a mesh keeps busy\n| filters | {heads} | |\n|---|{'---|' * len(RATES)}---|\n"
    for filters in PROJECTED_FILTERS:
        cores = [_number(max(0.0, line.at(filters + OTHER_PEERS)) * rate / 1000) for rate in RATES]
        basis = "between measured sizes" if filters + OTHER_PEERS <= points[-1][0] else "projected"
        text += f"| {filters} | {' | '.join(cores)} | {basis} |\n"
    return text + (
        "\nProcessor time of all processes on the machine of this run. It was measured at 50 Hz; other rates assume\n"
        "that a step costs the same. A mesh that keeps more cores busy than there are does not keep up.\n"
    )


def _number(value: float) -> str:
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"
