"""``lsu-mesh replay FILE --verify``: what the verification of a recording found, for people and for programs."""

from __future__ import annotations

import json
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from lsu_mesh.experiments.workers import cores
from lsu_mesh.mesh.access import truth_is_known
from lsu_mesh.mesh.verification import Verification, verify
from lsu_mesh_services.exit_codes import NOT_MET, OK
from lsu_mesh_services.recording.read import Recording

MAX_SHOWN = 5


@dataclass(frozen=True)
class Report:
    """The verification of one recording."""

    recording: Recording
    found: Verification
    seconds: float

    @property
    def is_met(self) -> bool:
        """Whether there is something to prove and all of it is proved."""
        has_sets = self.found.exact.total() + self.found.outdated.total() > 0
        return self.found.holds and not self.recording.damaged and has_sets

    def counts(self) -> dict[str, dict[str, int]]:
        """By peer: sets that are exact, different, unverifiable."""
        exact = Counter[str]()
        for (peer, _), count in self.found.exact.items():
            exact[peer] += count
        different = Counter(difference.peer for difference in self.found.differences)
        unverifiable = Counter(missing.peer for missing in self.found.unverifiable)
        return {
            peer: {"exact": exact[peer], "different": different[peer], "unverifiable": unverifiable[peer]}
            for peer in sorted({*exact, *different, *unverifiable})
        }


def verify_recording(recording: Recording, *, as_json: bool) -> int:
    """Verify and print; the exit code."""
    began = time.perf_counter()
    found = verify(recording.configuration, [received.message for received in recording.received], cores())
    report = Report(recording, found, time.perf_counter() - began)
    if as_json:
        _print_json(report)
    else:
        _print_table(report)
    return OK if report.is_met else NOT_MET


def _print_table(report: Report) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console(width=None if sys.stdout.isatty() else 120, highlight=False)
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("")
    for title in ("exact", "different", "unverifiable"):
        table.add_column(title, justify="right")
    for peer, counts in report.counts().items():
        table.add_row(peer, *(str(count) for count in counts.values()))
    console.print(table)
    for line in (*_verdict(report), *_about_claims(report), *_about_truth(report)):
        console.print(line, markup=False, soft_wrap=True)


def _verdict(report: Report) -> list[str]:
    found, lines = report.found, []
    total = found.exact.total() + len(found.differences)
    if report.recording.damaged:
        lines.append(f"{len(report.recording.damaged)} payload(s) are damaged, first: {report.recording.damaged[0]}")
    if found.differences:
        lines.append(f"{len(found.differences)} of {total} sets differ from what their provenance gives; the first:")
        lines += [f"  {found.differences[0]}", *_other_machine(report)]
    elif found.exact:
        lines.append(f"{total} sets recomputed from their provenance in {report.seconds:.1f} s: equal, bit by bit")
    else:
        lines.append("the recording holds no set that could be recomputed")
    lines += [f"{count} sets are unverifiable: {words}" for words, count in found.outdated.items()]
    missed = [missing for missing in found.unverifiable if missing.reason not in found.outdated]
    if missed:
        lines.append(f"{len(missed)} sets are unverifiable, because the recorder missed what they used:")
        lines += _first(missed)
    return lines


def _about_claims(report: Report) -> list[str]:
    """What the sets say of themselves."""
    found, lines = report.found, []
    if found.false_claims:
        lines.append(f"{len(found.false_claims)} claims of sets are false; the first:")
        lines += _first(found.false_claims)
    for words, count in found.unproved.most_common():
        lines.append(f"{count} claims cannot be proved: {words}")
    return lines


def _first(found: Sequence[object]) -> list[str]:
    """Lines of the first few, and how many more there are."""
    lines = [f"  {one}" for one in found[:MAX_SHOWN]]
    return lines if len(found) <= MAX_SHOWN else [*lines, f"  and {len(found) - MAX_SHOWN} more; --json lists all"]


def _about_truth(report: Report) -> list[str]:
    containment = report.found.containment
    if not containment.archive.truth:
        if not truth_is_known(report.recording.configuration):
            return ["no truth: no sensor is simulated, so that nobody knows whether the sets hold the state"]
        return ["no truth: it is not recorded, so that containment was not checked"]
    lines = [f"{containment.holding} sets of steps whose truth is recorded hold it"]
    if containment.misses:
        lines.append(f"{len(containment.misses)} sets that must hold the truth miss it; first:")
        lines.append(f"  {containment.misses[0]}")
    for reason, count in containment.excused.most_common():
        lines.append(f"{count} sets miss the truth and need not hold it: they rest on {reason}")
    for sensor, words in containment.broken.items():
        lines.append(f"sensor {sensor} broke its declared bound: {words}")
    return lines


def _other_machine(report: Report) -> list[str]:
    from lsu_mesh_services.recording.stream import processor

    recorded = report.recording.description.get("cpu", "")
    if recorded in ("", processor()):
        return []
    return [f"  (recorded on {recorded}, this is {processor()}: kernels may differ in the last bits)"]


def _print_json(report: Report) -> None:
    found, containment = report.found, report.found.containment
    for peer, counts in report.counts().items():
        print(json.dumps({"type": "peer", "peer": peer, **counts}))
    for difference in found.differences:
        print(json.dumps({"type": "difference", **difference._asdict()}))
    for missing in found.unverifiable:
        print(json.dumps({"type": "unverifiable", **missing._asdict()}))
    for claim in found.false_claims:
        print(json.dumps({"type": "false_claim", **claim._asdict()}))
    for miss in containment.misses:
        print(json.dumps({"type": "miss", **miss._asdict()}))
    for words in report.recording.damaged:
        print(json.dumps({"type": "damaged", "text": words}))
    summary = {
        "type": "verification",
        "holds": report.is_met,
        "exact": found.exact.total(),
        "different": len(found.differences),
        "unverifiable": len(found.unverifiable),
        "outdated": dict(found.outdated),
        "false_claims": len(found.false_claims),
        "unproved_claims": dict(found.unproved),
        "hold_truth": containment.holding,
        "miss_truth": len(containment.misses),
        "excused": dict(containment.excused),
        "broken_bounds": containment.broken,
        "seconds": round(report.seconds, 3),
        "files": [str(file) for file in report.recording.files],
    }
    print(json.dumps(summary))
