"""Costs against size without a network: every size of the effort has one."""

from __future__ import annotations

from lsu_mesh.experiments.mesh_speed.bench_kinds import KINDS
from lsu_mesh.experiments.mesh_speed.scale import (
    BANK,
    QUICK,
    SOURCES,
    STATE_KINDS,
    bank_costs,
    source_costs,
    state_costs,
    states_of,
)


def test_every_size_has_a_cost() -> None:
    found = [
        *source_costs(QUICK.sources, QUICK.steps, QUICK.rounds),
        *state_costs(QUICK.states, QUICK.steps, QUICK.rounds),
        *bank_costs(QUICK.instances, QUICK.rounds, QUICK.seconds),
    ]
    expected = [(SOURCES, count) for count in QUICK.sources]
    expected += [(states_of(kind), count) for kind in STATE_KINDS for count in QUICK.states]
    expected += [(BANK, count) for count in QUICK.instances]
    assert [(cost.what, cost.count) for cost in found] == expected
    assert all(cost.cost > 0 for cost in found)
    assert set(KINDS["scale"].keys) | set(KINDS["scale"].lower_is_better) <= set(found[0].line())


def test_ten_instances_cost_more_than_one() -> None:
    one, many = bank_costs((1, 1000), 1, 0.01)
    assert many.cost / one.cost > 10
