"""A peer says how much processor it gets and how much it would need."""

from __future__ import annotations

import pytest
from lsu_mesh_services.network.processor_need import SECOND_NS, ProcessorNeed, Reading

from lsu_mesh.mesh.nodes.node import overload_words

START = Reading(0, 0, 0, 0, 0, 0)


def after(**changes: float) -> ProcessorNeed:
    """One second later."""
    values = {"now": 1.0, "waited_ns": 0.0, "processor_ns": 0.0, "taken": 0.0, "waiting": 0.0, "too_old": 0.0} | changes
    for name in ("now", "waited_ns", "processor_ns"):
        values[name] *= SECOND_NS
    need = ProcessorNeed(START)
    need.measure(Reading(**{name: int(value) for name, value in values.items()}))
    return need


def test_a_loop_that_waits_gets_what_it_needs() -> None:
    need = after(waited_ns=0.6, processor_ns=0.4, taken=100, waiting=50)
    assert (need.cores, need.cores_needed) == (pytest.approx(0.4), pytest.approx(0.4))
    assert overload_words(need.gauges) is None


@pytest.mark.parametrize(("waiting", "too_old"), [(50, 0), (0, 50), (20, 30)])
def test_a_busy_loop_whose_queue_grows_or_is_given_up_needs_more_in_proportion(waiting: int, too_old: int) -> None:
    need = after(processor_ns=0.8, taken=100, waiting=waiting, too_old=too_old)
    assert need.cores_needed == pytest.approx(1.2)
    assert overload_words(need.gauges) == "overloaded: needs 1.20 cores of 0.80 that it gets"


def test_who_works_off_a_backlog_gets_enough() -> None:
    need = after(processor_ns=1.0, taken=500, waiting=0)
    assert overload_words(need.gauges) is None
    need.measure(Reading(2 * SECOND_NS, 0, 2 * SECOND_NS, 900, 4, 0))
    assert overload_words(need.gauges) is None, "1 % more than it takes is chance"


def test_it_measures_once_a_second() -> None:
    assert after(now=0.99, processor_ns=0.8, taken=100, waiting=900).gauges == {"cores": 0.0, "cores_needed": 0.0}
