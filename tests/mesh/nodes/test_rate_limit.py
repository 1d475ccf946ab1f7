"""A late source catches up so slowly that what it publishes is still kept when links are back."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.messages import Measurement, Truth
from lsu_mesh.mesh.nodes.file_sensor import FileSensorNode
from lsu_mesh.mesh.nodes.node import SECOND
from lsu_mesh.mesh.nodes.plant import PlantNode
from lsu_mesh.mesh.nodes.rate_limit import HURRY, MAX_SETTLING_NS, SETTLING_NS, RateLimit
from lsu_mesh.mesh.nodes.schedule import Schedule

RATE, KEPT = 50.0, 300
BACK_S = 1.5
"""Links are back after so long, at the latest."""


def published(
    pace: RateLimit, late: int, seconds: float, links: dict[float, int] | None = None
) -> list[tuple[int, int]]:
    """Times and steps of a source that is so many steps late at time 0, and is told when to go on.

    ``links``: how many connections there are from a second on.
    """
    now, behind, out = 10 * SECOND, float(late), []
    begin, end = now, now + int(seconds * SECOND)
    changes = sorted((begin + int(at * SECOND), count) for at, count in (links or {}).items())
    while now < end:
        while changes and changes[0][0] <= now:
            pace.record_links(changes.pop(0)[1], now)
        steps = pace.take(int(behind), now)
        behind -= steps
        out += [(now - begin, steps)] if steps else []
        later = max(pace.ready_at(), now + 1_000_000)
        behind += (later - now) * RATE / SECOND
        now = later
    return out


def test_a_source_in_time_never_waits() -> None:
    pace = RateLimit(RATE, KEPT)
    for k in range(2000):
        now = int(k / RATE * SECOND)
        assert pace.take(1, now) == 1
        assert pace.ready_at() == 0


@pytest.mark.parametrize("late", [500, 5000])
def test_what_goes_out_before_links_are_back_is_kept(late: int) -> None:
    out = published(RateLimit(RATE, KEPT), late, BACK_S)
    assert KEPT // 3 <= sum(steps for _, steps in out) <= KEPT


@pytest.mark.parametrize("back", [0.5, 1.5, 2.4])
def test_it_does_not_hurry_before_links_are_back_for_a_moment(back: float) -> None:
    """The first that was sent without links must be kept until those who missed it have asked: it takes a second."""
    pace = RateLimit(RATE, KEPT)
    pace.record_links(5, 0)
    pace.take(1, 0)
    out = published(pace, 500, 20.0, links={0.1: 4, back: 5})
    assert sum(steps for at, steps in out if at <= (back + 0.9) * SECOND) <= KEPT
    assert sum(steps for _, steps in out) >= 500 + 19.0 * RATE, "it gets there"


def test_a_peer_that_has_left_does_not_hold_a_source_up() -> None:
    pace = RateLimit(RATE, KEPT)
    pace.record_links(5, 0)
    pace.take(1, 0)
    out = published(pace, 500, 20.0, links={0.1: 4})
    assert sum(steps for at, steps in out if at <= MAX_SETTLING_NS) <= KEPT
    assert sum(steps for _, steps in out) >= 500 + 19.0 * RATE


def test_a_source_that_is_late_by_less_than_it_may_send_at_once_is_in_time_at_once() -> None:
    out = published(RateLimit(RATE, KEPT), KEPT // 3, 0.01)
    assert out[0] == (0, KEPT // 3)


def test_then_it_hurries_and_gets_there() -> None:
    late = 500
    out = published(RateLimit(RATE, KEPT), late, 20.0)
    in_time = next(at for at, _ in out if sum(s for t, s in out if t <= at) >= late + at * RATE / SECOND - 1)
    expected = SETTLING_NS / SECOND + (late - KEPT // 3) / ((HURRY - 1) * RATE)
    assert in_time / SECOND == pytest.approx(expected, rel=0.05)


def test_a_time_that_it_names_is_one_at_which_a_step_may_go_out() -> None:
    pace = RateLimit(RATE, KEPT)
    now = 0
    for _ in range(500):
        pace.take(1000, now)
        at = pace.ready_at()
        assert at > now
        assert pace.take(1, at - 1000) == 0
        now = at
        assert pace.take(1, now) == 1


def test_a_plant_whose_machine_stood_still_publishes_every_step_but_not_at_once(demo: Path) -> None:
    configuration = load(demo, ("mesh.steps=2000", f"mesh.rate={RATE}"))
    node = PlantNode(configuration, "plant", "0" * 16, Schedule(0, RATE))
    steps = [m.step for m in node.tick(SECOND) if isinstance(m, Truth)]
    now, at_once = 11 * SECOND, 0
    while steps[-1] < math.floor(now * RATE / SECOND):
        out = [m.step for m in node.tick(now) if isinstance(m, Truth)]
        at_once += len(out) if now < (11 + BACK_S) * SECOND else 0
        steps += out
        wakeup = node.wakeup()
        assert wakeup is not None
        now = max(wakeup, now + 500_000)
    assert steps == list(range(1, steps[-1] + 1))
    assert at_once <= configuration.cached
    assert now < 17 * SECOND


def test_a_sensor_that_plays_a_file_and_starts_late_begins_with_what_it_would_still_keep(
    demo: Path, tmp_path: Path
) -> None:
    (tmp_path / "s1.csv").write_text("step,y\n" + "".join(f"{k},{k}.5\n" for k in range(1, 2001)))
    text = demo.read_text().replace("C = [[1.0, 0.0, 0.5]]", 'C = [[1.0, 0.0, 0.5]]\nfile = "s1.csv"', 1)
    (tmp_path / "mesh.toml").write_text(text)
    configuration = load(tmp_path / "mesh.toml", (f"mesh.rate={RATE}", "mesh.steps=2000"))
    node = FileSensorNode(configuration, "s1", "0" * 16, Schedule(0, RATE))
    assert next(m for m in node.tick(0) if isinstance(m, Measurement)).step == 1, "in time it begins at the begin"
    late = FileSensorNode(configuration, "s1", "1" * 16, Schedule(0, RATE))
    now, due, out = 20 * SECOND, 1001, []
    for _ in range(1000):
        out += [m for m in late.tick(now) if isinstance(m, Measurement)]
        wakeup = late.wakeup()
        assert wakeup is not None
        now = max(wakeup, now + 500_000)
    assert [m.step for m in out[:3]] == [due - configuration.cached + k for k in (1, 2, 3)]
    assert [m.step for m in out] == list(range(out[0].step, out[-1].step + 1))
    assert [m.y for m in out] == [[m.step + 0.5] for m in out]
    assert out[-1].step >= now * RATE / SECOND - 1, "it catches up"
