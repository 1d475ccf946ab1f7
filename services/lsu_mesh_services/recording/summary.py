"""What a recording holds, in numbers: for ``lsu-mesh recording info``."""

from __future__ import annotations

import json
import sys
from collections import Counter
from dataclasses import asdict, dataclass
from datetime import UTC, datetime

from lsu_mesh.mesh.messages import Event, Posterior
from lsu_mesh.mesh.sequences import Sequence
from lsu_mesh_services.recording.read import Recording, read_raw

ABOUT = ("mesh", "seed", "dt", "model_digest", "lsu_mesh", "rerun_sdk", "numba", "python", "cpu", "replay_of")
"""Properties of the run that are shown."""


@dataclass
class Peer:
    """The messages of one key: how many, of which steps, how many processes sent them, and how many are missing."""

    key: str
    messages: int = 0
    first_step: int = 0
    last_step: int = 0
    boots: int = 0
    gaps: int = 0


@dataclass
class Summary:
    """A recording in numbers; times in seconds, ``began`` as ISO 8601."""

    files: list[str]
    size: int
    began: str
    seconds: float
    steps: int
    about: dict[str, str]
    peers: list[Peer]
    statuses: dict[str, int]
    events: dict[str, int]
    refused: int
    damaged: int
    unknown_fields: dict[str, int]


def summary(recording: Recording) -> Summary:
    """Sum up a recording."""
    received = recording.received
    arrivals = [one.arrival_ns for one in received]
    statuses = Counter[str](one.message.status for one in received if isinstance(one.message, Posterior))
    events = Counter(f"{one.message.level} {one.message.code}" for one in received if isinstance(one.message, Event))
    refused = len(read_raw(*recording.files, refused=True)) - len(read_raw(*recording.files))
    return Summary(
        files=[str(file) for file in recording.files],
        size=sum(file.stat().st_size for file in recording.files),
        began=datetime.fromtimestamp(min(arrivals) / 1e9, UTC).isoformat(timespec="milliseconds") if arrivals else "",
        seconds=(max(arrivals) - min(arrivals)) / 1e9 if arrivals else 0.0,
        steps=max((one.message.step for one in received), default=0),
        about={name: recording.description[name] for name in ABOUT if recording.description.get(name)},
        peers=_peers(recording),
        statuses=dict(statuses),
        events=dict(events.most_common()),
        refused=refused,
        damaged=len(recording.damaged),
        unknown_fields=recording.unknown_fields,
    )


def _peers(recording: Recording) -> list[Peer]:
    peers: dict[str, Peer] = {}
    sequences: dict[tuple[str, str], Sequence] = {}
    for one in recording.received:
        message = one.message
        name = "/".join(one.key.split("/")[3:])
        peer = peers.setdefault(name, Peer(name, first_step=message.step))
        peer.messages += 1
        peer.first_step, peer.last_step = min(peer.first_step, message.step), max(peer.last_step, message.step)
        sequence = sequences.get((name, message.boot))
        if sequence is None:
            sequence = sequences[name, message.boot] = Sequence(message.seq)
            peer.boots += 1
        sequence.admit(message.seq)
    for (name, _), sequence in sequences.items():
        peers[name].gaps += sequence.gaps
    return [peers[name] for name in sorted(peers)]


def print_summary(found: Summary, *, as_json: bool) -> None:
    """For people, or one JSON object."""
    if as_json:
        print(json.dumps({"type": "recording", **asdict(found)}))
        return
    from rich.console import Console
    from rich.table import Table

    console = Console(width=None if sys.stdout.isatty() else 120, highlight=False)
    console.print(f"{' + '.join(found.files)}: {found.size / 1e6:.3g} MB", markup=False)
    console.print(f"{found.steps} steps in {found.seconds:.4g} s from {found.began}", markup=False)
    console.print(", ".join(f"{name} {value}" for name, value in found.about.items()), markup=False)
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("key")
    for title in ("messages", "steps", "processes", "gaps"):
        table.add_column(title, justify="right")
    for peer in found.peers:
        steps = f"{peer.first_step}–{peer.last_step}"
        table.add_row(peer.key, str(peer.messages), steps, str(peer.boots), str(peer.gaps))
    console.print(table)
    for title, counts in (("sets", found.statuses), ("events", found.events)):
        if counts:
            console.print(f"{title}: " + ", ".join(f"{count} {what}" for what, count in counts.items()), markup=False)
    if found.refused:
        console.print(f"{found.refused} payloads were refused when they were recorded", markup=False)
    if found.damaged:
        console.print(f"{found.damaged} payloads are damaged", markup=False)
    if found.unknown_fields:
        names = ", ".join(f"{name} {count} times" for name, count in found.unknown_fields.items())
        console.print(f"fields of a newer version, not read: {names}", markup=False)
