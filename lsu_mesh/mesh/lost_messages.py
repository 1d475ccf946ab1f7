"""Messages that are given up: each counted once, and named by key and number."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import NamedTuple

SECOND = 1_000_000_000
REMEMBERED_NS = 5 * SECOND
"""So long a loss stands in the health."""
MAX_NAMED, MAX_STREAMS = 4, 32
"""Streams that the text of an event names, and streams whose numbers go with it."""


class Loss(NamedTuple):
    """Messages of one key and boot that are given up, by the first and the last of their numbers."""

    key: str
    boot: str
    first: int
    last: int
    is_too_old: bool
    """Whether they have come and waited for too long; else they never came, or were dropped and not to be had again."""

    @property
    def size(self) -> int:
        """How many they are."""
        return self.last - self.first + 1

    @property
    def stream(self) -> str:
        """Topic and name of the key."""
        return "/".join(self.key.split("/")[-2:])


class LostMessages:
    """What a peer has given up, and what of it is still to be told: one event a second at most."""

    def __init__(self) -> None:
        self.never_came = self.too_old = 0
        self._news: list[Loss] = []
        self._next_news = 0
        self._last: tuple[int, str] | None = None

    @property
    def count(self) -> int:
        """All that have been given up."""
        return self.never_came + self.too_old

    @property
    def last(self) -> str:
        """What was given up last."""
        return "" if self._last is None else self._last[1]

    def record(self, losses: Iterable[Loss], now: int) -> None:
        """Note what has been given up."""
        for loss in losses:
            if loss.is_too_old:
                self.too_old += loss.size
            else:
                self.never_came += loss.size
            self._news.append(loss)
            self._last = now, _named([loss])

    def take_news(self, now: int) -> tuple[str, dict[str, str | int | float | None]] | None:
        """Words about what was given up since the last news, and the numbers by stream; None where there is nothing."""
        if not self._news or now < self._next_news:
            return None
        self._next_news = now + SECOND
        news, self._news = self._news, []
        words = []
        for is_too_old, why in ((True, "waited for too long in the queue"), (False, "are not to be had any more")):
            those = [loss for loss in news if loss.is_too_old == is_too_old]
            if those:
                words.append(f"{sum(loss.size for loss in those)} message(s) {why}: {_named(those)}")
        about: dict[str, str | int | float | None] = {"count": sum(loss.size for loss in news)}
        for stream, losses in list(_by_stream(news).items())[:MAX_STREAMS]:
            about[stream] = ", ".join(f"{loss.first}-{loss.last}" for loss in losses)[:1000]
        return f"given up: {'; '.join(words)}", about

    def complaint(self, now: int) -> str | None:
        """For the health of the seconds after."""
        if self._last is None or now - self._last[0] >= REMEMBERED_NS:
            return None
        return f"{self.count} message(s) so far are given up, last: {self._last[1]}"


def _by_stream(losses: Collection[Loss]) -> dict[str, list[Loss]]:
    found: dict[str, list[Loss]] = {}
    for loss in losses:
        found.setdefault(loss.stream, []).append(loss)
    return found


def _named(losses: Collection[Loss]) -> str:
    by_stream = _by_stream(losses)
    named = [
        f"{sum(loss.size for loss in those)} of {stream} (numbers {those[0].first} to {those[-1].last})"
        for stream, those in list(by_stream.items())[:MAX_NAMED]
    ]
    rest = len(by_stream) - len(named)
    return ", ".join(named) + (f" and of {rest} more" if rest else "")
