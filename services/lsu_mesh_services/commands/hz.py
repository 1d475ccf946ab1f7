"""``lsu-mesh hz TOPIC/NAME``: rate, jitter and latency of a topic."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.nodes.node import SECOND
from lsu_mesh_services.exit_codes import NOT_MET, OK
from lsu_mesh_services.monitoring.stream_statistics import StreamStatistics
from lsu_mesh_services.monitoring.subscriber import run_tool, watching
from lsu_mesh_services.network.addresses import read_address


def main(options: argparse.Namespace) -> int:
    return run_tool(options, _measure)


def _measure(configuration: Configuration, options: argparse.Namespace) -> int:
    addresses = read_address(configuration, options.address)
    beats = {f"{topic}/{name}": StreamStatistics() for topic, name in addresses}
    with watching(configuration, options) as watch:
        watch.listen(addresses)
        told = watch.clock.now()
        for heard in watch.received(options.seconds):
            if heard is not None and heard.message is not None:
                beat = beats[f"{heard.topic}/{heard.name}"]
                beat.record(heard.arrival_ns, heard.message.sent_ns, heard.size, heard.message.step)
            if options.seconds is None and watch.clock.now() - told >= SECOND:
                told += SECOND
                _tell(beats, options)
        gaps = watch.admission.gaps
        watch.tell_refused()
    if options.seconds is not None:
        _tell(beats, options)
        if gaps:
            print(f"{gaps} message(s) were missed", file=sys.stderr)
    silent = [address for address, beat in beats.items() if not beat.count]
    return NOT_MET if len(silent) == len(beats) else OK


def _tell(beats: Mapping[str, StreamStatistics], options: argparse.Namespace) -> None:
    for address, beat in beats.items():
        print(json.dumps(record(address, beat)) if options.json else words(address, beat), flush=True)


def record(address: str, beat: StreamStatistics) -> dict[str, object]:
    """For programs; times in milliseconds."""
    periods = beat.periods_ms
    return {
        "key": address, "messages": beat.count, "rate_hz": beat.rate, "jitter_ms": beat.jitter_ms,
        "period_min_ms": min(periods, default=None), "period_max_ms": max(periods, default=None),
        "latency_p50_ms": beat.latency_ms(0.5), "latency_p99_ms": beat.latency_ms(0.99), "step": beat.step,
    }  # fmt: skip


def words(address: str, beat: StreamStatistics) -> str:
    """For people."""
    rate, jitter, latency = beat.rate, beat.jitter_ms, beat.latency_ms(0.5)
    if latency is None:
        return f"{address}: nothing yet"
    if rate is None or jitter is None:
        return f"{address}: 1 message, latency {latency:.2f} ms"
    periods = beat.periods_ms
    return (
        f"{address}: {rate:.2f} Hz; period {min(periods):.2f} to {max(periods):.2f} ms, jitter {jitter:.2f} ms; "
        f"latency p50 {latency:.2f} ms, p99 {beat.latency_ms(0.99):.2f} ms; {beat.count} messages"
    )
