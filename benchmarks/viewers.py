"""What a viewer does to a real run: ``python benchmarks/viewers.py [--rate 50] [--seconds 30]``.

Runs the demo as processes with a recorder that serves viewers, and the real viewer without a screen. Prints the latency
of the fused stream before it, while it is attached, frozen, and after it was killed, and the gaps of the recording.
Returns 1 when a fused step or a recorded message is missing, 2 where the viewer cannot run.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from headless_viewer import why_not
from live_viewers import measure


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rate", type=float, default=50.0, help="steps per second (default: 50)")
    parser.add_argument("--seconds", type=float, default=30.0, help="length of each phase (default: 30)")
    options = parser.parse_args(arguments)
    if (reason := why_not()) is not None:
        print(f"viewers: {reason}", file=sys.stderr)
        return 2
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} at the start\n", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        outcome = measure(Path(folder), options.seconds, options.rate)
    print(outcome.table())
    for gap in outcome.gaps:
        print(gap)
    return int(bool(outcome.gaps) or any(phase.missing for phase in outcome.phases.values()))


if __name__ == "__main__":
    sys.exit(main())
