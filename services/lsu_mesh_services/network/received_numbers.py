"""Which numbers have come to a peer, noted when they come: before they wait in its queue."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

from lsu_mesh.mesh.messages import Refused
from lsu_mesh.mesh.sequences import Head, Sequence

MAX_STREAMS = 4096
"""So many keys and boots are watched; the messages of further ones pass unwatched."""
MAX_BOOTS = 16
"""Of one key."""
TOGETHER_NS = 250_000_000
"""What is missed of a stream, number after number, in so short a time is one gap."""
Stream = tuple[str, str]
"""A key and the boot of its publisher."""


class Number(NamedTuple):
    """Which message of which stream."""

    stream: Stream
    seq: int


@dataclass
class Gap:
    """Numbers of a stream that were missed together, of which some may have come since."""

    stream: Stream
    first: int
    last: int
    noticed_ns: int
    tries: int = 0
    left: int = 0
    """How many were missing at the last look."""


class ReceivedNumbers:
    """Numbers by stream, and the gaps that are still asked for. Its owner lets in one thread at a time."""

    def __init__(self) -> None:
        self._sequences: dict[Stream, Sequence] = {}
        self._gaps: list[Gap] = []
        self._newest: dict[Stream, Gap] = {}
        self.copies = 0
        """Messages that had come before."""

    def take(self, key: str, head: Head, now: int) -> tuple[bool, Number | None]:
        """Whether a message is to be let in, and its number; one that is watched by nobody has none."""
        stream = (key, head.boot)
        sequence = self._sequences.get(stream)
        if sequence is None:
            if len(self._sequences) >= MAX_STREAMS:
                return True, None
            self._forget_old_boots(key)
            sequence = self._sequences[stream] = Sequence(head.seq)
        expected = sequence.newest + 1
        try:
            is_new = sequence.admit(head.seq, head.sent_ns)
        except Refused:
            return True, None  # admission says what is wrong with it
        if not is_new:
            self.copies += 1
            return False, None
        if head.seq > expected:
            self._miss(stream, expected, head.seq - 1, now)
        return True, Number(stream, head.seq)

    def lacks(self, key: str, head: Head) -> bool:
        """Whether a message is known to be missing."""
        sequence = self._sequences.get((key, head.boot))
        return sequence is not None and head.seq in sequence.missing

    def want(self, numbers: Iterable[Number], now: int) -> None:
        """Messages that have come and are not to be had any more are missing again."""
        for stream, first, last in as_ranges(numbers):
            sequence = self._sequences.get(stream)
            if sequence is not None:
                sequence.want(range(first, last + 1))
                self._miss(stream, first, last, now)

    def gaps(self) -> list[tuple[Gap, list[tuple[int, int]]]]:
        """Gaps that are not closed, each with the ranges that are missing of it."""
        found = []
        for gap in self._gaps:
            sequence = self._sequences.get(gap.stream)
            missing = [] if sequence is None else sequence.missing.within(gap.first, gap.last)
            if missing:
                found.append((gap, missing))
        self._keep([gap for gap, _ in found])
        return found

    def give_up(self, gaps: Iterable[Gap]) -> None:
        """Ask for these no more; their messages are let in if they come all the same."""
        given_up = {id(gap) for gap in gaps}
        self._keep([gap for gap in self._gaps if id(gap) not in given_up])

    def excuse(self, now: int) -> None:
        """The process stood still: what was missed before counts from now on."""
        for gap in self._gaps:
            gap.noticed_ns = max(gap.noticed_ns, now)

    def _keep(self, gaps: list[Gap]) -> None:
        self._gaps = gaps
        self._newest = {gap.stream: gap for gap in gaps}

    def _miss(self, stream: Stream, first: int, last: int, now: int) -> None:
        before = self._newest.get(stream)
        if before is not None and before.last + 1 == first and now - before.noticed_ns < TOGETHER_NS:
            before.last = last
            before.left += last - first + 1
            return
        gap = self._newest[stream] = Gap(stream, first, last, now, left=last - first + 1)
        self._gaps.append(gap)

    def _forget_old_boots(self, key: str) -> None:
        known = [stream for stream in self._sequences if stream[0] == key]
        for stream in known[: max(0, len(known) - MAX_BOOTS + 1)]:
            del self._sequences[stream]
            self._newest.pop(stream, None)


def as_ranges(numbers: Iterable[Number]) -> list[tuple[Stream, int, int]]:
    """Numbers as ranges of streams, each range as long as it can be."""
    by_stream: dict[Stream, list[int]] = {}
    for number in numbers:
        by_stream.setdefault(number.stream, []).append(number.seq)
    found: list[tuple[Stream, int, int]] = []
    for stream, seqs in by_stream.items():
        seqs.sort()
        first = last = seqs[0]
        for seq in seqs[1:]:
            if seq > last + 1:
                found.append((stream, first, last))
                first = seq
            last = seq
        found.append((stream, first, last))
    return found
