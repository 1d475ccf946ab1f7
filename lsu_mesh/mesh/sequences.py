"""Which sequence numbers of a stream have come and which are missing: exact counts in bounded memory."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Collection
from typing import Any, NamedTuple

import msgspec

from lsu_mesh.mesh.messages import MAX_PAYLOAD, Refused

WINDOW = 4096
"""How far before the first number that came a message may come late and still be told from a copy."""
MAX_RANGES = 4096
"""So many ranges of missing numbers are remembered of a stream; the numbers of the oldest beyond stay counted."""


class Head(NamedTuple):
    """What tells one message of a key from another."""

    boot: str
    seq: int
    sent_ns: int


class _Head(msgspec.Struct):
    boot: str
    seq: int
    sent_ns: int


_HEAD_DECODER = msgspec.msgpack.Decoder(_Head)
_ERRORS: tuple[type[Exception], ...] = (
    msgspec.ValidationError, msgspec.DecodeError, RecursionError, UnicodeDecodeError, OverflowError, MemoryError,
)  # fmt: skip


def read_head(payload: bytes) -> Head | None:
    """The head of a message whose other fields are not read; None where there is none that can be read."""
    if len(payload) > MAX_PAYLOAD:
        return None
    try:
        found: Any = _HEAD_DECODER.decode(payload)
    except _ERRORS:
        return None
    is_sound = 0 <= found.seq < 2**63 and len(found.boot) == 16
    return Head(found.boot, found.seq, found.sent_ns) if is_sound else None


class Ranges:
    """A set of whole numbers as ranges in order, both ends included."""

    def __init__(self) -> None:
        self._firsts: list[int] = []
        self._lasts: list[int] = []
        self.count = 0
        """How many numbers are in it."""

    def __len__(self) -> int:
        """How many ranges."""
        return len(self._firsts)

    def __contains__(self, number: int) -> bool:
        place = bisect_right(self._firsts, number) - 1
        return place >= 0 and number <= self._lasts[place]

    def add(self, first: int, last: int) -> None:
        """Add the numbers from ``first`` to ``last``; nothing where ``last`` is the smaller one."""
        if last < first:
            return
        begin, end = bisect_left(self._lasts, first - 1), bisect_right(self._firsts, last + 1)
        if begin < end:
            first, last = min(first, self._firsts[begin]), max(last, self._lasts[end - 1])
        self.count -= sum(b - a + 1 for a, b in zip(self._firsts[begin:end], self._lasts[begin:end], strict=True))
        self._firsts[begin:end], self._lasts[begin:end] = [first], [last]
        self.count += last - first + 1

    def remove(self, number: int) -> bool:
        """Remove a number; False where it is not in it."""
        if number not in self:
            return False
        place = bisect_right(self._firsts, number) - 1
        first, last = self._firsts[place], self._lasts[place]
        kept = [(a, b) for a, b in ((first, number - 1), (number + 1, last)) if a <= b]
        self._firsts[place : place + 1] = [a for a, _ in kept]
        self._lasts[place : place + 1] = [b for _, b in kept]
        self.count -= 1
        return True

    def within(self, first: int, last: int) -> list[tuple[int, int]]:
        """Its numbers from ``first`` to ``last``, as ranges."""
        begin, end = bisect_left(self._lasts, first), bisect_right(self._firsts, last)
        pairs = zip(self._firsts[begin:end], self._lasts[begin:end], strict=True)
        return [(max(a, first), min(b, last)) for a, b in pairs]

    def drop_oldest(self) -> int:
        """Remove the first range; returns how many numbers it had."""
        count = self._lasts.pop(0) - self._firsts.pop(0) + 1
        self.count -= count
        return count


class Sequence:
    """Which sequence numbers of one (key, boot) have come."""

    def __init__(self, first: int) -> None:
        self._newest = first - 1
        self._unseen = Ranges()
        self._unseen.add(max(0, first - WINDOW), first - 1)
        self.missing = Ranges()
        """Numbers that exist and have not come, as far as they are remembered one by one."""
        self._forgotten = 0
        self._newest_sent = 0
        """When the newest message was sent."""

    @property
    def newest(self) -> int:
        """The largest number that has come."""
        return self._newest

    def admit(self, seq: int, sent_ns: int = 0) -> bool:
        """Whether ``seq`` is new.

        Raises :class:`Refused` where it has come before in a message that was sent earlier: this is another message.
        """
        if seq > self._newest:
            self._miss(self._newest + 1, seq - 1)
            self._newest = seq
            is_new = True
            self.missing.remove(seq)
        else:
            is_new = self.missing.remove(seq) or self._unseen.remove(seq)
        if not is_new and sent_ns > self._newest_sent:
            raise Refused("sequence", f"number {seq} came before; draw a new boot at each start, or count on")
        self._newest_sent = max(self._newest_sent, sent_ns)
        return is_new

    def follow(self, first: int, last: int) -> bool:
        """Take all numbers from ``first`` to ``last`` at once, if they are the next ones; whether they are."""
        if first != self._newest + 1:
            return False
        self._newest = last
        return True

    def want(self, numbers: Collection[int]) -> None:
        """Numbers that have come and were not used are missing again."""
        for number in numbers:
            if number <= self._newest:
                self._unseen.remove(number)
                self._miss(number, number)

    def expect(self, first: int, last: int) -> None:
        """Numbers exist; those of them that have not come are missing, also newer ones than all that have."""
        for a, b in self._unseen.within(first, last):
            for number in range(a, b + 1):
                self._unseen.remove(number)
            self._miss(a, b)
        self._miss(max(first, self._newest + 1), last)

    def _miss(self, first: int, last: int) -> None:
        self.missing.add(first, last)
        while len(self.missing) > MAX_RANGES:
            self._forgotten += self.missing.drop_oldest()

    @property
    def gaps(self) -> int:
        """How many numbers that exist have not come."""
        return self.missing.count + self._forgotten
