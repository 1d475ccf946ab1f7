"""Rate, jitter and latency of a stream whose numbers are known."""

from __future__ import annotations

import pytest
from lsu_mesh_services.monitoring.stream_statistics import StreamStatistics

MS = 1_000_000


def test_an_even_stream_has_its_rate_and_no_jitter() -> None:
    beat = StreamStatistics()
    for k in range(1, 52):
        beat.record(k * 20 * MS, k * 20 * MS - 3 * MS, 100, k)
    assert beat.rate == pytest.approx(50.0)
    assert beat.jitter_ms == pytest.approx(0.0, abs=1e-9)
    assert (beat.latency_ms(0.5), beat.latency_ms(0.99)) == (3.0, 3.0)
    assert (beat.count, beat.bytes, beat.step) == (51, 5100, 51)


def test_an_uneven_stream_has_the_standard_deviation_of_its_periods() -> None:
    beat = StreamStatistics()
    at = 0
    for k, period in enumerate([10, 30, 10, 30, 10, 30]):
        beat.record(at, at - k * MS, 1, k)
        at += period * MS
    assert beat.periods_ms == [10.0, 30.0, 10.0, 30.0, 10.0]
    assert beat.jitter_ms == pytest.approx((96) ** 0.5)
    assert beat.latency_ms(0.5) == 3.0
    assert beat.latency_ms(0.99) == 5.0


def test_only_the_last_messages_count_for_the_rate() -> None:
    beat = StreamStatistics(most=10)
    for k in range(100):
        beat.record(k * 100 * MS, 0, 1, k)
    for k in range(1, 11):
        beat.record(10_000 * MS + k * MS, 0, 1, k)
    assert beat.rate == pytest.approx(1000.0)
    assert beat.count == 110


def test_nothing_is_said_of_too_few() -> None:
    beat = StreamStatistics()
    assert (beat.rate, beat.jitter_ms, beat.latency_ms(0.5)) == (None, None, None)
    beat.record(5, 4, 1, 1)
    assert (beat.rate, beat.jitter_ms, beat.latency_ms(0.5)) == (None, None, 1e-6)
