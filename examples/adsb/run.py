"""Fetch the flights, convert them to CSV, and run the mesh on each.

python run.py                             both flights
python run.py aircraft_carrier            one of them
python run.py noisy_landing -- --rate 50  further options of lsu-mesh run behind --
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import widths
from convert import DATA, FLIGHTS, convert

HERE = Path(__file__).resolve().parent


def main(arguments: list[str]) -> int:
    cut = arguments.index("--") if "--" in arguments else len(arguments)
    flights, options = arguments[:cut] or list(FLIGHTS), arguments[cut + 1 :]
    unknown = [flight for flight in flights if flight not in FLIGHTS]
    if unknown:
        print(f"no flight {', '.join(unknown)}; there are {', '.join(FLIGHTS)}", file=sys.stderr)
        return 2
    for flight in flights:
        file = DATA / f"{flight}.csv"
        start, rows, reports = convert(flight, file)
        print(f"\n{flight}: {rows} state vectors at 1 Hz, {reports} new altitude reports", flush=True)
        recording = Path("runs") / f"{flight}-{time.strftime('%Y%m%d-%H%M%S')}.rrd"
        code = run_mesh(flight, file, start, recording, options)
        if code:
            return code
        if recording.exists():
            widths.main([str(recording), str(file)])
    return 0


def run_mesh(flight: str, file: Path, start: float, recording: Path, options: list[str]) -> int:
    """``lsu-mesh run`` with this flight in the place of the configuration's; its first state vector is step 1."""
    command = [
        sys.executable, "-P", "-m", "lsu_mesh_services", "run", str(HERE / "adsb.toml"),
        "--record", str(recording),
        "-X", f'mesh.name="{flight}"',
        "-X", f"mesh.start_time={start - 1.0}",
        "-X", f'sensors.baro.file="{file}"',
        *options,
    ]  # fmt: skip
    return subprocess.call(command)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
