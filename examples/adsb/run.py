"""Fetch two flights, convert them to CSV, and run the mesh on each: python run.py [flight …] [-- options of run]."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from convert import DATA, FLIGHTS, convert

HERE = Path(__file__).resolve().parent


def main(arguments: list[str]) -> int:
    options = arguments[arguments.index("--") + 1 :] if "--" in arguments else []
    flights = (arguments[: arguments.index("--")] if "--" in arguments else arguments) or list(FLIGHTS)
    for flight in flights:
        if flight not in FLIGHTS:
            print(f"no flight {flight!r}; there are {', '.join(FLIGHTS)}", file=sys.stderr)
            return 2
        file = DATA / f"{flight}.csv"
        start, rows, reports = convert(flight, file)
        print(f"\n{flight}: {rows} state vectors at 1 Hz, {reports} new altitude reports", flush=True)
        code = run_mesh(flight, file, start, options)
        if code:
            return code
    return 0


def run_mesh(flight: str, file: Path, start: float, options: list[str]) -> int:
    """``lsu-mesh run`` with this flight in the place of the configuration's."""
    command = [
        sys.executable, "-m", "services", "run", str(HERE / "adsb.toml"),
        "-X", f'mesh.name="{flight}"',
        "-X", f"mesh.start_time={start - 1.0}",
        "-X", f'sensors.baro.file="{file}"',
        *options,
    ]  # fmt: skip
    return subprocess.call(command)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
