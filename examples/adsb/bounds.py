"""Bounds from the first half of each flight, tried on its second half; the flights of ``traffic``, noisy ones too.

    python bounds.py                 margin 1.2
    python bounds.py 1.5             another margin

The ratio of the half-widths is that of ``adsb.toml``; ``factor`` is what the first half needs of them, ``rest`` what
the second half needs of the result: at most 1 where that explains it, else reports are named.
"""

from __future__ import annotations

import gzip
import json
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from convert import new_reports, wheel

from lsu_mesh.identification import explain
from lsu_mesh.mesh.config import load

HERE = Path(__file__).resolve().parent
SAMPLES = "traffic/data/samples/"
FLIGHTS = (
    "ambulances/rega_sg", "calibration/ajaccio", "calibration/munich", "featured/kiwi", "featured/zero_gravity",
    "gliders/luberon", "military/aircraft_carrier", "noisy/noisy_landing",
)  # fmt: skip


def altitudes(flight: str) -> np.ndarray:
    """One row per second (T, 1), NaN where there is no new report."""
    with zipfile.ZipFile(wheel()) as package:
        vectors: list[dict[str, Any]] = json.loads(gzip.decompress(package.read(f"{SAMPLES}{flight}.json.gz")))
    reports = [(round(seconds), altitude) for seconds, altitude in new_reports(vectors) if altitude is not None]
    Y = np.full((reports[-1][0] - reports[0][0] + 1, 1), np.nan)
    for second, altitude in reports:
        Y[second - reports[0][0]] = altitude
    return Y


def main(arguments: Sequence[str]) -> int:
    margin = float(arguments[0]) if arguments else 1.2
    configuration = load(HERE / "adsb.toml")
    model = configuration.model(["baro"]).replace(domain=configuration.prior)
    print(f"{'flight':28} {'steps':>6} {'reports':>8} {'factor':>8} {'rest':>8}  reports that break the bounds")
    for flight in FLIGHTS:
        Y = altitudes(flight)
        found = explain(model, Y, margin=margin)
        held = found.held_out
        assert held is not None
        broken = held.broken or ()
        named = f"{len(broken)}, the first at step {broken[0].step}: {broken[0].value:g} ft" if broken else "none"
        count = int((~np.isnan(Y)).sum())
        print(f"{flight:28} {len(Y):6} {count:8} {found.factor:8.3f} {held.factor:8.3f}  {named}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
