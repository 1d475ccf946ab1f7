"""Two files of results side by side: for each case and number, B ÷ A."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from lsu_mesh.errors import ModelError
from lsu_mesh.experiments.mesh_speed.bench_file import BenchFile
from lsu_mesh.experiments.mesh_speed.bench_kinds import KINDS

ALIKE = 0.05
"""A ratio this close to 1 is called the same; the noise of a shared machine is often larger."""
MACHINE = ("processor", "cores", "python")
"""Facts that change every time by the clock."""


class Row(NamedTuple):
    """One number of one case."""

    case: str
    measure: str
    ratio: float
    """B ÷ A."""
    verdict: str
    """``better``, ``worse`` or ``same``."""


class Comparison(NamedTuple):
    """All numbers that both files have, and what is to be known beside them."""

    rows: list[Row]
    only_one: list[str]
    """Cases that one of the files lacks."""
    differs: list[str]
    """Facts of the machines that differ."""


def compare_files(a: BenchFile, b: BenchFile) -> Comparison:
    """Every number that both have.

    Raises
    ------
    ModelError
        When the files hold different measurements, or no case in common.
    """
    if a.what != b.what:
        raise ModelError(f"the first file holds {a.what!r}, the second {b.what!r}: compare two of the same command")
    kind = KINDS[a.what]
    first, second = _by_key(a), _by_key(b)
    common = [key for key in first if key in second]
    if not common:
        found = "; ".join(kind.case_words(case) for case in [*first.values(), *second.values()])
        raise ModelError(f"the files have no case in common: {found or 'both are empty'}")
    rows = [row for key in common for row in _rows(a.what, first[key], second[key])]
    alone = [kind.case_words(case) for key, case in {**first, **second}.items() if key not in common]
    differs = [
        f"{fact}: {a.machine.get(fact)} and {b.machine.get(fact)}"
        for fact in MACHINE
        if a.machine.get(fact) != b.machine.get(fact)
    ]
    return Comparison(rows, alone, differs)


def _by_key(file: BenchFile) -> dict[tuple[Any, ...], Mapping[str, Any]]:
    names = KINDS[file.what].keys
    return {tuple(case[name] for name in names): case for case in file.cases}


def _rows(what: str, a: Mapping[str, Any], b: Mapping[str, Any]) -> list[Row]:
    kind, rows = KINDS[what], []
    for measure, lower_is_better in kind.lower_is_better.items():
        one, other = a.get(measure), b.get(measure)
        if isinstance(one, int | float) and isinstance(other, int | float) and one > 0:
            rows.append(Row(kind.case_words(a), measure, other / one, verdict(other / one, lower_is_better)))
    return rows


def verdict(ratio: float, lower_is_better: bool) -> str:
    """What B ÷ A says of B."""
    if abs(ratio - 1.0) <= ALIKE:
        return "same"
    return "better" if (ratio < 1.0) == lower_is_better else "worse"
