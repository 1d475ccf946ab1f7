"""Breaks a real mesh in every way: ``python benchmarks/faults.py [--rate 50] [--soak MINUTES]``.

Each role in turn is killed, stopped and started, frozen, and its link reset, made slow, stalled, cut and corrupted; all
are frozen at once; a subscriber is frozen; all are asked to stop, with their router and without it. Prints tables in
Markdown and returns 1 when a promise was broken: an estimate that does not hold the truth, a lost message, a process
that did not end well, or, with ``--strict``, a limit on time. ``--soak`` runs the mesh for so long instead, at a rate
that may be more than the machine can do, and watches memory, losses, and whether counters are true.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeAlias

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

import live_faults
from live_faults import HEADER, ROLES, Ending, Outcome
from live_mesh import LiveMesh
from live_soak import soak

PEERS_FAULTS = (live_faults.kill, live_faults.restart, live_faults.freeze, live_faults.reset_link)
STAR_FAULTS = (live_faults.delay, live_faults.stall, live_faults.cut, live_faults.corrupt)
RESUME_S, RESUME_AFTER_FREEZE_S = 1.0, 2.0 + live_faults.LEASE_S
STOP_S, STOP_WITHOUT_ROUTER_S = 3.0, 15.0
ROUTER_FAULTS: dict[Callable[[LiveMesh], None] | None, str] = {
    None: "",
    live_faults.lose_router: ", router lost",
    live_faults.freeze_router: ", router frozen",
}
IDENTIFIER = 'identifier.bounds.sensors=["s1","s2","s3"]'
Endings: TypeAlias = "tuple[str, float, Sequence[Ending]]"
"""The signal in words, the limit in seconds, and how each peer ended."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rate", type=float, default=50.0, help="steps per second (default: 50)")
    parser.add_argument("--soak", type=float, metavar="MINUTES", help="run for so long and watch the memory")
    parser.add_argument("--slow-subscriber", action="store_true", help="with --soak: it reads a tenth of the estimates")
    parser.add_argument("--only", metavar="WORDS", help="only faults or roles with these words, and no endings")
    parser.add_argument("--strict", action="store_true", help="limits on time count as promises (an idle machine)")
    options = parser.parse_args(arguments)
    overrides = [f"mesh.rate={options.rate}"]
    with tempfile.TemporaryDirectory() as folder:
        if options.soak is not None:
            report = soak(Path(folder), overrides, options.soak * 60, slow=options.slow_subscriber)
            print(report.table())
            return report.is_broken()
        return _all_faults(Path(folder), overrides, options.strict, options.only or "")


def _all_faults(folder: Path, overrides: Sequence[str], strict: bool, only: str) -> int:
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} at the start\n\n{HEADER}", flush=True)
    outcomes, endings = [], []
    if only != "endings":
        with LiveMesh(_new(folder / "peers"), overrides) as mesh:
            mesh.until(lambda: mesh.is_current(0), "estimates flow")
            outcomes += _each_role(mesh, PEERS_FAULTS, only)
            if only in live_faults.ALL:
                outcomes.append(_reported(live_faults.stand_still(mesh)))
            if only in "subscriber":
                outcomes.append(_reported(live_faults.slow_subscriber(mesh)))
    if not only or only in "router link bit":
        with LiveMesh(_new(folder / "star"), overrides, star=True) as mesh:
            mesh.until(lambda: mesh.is_current(0), "estimates flow")
            outcomes += _each_role(mesh, STAR_FAULTS, only)
            for number in (signal.SIGKILL, *live_faults.BOTH):
                outcome, ending = live_faults.router_outage(mesh, number)
                outcomes.append(_reported(outcome))
                endings += [(number.name, STOP_S, [ending])] if number != signal.SIGKILL else []
    if only in "endings":
        endings += _endings(folder, overrides)
        print(f"\n{_ending_table(endings)}")
    print(f"\nload {os.getloadavg()[0]:.1f} at the end")
    broken = [outcome for outcome in outcomes if outcome.inside < outcome.estimates or outcome.lost]
    ill = [ending for _, _, group in endings for ending in group if ending.code != 0]
    slow: list[Outcome | Ending] = [outcome for outcome in outcomes if _is_slow(outcome)]
    slow += [ending for _, limit, group in endings for ending in group if ending.seconds > limit]
    for words, guilty in (("BROKEN", broken), ("DID NOT END WELL", ill), ("SLOW", slow)):
        for one in guilty:
            print(f"{words}: {one}")
    return int(bool(broken or ill or (strict and slow)))


def _endings(folder: Path, overrides: Sequence[str]) -> list[Endings]:
    """Every role is asked to end by each signal, in a mesh of peers and in stars whose router is gone or silent."""
    found: list[Endings] = []
    for number in live_faults.BOTH:
        for fault, words in ROUTER_FAULTS.items():
            folder_of_one = _new(folder / f"{number.name}{len(found)}")
            with LiveMesh(folder_of_one, [*overrides, IDENTIFIER], star=fault is not None) as mesh:
                mesh.until(lambda mesh=mesh: mesh.is_current(0), "estimates flow")
                if fault is not None:
                    fault(mesh)
                limit = STOP_S if fault is None else STOP_WITHOUT_ROUTER_S
                found.append((f"{number.name}{words}", limit, live_faults.stop_all(mesh, 60.0, [number])))
    return found


def _each_role(mesh: LiveMesh, faults: Sequence[Callable[[LiveMesh, str], Outcome]], only: str) -> list[Outcome]:
    chosen = [(fault, role) for fault in faults for role in ROLES if only in f"{fault.__name__} {role}"]
    if shutil.which("ss") is None and live_faults.reset_link in faults:
        print("links are not reset: there is no `ss` here (Debian: iproute2)", file=sys.stderr)
        chosen = [(fault, role) for fault, role in chosen if fault is not live_faults.reset_link]
    return [_reported(fault(mesh, role)) for fault, role in chosen]


def _reported(outcome: Outcome) -> Outcome:
    print(outcome.row, flush=True)
    return outcome


def _is_slow(outcome: Outcome) -> bool:
    """Estimates resume within 1 s of a restart, 2 s and the lease after a freeze."""
    if outcome.fault in ("kill -9", "restart"):
        return outcome.resumed > RESUME_S
    return outcome.fault.startswith("SIGSTOP") and outcome.resumed > RESUME_AFTER_FREEZE_S


def _ending_table(endings: Sequence[Endings]) -> str:
    lines = ["| asked to stop by | role | exit codes | slowest | limit |", "|---|---|---|---|---|"]
    for words, limit, group in endings:
        for role in dict.fromkeys(ending.role for ending in group):
            own = [ending for ending in group if ending.role == role]
            codes = sorted({str(ending.code) for ending in own})
            slowest = max(ending.seconds for ending in own)
            lines.append(f"| {words} | {role} | {', '.join(codes)} | {slowest:.2f} s | {limit:g} s |")
    return "\n".join(lines)


def _new(folder: Path) -> Path:
    folder.mkdir()
    return folder


if __name__ == "__main__":
    sys.exit(main())
