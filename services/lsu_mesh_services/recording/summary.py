"""What a recording holds, in numbers, read chunk by chunk: for ``lsu-mesh recording info``.

A message with a checksum was accepted when it was recorded: of it, only what is counted is decoded. The first message
of every process, and all without a checksum or with other fields than that one, are decoded and checked as a whole.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path

import msgspec

from lsu_mesh.mesh.admission import Admission
from lsu_mesh.mesh.messages import TYPES
from lsu_mesh.mesh.sequences import Sequence
from lsu_mesh_services.recording.chunks import Damage, Rows, raw_rows
from lsu_mesh_services.recording.losses import Loss, Losses, damage_words
from lsu_mesh_services.recording.part_files import parts
from lsu_mesh_services.recording.read import check_recording, read_description, recorded_configuration

ABOUT = ("mesh", "seed", "dt", "model_digest", "lsu_mesh", "rerun_sdk", "numba", "python", "cpu", "replay_of")
"""Properties of the run that are shown."""
MAX_LOSSES = 100
"""Losses that are listed one by one."""


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
    damage: Damage = field(default_factory=Damage)
    """Of the files."""
    lost: int = 0
    """Messages that were written and are not there."""
    losses: list[Loss] = field(default_factory=list)
    """The same in rows of messages with the steps between which they lie, the first ones."""


class _Head(msgspec.Struct, gc=False):
    """Fields of a message that are counted."""

    boot: str
    seq: int
    step: int
    status: str = ""
    level: str = ""
    code: str = ""
    time_error_ns: int | None = None


_HEAD = msgspec.msgpack.Decoder(_Head)


def summary(path: Path) -> Summary:
    """Sum up a recording with all its parts.

    Raises ``OSError`` where a file cannot be read, ``ValueError`` where it is no recording of a mesh.
    """
    files = parts(path)
    for file in files:
        check_recording(file)
    description = read_description(*files)
    found = _summed_up(path, files, description, quick=True)
    return _summed_up(path, files, description, quick=False) if found.lost else found


def _summed_up(path: Path, files: tuple[Path, ...], description: dict[str, str], *, quick: bool) -> Summary:
    counts = _Counts(Admission(recorded_configuration(path, description), TYPES) if description else None)
    losses, damage = Losses(), Damage()
    for file in files:
        for rows in raw_rows(file, damage, quick=quick):
            losses.add(rows.numbers, rows.steps)
            counts.add(rows)
    lost = losses.found()
    began = datetime.fromtimestamp(counts.first_ns / 1e9, UTC).isoformat(timespec="milliseconds")
    return Summary(
        files=[str(file) for file in files],
        size=sum(file.stat().st_size for file in files),
        began=began if counts.last_ns else "",
        seconds=(counts.last_ns - counts.first_ns) / 1e9 if counts.last_ns else 0.0,
        steps=counts.steps,
        about={name: description[name] for name in ABOUT if description.get(name)},
        peers=counts.peers(),
        statuses=dict(counts.statuses),
        events=dict(counts.events.most_common()),
        refused=counts.refused,
        damaged=counts.damaged,
        unknown_fields=counts.unknown_fields,
        damage=damage,
        lost=sum(loss.messages for loss in lost),
        losses=lost[:MAX_LOSSES],
    )


class _Counts:
    """Counts messages as their chunks come."""

    def __init__(self, admission: Admission | None) -> None:
        self._admission = admission
        """What decodes and checks whole messages; ``None``: the recording does not say of which mesh they are."""
        self._peers: dict[str, Peer] = {}
        self._sequences: dict[tuple[str, str], Sequence] = {}
        self._fields: dict[tuple[str, str], bytes] = {}
        """The head of the map, which tells the number of its fields, of the first message of each process."""
        self.first_ns, self.last_ns = 2**62, 0
        self.steps = self.refused = self.damaged = 0
        self.statuses: Counter[str] = Counter()
        self.events: Counter[str] = Counter()

    @property
    def unknown_fields(self) -> dict[str, int]:
        """How often a field came that a newer peer wrote, by topic and name."""
        return {} if self._admission is None else dict(self._admission.unknown_fields)

    def add(self, rows: Rows) -> None:
        """Count the rows of a chunk."""
        if rows.is_refused:
            self.refused += len(rows.keys)
            return
        if self._count_run(rows):
            arrivals = list(rows.arrivals)
        else:
            arrivals = [
                arrival
                for key, payload, arrival in zip(rows.keys, rows.payloads, rows.arrivals, strict=True)
                if self._count(key, payload, is_checked=rows.is_checked)
            ]
        if arrivals:
            self.first_ns, self.last_ns = min(self.first_ns, min(arrivals)), max(self.last_ns, max(arrivals))

    def _count_run(self, rows: Rows) -> bool:
        """Count the next messages of one process at once; whether the rows are that."""
        key, payloads = rows.keys[0], rows.payloads
        try:
            heads = [_HEAD.decode(payload) for payload in payloads]
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
            return False
        first, last = heads[0], heads[-1]
        fields, sequence = self._fields.get((key, first.boot)), self._sequences.get((key, first.boot))
        is_run = (
            sequence is not None
            and rows.is_checked
            and [payload[:3] for payload in payloads].count(fields or b"") == len(heads)
            and rows.keys.count(key) == len(heads)
            and [head.seq for head in heads] == list(range(first.seq, first.seq + len(heads)))
            and [(head.boot, head.time_error_ns) for head in heads].count((first.boot, None)) == len(heads)
        )
        if not is_run or sequence is None or not sequence.follow(first.seq, last.seq):
            return False
        self._count_heads(self._peers[key], heads)
        return True

    def _count(self, key: str, payload: bytes, *, is_checked: bool) -> bool:
        """Count a message; whether it is one that has not come before."""
        try:
            head = _HEAD.decode(payload)
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
            self.damaged += 1
            return False
        identity = key, head.boot
        is_known = is_checked and self._fields.get(identity) == payload[:3] and head.time_error_ns is None
        if not is_known and self._admission is not None:
            step = self._checked_step(self._admission, key, payload)
            if step is None:
                return False
            head.step = step
            self._fields.setdefault(identity, payload[:3])
        sequence = self._sequences.get(identity)
        if sequence is None:
            sequence = self._sequences[identity] = Sequence(head.seq)
            self._peer(key, head.step).boots += 1
        if not sequence.admit(head.seq):
            return False
        self._count_heads(self._peers[key], [head])
        return True

    def _checked_step(self, admission: Admission, key: str, payload: bytes) -> int | None:
        """The step of a message that is decoded and checked as a whole; ``None``: it is none, or has come before."""
        duplicates = admission.duplicates
        message = admission.admit(key, payload)
        self.damaged += message is None and admission.duplicates == duplicates
        return None if message is None else message.step

    def _peer(self, key: str, step: int) -> Peer:
        return self._peers.setdefault(key, Peer("/".join(key.split("/")[3:]), first_step=step))

    def _count_heads(self, peer: Peer, heads: list[_Head]) -> None:
        steps = [head.step for head in heads]
        peer.messages += len(heads)
        peer.first_step, peer.last_step = min(peer.first_step, min(steps)), max(peer.last_step, max(steps))
        self.steps = max(self.steps, peer.last_step)
        if heads[0].status:
            self.statuses.update([head.status for head in heads])
        elif heads[0].code:
            self.events.update([f"{head.level} {head.code}" for head in heads])

    def peers(self) -> list[Peer]:
        """Per key its messages, in the order of the keys."""
        gaps: Counter[str] = Counter()
        for (key, _), sequence in self._sequences.items():
            gaps[key] += sequence.gaps
        for key, peer in self._peers.items():
            peer.gaps = gaps[key]
        return sorted(self._peers.values(), key=lambda peer: peer.key)


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
    for words in damage_words(found.damage, found.lost, found.losses):
        console.print(words, markup=False)
    if found.damaged:
        console.print(f"{found.damaged} payloads are damaged", markup=False)
    if found.unknown_fields:
        names = ", ".join(f"{name} {count} times" for name, count in found.unknown_fields.items())
        console.print(f"fields of a newer version, not read: {names}", markup=False)
