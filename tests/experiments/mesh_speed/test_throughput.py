"""Rates of nodes: every kind is measured, and a node that does not work is not called quick."""

from __future__ import annotations

import pytest

from lsu_mesh.experiments.mesh_speed import throughput as module
from lsu_mesh.experiments.mesh_speed.bench_kinds import KINDS
from lsu_mesh.experiments.mesh_speed.local_steps import local_steps
from lsu_mesh.experiments.mesh_speed.throughput import (
    DEMANDED,
    FILTERS,
    FUSION_WORDS,
    QUICK,
    Throughput,
    in_turns,
    node_configuration,
    node_run,
    operation_run,
    throughput,
)


def test_every_node_and_operation_has_a_rate() -> None:
    called: list[int] = []
    found = throughput(QUICK, {"own": lambda: called.append(1)})
    lines = {row.what: row.line() for row in found}
    assert [*FILTERS, FUSION_WORDS] == list(lines)[: len(FILTERS) + 1]
    assert len([what for what in lines if what.startswith(("decode", "encode"))]) == 4
    assert called
    for what, line in lines.items():
        assert 0 < line["per_second"] <= line["best_per_second"]
        assert line["demanded"] == DEMANDED.get(what)
        assert set(KINDS["throughput"].keys) | set(KINDS["throughput"].lower_is_better) <= set(line)


def test_a_node_that_misses_steps_is_not_called_quick() -> None:
    mesh = node_configuration()
    steps = local_steps(mesh, module.LEAD + 3)
    assert node_run(mesh, "filter", "f1", steps=steps)()[0] == 3
    with pytest.raises(AssertionError, match="filter f1: 1 sets in 43 steps"):
        node_run(mesh, "filter", "f1", steps=[steps[0]] * len(steps))()


def test_demands() -> None:
    assert Throughput("x", 10.0, 11.0, 10.0).is_met is True
    assert Throughput("x", 9.0, 11.0, 10.0).is_met is False
    assert Throughput("x", 9.0, 11.0, None).is_met is None


def test_runs_take_turns() -> None:
    order: list[str] = []

    def run(name: str, count: int) -> module.Run:
        def once() -> tuple[int, float]:
            order.append(name)
            return count, 0.5

        return once

    assert in_turns({"a": run("a", 10), "b": run("b", 20)}, 2) == {"a": [20.0, 20.0], "b": [40.0, 40.0]}
    assert order == ["a", "b", "a", "b"]


def test_an_operation_fills_its_time() -> None:
    run = operation_run(lambda: sum(range(100)), 0.02)
    (count, seconds), (again, _) = run(), run()
    assert count == again
    assert 0.002 < seconds < 0.2
