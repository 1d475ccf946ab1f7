"""``lsu-mesh bench recording``: what a recording costs, batched and logged message by message."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict

from lsu_mesh_services.exit_codes import NOT_MET, OK
from lsu_mesh_services.recording.cost import Cost, measure

QUICK_STEPS = 120


def main(options: argparse.Namespace) -> int:
    found = measure(steps=QUICK_STEPS) if options.quick else measure()
    if options.json:
        print(json.dumps({"type": "recording", **asdict(found)}))
    else:
        for line in _lines(found):
            print(line)
    return NOT_MET if found.lost or found.problems or found.share_of_one_core >= 1 else OK


def _lines(found: Cost) -> list[str]:
    return [
        f"{found.filters} filters and a fusion at {found.rate:g} Hz: {found.messages} messages; processor time:",
        f"batched      {found.microseconds_per_message:8.1f} µs per message, {found.share_of_one_core:.0%} of one core",
        f"one by one   {found.naive_microseconds_per_message:8.1f} µs, {found.naive_over_batched:g} times as much",
        f"in the file  {found.bytes_per_step:8d} bytes per step, {found.lost} messages lost",
        *found.problems,
    ]
