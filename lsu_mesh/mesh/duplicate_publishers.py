"""Two living processes that publish one key: found by what they send, and only the earlier one is used.

A key has one publisher. After a restart messages carry another ``boot``, and no more come of the old one: a restart is
accepted at once. Two boots are of two living processes when what they send interleaves: the earlier one sends, then
the later one, then the earlier one again. From then on the later boot is refused until the earlier one is gone. Whole
messages are used or refused, so that no set becomes wrong, whichever is used.
"""

from __future__ import annotations

from collections import deque
from statistics import median
from typing import NamedTuple

from lsu_mesh.mesh.messages import Message

SECOND = 1_000_000_000
READ_FROM_ALL = ("health", "event")
"""Topics that watchers need of every process."""
LEAST_SILENCE_NS, SILENT_GAPS = 3 * SECOND, 3
"""A process that has sent nothing for so long, and for so many of its usual gaps, is gone."""
PROOF_NS = SECOND
"""Where the clocks of two hosts differ, both are alive when both send something new again after so long."""
MAX_BOOTS = 8
"""Of one key."""
GAPS = 9
"""The usual gap is the median of so many."""
LEAST_GAPS = 3
"""So many are known of whoever has a habit."""
MAX_NEWS = 64


class DuplicatePublisher(NamedTuple):
    """Two processes under one key; the messages of ``refused`` are not used."""

    key: str
    src: str
    used: str
    """Boot of the process that came first."""
    refused: str

    @property
    def words(self) -> str:
        """What is wrong and what to do."""
        return (
            f"2 processes of {self.src} publish {self.key}; the one that came later (boot {self.refused}) is not used "
            f"until the other one (boot {self.used}) is gone; stop one of the two"
        )


class _Publisher:
    """One boot under one key. Times of sending are by its clock, times of arrival by the receiver's."""

    def __init__(self, message: Message, now: int, kept: int) -> None:
        self.boot, self.src, self.name = message.boot, message.src, message.name
        self.first_sent_ns: int | None = message.sent_ns
        """None before its first message after it was away."""
        self.newest_sent_ns = message.sent_ns
        self.newest_seq = message.seq
        self.seen_at = now
        """When it last sent something new."""
        self.rivals: set[str] = set()
        """Earlier boots that were proved to be alive beside this one."""
        self.sent_beside: dict[str, int] = {}
        """By earlier boot: when this one first sent something after the first message of that one."""
        self.heard_beside: dict[str, int] = {}
        """By earlier boot: when that one was first heard again after this one."""
        self.refused: deque[tuple[int, int]] = deque(maxlen=kept)
        """Sequence number and arrival of what was refused last."""
        self._gaps: deque[int] = deque(maxlen=GAPS)

    def take(self, message: Message, now: int) -> None:
        """Note something new."""
        if self.first_sent_ns is None:
            self.first_sent_ns = message.sent_ns
        gap = (message.sent_ns - self.newest_sent_ns) // (message.seq - self.newest_seq)
        self._gaps.append(max(0, gap))
        self.newest_seq, self.newest_sent_ns = message.seq, message.sent_ns
        self.seen_at = max(self.seen_at, now)

    @property
    def has_habit(self) -> bool:
        """Whether its usual gap is known."""
        return len(self._gaps) >= LEAST_GAPS

    def is_present(self, now: int, gone_at: int | None) -> bool:
        """Whether it may still be there, by its own habit; after its token went, a message must have come since."""
        if gone_at is not None and self.seen_at <= gone_at:
            return False
        usual = int(median(self._gaps)) if self._gaps else 0
        return now - self.seen_at <= max(LEAST_SILENCE_NS, SILENT_GAPS * usual)

    def sent(self, message: Message, earlier: _Publisher) -> None:
        """Note something new of this one, the later of two."""
        if earlier.first_sent_ns is not None and message.sent_ns > earlier.first_sent_ns:
            self.sent_beside.setdefault(earlier.boot, message.sent_ns)

    def is_proved_by(self, message: Message, now: int) -> bool:
        """Whether something new of an earlier boot shows that both live.

        What was under way when a process ended was sent before the first message of its successor, by one clock.
        """
        first = self.sent_beside.get(message.boot)
        if first is not None and message.sent_ns > first:
            return True
        heard = self.heard_beside.setdefault(message.boot, now)
        return min(now, self.seen_at) - heard >= PROOF_NS

    def come_back(self) -> None:
        """Begin anew, as one that was just started."""
        self.first_sent_ns = None
        self.forget_all_but(set())
        self.refused.clear()

    def forget(self, boot: str) -> None:
        """Nothing of another boot matters any more."""
        self.rivals.discard(boot)
        self.sent_beside.pop(boot, None)
        self.heard_beside.pop(boot, None)

    def forget_all_but(self, boots: set[str]) -> None:
        """Nothing of other boots matters any more."""
        self.rivals &= boots
        for noted in (self.sent_beside, self.heard_beside):
            for boot in noted.keys() - boots:
                del noted[boot]


