"""What is given up is named once, by stream and number."""

from __future__ import annotations

from lsu_mesh.mesh.lost_messages import REMEMBERED_NS, SECOND, Loss, LostMessages

BOOT = "0" * 16


def loss(name: str, first: int, last: int, *, is_too_old: bool = True) -> Loss:
    return Loss(f"lsu/v1/demo/measurement/{name}", BOOT, first, last, is_too_old)


def test_each_loss_is_told_once_and_at_most_once_a_second() -> None:
    lost = LostMessages()
    assert lost.take_news(0) is None
    lost.record([loss("s1", 3, 9), loss("s2", 3, 3), loss("s1", 20, 29, is_too_old=False)], 0)
    text, about = lost.take_news(0) or ("", {})
    assert text == (
        "given up: 8 message(s) waited for too long in the queue: 7 of measurement/s1 (numbers 3 to 9), "
        "1 of measurement/s2 (numbers 3 to 3); "
        "10 message(s) are not to be had any more: 10 of measurement/s1 (numbers 20 to 29)"
    )
    assert about == {"count": 18, "measurement/s1": "3-9, 20-29", "measurement/s2": "3-3"}
    assert (lost.count, lost.too_old, lost.never_came) == (18, 8, 10)
    lost.record([loss("s1", 30, 30)], 1)
    assert lost.take_news(SECOND - 1) is None
    assert (lost.take_news(SECOND) or ("", {}))[1] == {"count": 1, "measurement/s1": "30-30"}
    assert lost.take_news(9 * SECOND) is None


def test_it_stands_in_the_health_for_some_seconds() -> None:
    lost = LostMessages()
    assert lost.complaint(0) is None
    lost.record([loss("s1", 0, 4)], SECOND)
    words = "5 message(s) so far are given up, last: 5 of measurement/s1 (numbers 0 to 4)"
    assert lost.complaint(SECOND + REMEMBERED_NS - 1) == words
    assert lost.complaint(SECOND + REMEMBERED_NS) is None


def test_many_streams_fit_into_one_event() -> None:
    lost = LostMessages()
    lost.record([loss(f"s{one}", 2 * n, 2 * n) for one in range(100) for n in range(500)], 0)
    text, about = lost.take_news(0) or ("", {})
    assert text.endswith("and of 96 more")
    assert len(text) < 4096
    assert len(about) <= 64
    assert all(len(str(words)) <= 1000 for words in about.values())
