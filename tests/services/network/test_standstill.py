"""A thread that was stopped is told from one that is busy and from one that waits."""

from __future__ import annotations

import pytest
from lsu_mesh_services.network.standstill import BETWEEN_NS, SECOND_NS, STANDSTILL_NS, Standstill


@pytest.mark.parametrize(
    ("passed_ns", "computed_ns", "stood"),
    [
        (STANDSTILL_NS + 1, 0, True),
        (9 * SECOND_NS, SECOND_NS // 2, True),
        (9 * SECOND_NS, SECOND_NS, False),
        (STANDSTILL_NS, 0, False),
        (BETWEEN_NS // 2, 0, False),
        (-SECOND_NS, 0, False),
    ],
)
def test_who_computes_little_for_long_stood_still(passed_ns: int, computed_ns: int, stood: bool) -> None:
    computed = [7]
    standstill = Standstill(lambda: computed[0])
    assert not standstill.look(SECOND_NS)
    computed[0] += computed_ns
    assert standstill.look(SECOND_NS + passed_ns) == stood
    assert not standstill.look(SECOND_NS + passed_ns), "it is told once"


def test_looks_in_quick_succession_do_not_hide_what_was_computed() -> None:
    computed = [0]
    standstill = Standstill(lambda: computed[0])
    for i in range(100):
        computed[0] += 20_000_000
        assert not standstill.look(i * 20_000_000)
    assert standstill.look(100 * 20_000_000 + SECOND_NS)