class DuplicatePublishers:
    """For each key the boots in the order of their arrival, and which of them are refused.

    Parameters
    ----------
    kept:
        How many refused messages of a boot are remembered by number: so many its publisher's cache still has.
    """

    def __init__(self, kept: int = 256) -> None:
        self._kept = kept
        self._known: dict[str, list[_Publisher]] = {}
        self._gone_at: dict[str, int] = {}
        """By name: when its liveliness token went."""
        self._news: deque[DuplicatePublisher] = deque(maxlen=MAX_NEWS)
        self._missed: list[tuple[str, str, list[int]]] = []

    def refuses(self, key: str, message: Message, now: int) -> DuplicatePublisher | None:
        """Why a new message must not be used; None where it may.

        ``now`` is the time of its arrival. A copy, or what came before, must not be told twice.
        """
        if message.topic in READ_FROM_ALL:
            return None
        known = self._known.setdefault(key, [])
        publisher = next((one for one in known if one.boot == message.boot), None)
        if publisher is None:
            self._make_room(known)
            publisher = _Publisher(message, now, self._kept)
            known.append(publisher)
            self._compare(key, publisher, message, now=now)
        elif message.seq > publisher.newest_seq:
            if len(known) > 1:
                self._return(known, publisher, now)
            publisher.take(message, now)
            self._compare(key, publisher, message, now=now)
        return self._refused(key, publisher, message, now=now) if publisher.rivals else None

    def record_alive(self, name: str, is_there: bool, now: int) -> None:
        """The token of a name came or went; processes of one name share it, so that it goes with the last of them."""
        if not is_there and any(one.name == name for known in self._known.values() for one in known):
            self._gone_at[name] = now

    def present(self, now: int) -> list[DuplicatePublisher]:
        """Keys that more than one process publishes now."""
        found = []
        for key, known in self._known.items():
            for later in known if len(known) > 1 else ():
                if later.rivals and later.is_present(now, self._gone_at.get(later.name)):
                    earlier = self._rival(known, later, now)
                    found += [] if earlier is None else [_pair(key, earlier, later)]
        return found

    def take_news(self) -> list[DuplicatePublisher]:
        """Those that were found since the last call."""
        news = list(self._news)
        self._news.clear()
        return news

    def take_missed(self) -> list[tuple[str, str, list[int]]]:
        """``(key, boot, numbers)`` of what was refused and is wanted now: the earlier process was gone already."""
        missed, self._missed = self._missed, []
        return missed

    def _compare(self, key: str, publisher: _Publisher, message: Message, now: int) -> None:
        """Something new has come: what it shows of the boots before and after its own."""
        known = self._known[key]
        place = known.index(publisher)
        for earlier in known[:place]:
            publisher.sent(message, earlier)
        for later in known[place + 1 :]:
            if publisher.boot not in later.rivals and later.is_proved_by(message, now):
                later.rivals.add(publisher.boot)
                self._news.append(_pair(key, publisher, later))

    def _refused(self, key: str, publisher: _Publisher, message: Message, now: int) -> DuplicatePublisher | None:
        earlier = self._rival(self._known[key], publisher, now)
        if earlier is not None:
            publisher.refused.append((message.seq, now))
            return _pair(key, earlier, publisher)
        self._take_over(key, publisher)
        return None

    def _rival(self, known: list[_Publisher], later: _Publisher, now: int) -> _Publisher | None:
        """An earlier process that is still there."""
        gone_at = self._gone_at.get(later.name)
        return next((one for one in known if one.boot in later.rivals and one.is_present(now, gone_at)), None)

    def _take_over(self, key: str, publisher: _Publisher) -> None:
        """The earlier processes are gone; what was refused since their last message is wanted again."""
        known = self._known[key]
        gone = [one for one in known if one.boot in publisher.rivals]
        last = max((one.seen_at for one in gone), default=0)
        numbers = [seq for seq, at in publisher.refused if at > last]
        publisher.rivals.clear()
        publisher.refused.clear()
        known[:] = [one for one in known if one not in gone]
        if numbers:
            self._missed.append((key, publisher.boot, numbers))

    def _make_room(self, known: list[_Publisher]) -> None:
        """Before a new boot is added: forget the one that is silent for the longest where there are many."""
        if len(known) >= MAX_BOOTS:
            known.remove(min(known, key=lambda one: one.seen_at))
        for one in known:
            one.forget_all_but({other.boot for other in known})

    def _return(self, known: list[_Publisher], publisher: _Publisher, now: int) -> None:
        """One that was away for long, and comes back beside another one, is the later of the two."""
        gone_at = self._gone_at.get(publisher.name)
        was_away = publisher.has_habit and not publisher.is_present(now, gone_at)
        if was_away and any(one.is_present(now, gone_at) for one in known if one is not publisher):
            known.remove(publisher)
            for one in known:
                one.forget(publisher.boot)
            publisher.come_back()
            known.append(publisher)


def _pair(key: str, earlier: _Publisher, later: _Publisher) -> DuplicatePublisher:
    return DuplicatePublisher(key, earlier.src, earlier.boot, later.boot)
