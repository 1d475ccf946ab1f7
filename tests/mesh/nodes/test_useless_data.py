"""A source whose data are all late, all early or all of one step is named, with seconds and remedy, and heals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import pytest

from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.messages import Event, Health, Measurement, Message, Posterior, Refused, encode
from lsu_mesh.mesh.nodes.filter import FilterNode
from lsu_mesh.mesh.nodes.useless_data import USED_AGAIN, USELESS, UselessData

S = 10**9
MakeMesh = Callable[..., Any]
RATE = 50
START = 1_764_468_000 * S


def at(seconds: float) -> int:
    return round(seconds * S)


@pytest.fixture
def useless() -> UselessData:
    return UselessData({"gps": "sensor", "imu": "sensor", "box": "filter"}, rate=10.0, history=("history", 32))


def test_a_late_source_is_named_after_a_second_with_the_median_of_its_delay(useless: UselessData) -> None:
    for k, steps in enumerate([52, 50, 90, 48, 50, 51, 50, 49, 50, 50, 50]):
        useless.record_off("gps", steps, at(100 + 0.1 * k))
        if k < 10:
            assert useless.complaints(at(100 + 0.1 * k)) == []
    (text,) = useless.complaints(at(101.1))
    assert text == (
        "sensor gps: all data of the last 1.0 s are 5.00 s too late and not used; set the clock of its host, or start "
        "it with the start of the mesh, or raise history (now 32 steps, 3.2 s)"
    )
    (news,) = useless.take_news(at(101.1))
    assert (news.code, news.source, news.reason, news.seconds) == (USELESS, "gps", "late", 5.0)
    assert useless.take_news(at(101.2)) == [], "once"
    assert useless.counters == {"not used.gps.late": 11}


def test_one_datum_of_use_ends_it_at_once(useless: UselessData) -> None:
    for k in range(12):
        useless.record_off("gps", 50, at(100 + 0.1 * k))
    useless.take_news(at(101.2))
    useless.record_used("gps")
    assert useless.complaints(at(101.3)) == []
    assert [news.code for news in useless.take_news(at(101.3))] == [USED_AGAIN]


def test_a_source_that_is_late_now_and_then_or_for_a_moment_is_well(useless: UselessData) -> None:
    for k in range(100):
        useless.record_off("gps", 50, at(100 + 0.1 * k))
        if k % 8 == 0:
            useless.record_used("gps")
        useless.record_off("imu", 50, at(100 + 0.001 * k))  # what comes at once after an outage
        assert useless.complaints(at(100 + 0.1 * k)) == []
    assert useless.take_news(at(110)) == []


def test_a_source_of_one_datum_a_second_is_named_with_the_second_one(useless: UselessData) -> None:
    useless.record_off("gps", -36000, at(100))
    useless.record_off("gps", -36000, at(101))
    (text,) = useless.complaints(at(101))
    assert "3,600 s too early" in text


def test_it_is_told_no_longer_of_a_source_that_has_fallen_silent(useless: UselessData) -> None:
    for k in range(12):
        useless.record_off("gps", 50, at(100 + 0.1 * k))
    assert useless.complaints(at(104.0))
    assert useless.complaints(at(104.2)) == []


def test_refusals_are_told_with_the_option_that_caused_them(useless: UselessData) -> None:
    for k in range(12):
        useless.record_refused(Refused("future", "x", source="gps", seconds=-7.5), at(100 + 0.1 * k))
        useless.record_refused(Refused("past", "x", source="imu", seconds=3600.0), at(100 + 0.1 * k))
        useless.record_refused(Refused("shape", "x"), at(100 + 0.1 * k))
        useless.record_refused(Refused("past", "x", source="nobody", seconds=1.0), at(100 + 0.1 * k))
    gps, imu = useless.complaints(at(101.2))
    assert "7.50 s too early" in gps
    assert gps.endswith("or raise [mesh] future")
    assert "3,600 s too late" in imu
    assert imu.endswith("or raise [mesh] past")
    assert useless.counters == {"not used.gps.future": 12, "not used.imu.past": 12}


def test_data_that_are_all_of_one_step_are_told_whether_they_are_used_or_not(useless: UselessData) -> None:
    for k in range(12):
        useless.record_step("gps", 17, at(100 + 0.1 * k))
        useless.record_used("gps")
    (text,) = useless.complaints(at(101.2))
    assert "are of step 17" in text
    assert "stands still" in text
    useless.take_news(at(101.2))
    useless.record_step("gps", 18, at(101.3))
    assert useless.complaints(at(101.3)) == []
    assert [news.code for news in useless.take_news(at(101.3))] == [USED_AGAIN]


def test_many_data_of_one_long_step_are_well() -> None:
    slow = UselessData({"gps": "sensor"}, rate=0.5, history=("history", 32))
    for k in range(200):
        slow.record_step("gps", k // 20, at(100 + 0.1 * k))
        assert slow.complaints(at(100 + 0.1 * k)) == []


def test_a_filter_whose_sets_are_late_is_told_to_the_fusion_with_its_own_option(useless: UselessData) -> None:
    for k in range(12):
        useless.record_off("box", 50, at(100 + 0.1 * k))
    (text,) = useless.complaints(at(101.2))
    assert text.startswith("filter box: all sets of the last")
    assert text.endswith("raise history (now 32 steps, 3.2 s)")


OWN = """
[mesh]
name = "own"
dt = 0.1
[model]
A = [[1.0]]
noise_map = [[1.0]]
rho = [2.0]
[model.prior]
lower = [-10.0]
upper = [10.0]
[sensors.gauge]
source = "external"
C = [[1.0]]
r = [0.5]
[filters.box]
kind = "LSUO"
sensors = ["gauge"]
"""


# -- in whole meshes: what used to be silent


def shifted(mesh: Any, sensor: str, steps: Callable[[int], int]) -> None:
    """The filters get what a sensor sends with another step number."""
    send = mesh.publish

    def publish(node: Any, messages: Any) -> None:
        if node.name != sensor:
            return send(node, messages)
        for message in messages:
            if not isinstance(message, Measurement):
                send(node, [message])
                continue
            step = steps(message.step)
            time_ns = max(0, mesh.configuration.grid.time_of(step))
            payload = encode(msgspec.structs.replace(message, step=step, time_ns=time_ns))
            for other in list(mesh.nodes.values()):
                if ("measurement", sensor) in other.subscriptions():
                    send(other, other.deliver(node.key(message), payload, mesh.now))
        return None

    mesh.publish = publish


def health_of(mesh: Any, name: str) -> Health:
    found: Health = mesh.nodes[name].health(mesh.now)
    return found


def news_of(mesh: Any, code: str) -> list[Event]:
    return [message for _, message in mesh.sent if isinstance(message, Event) and message.code == code]


def posteriors(mesh: Any, name: str) -> list[Posterior]:
    return [message for _, message in mesh.sent if isinstance(message, Posterior) and message.src == f"filter/{name}"]


@pytest.mark.parametrize(
    ("moved", "words", "seconds"),
    [
        pytest.param(lambda k: k - 250, "5.00 s too late", 5.0, id="the clock of its host is 5 s behind"),
        pytest.param(lambda k: k + 10**10, "s too early", None, id="it counts steps by the wall clock"),
        pytest.param(lambda k: 400, "are of step 400", None, id="its counter stands still"),
    ],
)
def test_a_sensor_whose_data_are_of_no_use_is_named_within_two_seconds_and_heals(
    mesh_of: MakeMesh, moved: Callable[[int], int], words: str, seconds: float | None
) -> None:
    mesh = mesh_of("mesh.steps=1000000000000", "filters.cz.deadline=20ms")
    wrong = [False]
    shifted(mesh, "s3", lambda k: moved(k) if wrong[0] else k)
    mesh.run(8.0, tick_ms=20)
    assert not any("s3" in reason for reason in health_of(mesh, "cz").reasons)
    wrong[0], began = True, mesh.now
    mesh.run(2.0, tick_ms=20)
    health = health_of(mesh, "cz")
    assert health.level == "WARN"
    (text,) = [reason for reason in health.reasons if reason.startswith("sensor s3")]
    assert words in text
    assert "s3" in posteriors(mesh, "cz")[-1].missing
    event = next(event for event in news_of(mesh, USELESS) if event.src == "filter/cz")
    assert event.sent_ns <= began + 2 * S
    assert event.about["source"] == "s3"
    if seconds is not None:
        assert event.about["seconds"] == pytest.approx(seconds, abs=0.05)
    wrong[0] = False
    mesh.run(0.5, tick_ms=20)
    reasons = health_of(mesh, "cz").reasons
    assert not any("sensor s3" in reason for reason in reasons), reasons
    assert [event for event in news_of(mesh, USED_AGAIN) if event.src == "filter/cz"]


def test_a_sensor_that_is_restarted_and_counts_from_one_is_named(configuration_of_one: Configuration) -> None:
    """The only sensor of a filter: 20 measurements, no posterior, and the health was OK."""
    node = FilterNode(configuration_of_one, "box", "f" * 16)
    address, digest = key("demo", "measurement", "s1"), configuration_of_one.digest()
    told: list[Any] = []

    def send(boot: str, seq: int, step: int, now: int) -> None:
        message = Measurement(
            v=1, src="sensor/s1", boot=boot * 16, seq=seq, step=step, sent_ns=now, origin_ns=now, model=digest,
            y=[0.0], time_ns=0,
        )  # fmt: skip
        told.extend([*node.deliver(address, encode(message), now), *node.tick(now)])

    for k in range(1, 301):
        send("a", k, k, at(100 + k / 10))
    told.clear()
    for k in range(1, 21):
        send("b", k, k, at(131 + k / 10))
    assert not [one for one in told if isinstance(one, Posterior)]
    (event,) = [one for one in told if isinstance(one, Event) and one.code == USELESS]
    assert event.sent_ns <= at(131.1 + 1.2)
    newest = [one for one in told if isinstance(one, Health)][-1]
    assert any("sensor s1: all data" in reason and "start of the mesh" in reason for reason in newest.reasons)
    assert node.health(at(133.1)).counters["not used.s1.late"] == 20


@pytest.fixture
def configuration_of_one(demo: Path) -> Configuration:
    """The demo with a filter of one sensor, and without inputs that a filter would wait for."""
    configuration = load(demo, ["mesh.rate=10", "mesh.steps=100000", "model.input_box={lower=[-5], upper=[5]}"])
    box = replace(configuration.filters["box"], sensors=("s1",), deadline=0.0)
    return replace(configuration, filters={**configuration.filters, "box": box})


@pytest.mark.parametrize(("hours", "side", "option"), [(1, "early", "future"), (-1, "late", "past")])
def test_an_external_sensor_whose_clock_is_wrong_by_an_hour_is_named_and_heals(
    own: Configuration, hours: int, side: str, option: str
) -> None:
    node = FilterNode(own, "box", "f" * 16)
    address, digest = key("own", "measurement", "gauge"), own.digest()
    told: list[Message] = []

    def send(seq: int, now: int, wrong_ns: int = 0) -> None:
        message = Measurement(
            v=1, src="sensor/gauge", boot="a" * 16, seq=seq, step=0, sent_ns=now + wrong_ns, origin_ns=now + wrong_ns,
            model=digest, y=[0.0], time_ns=now + wrong_ns,
            time_error_ns=0,
        )  # fmt: skip
        told.extend([*node.deliver(address, encode(message), now), *node.tick(now)])

    for k in range(1, 31):
        send(k, START + k * S // 10)
    told.clear()
    for k in range(31, 51):
        send(k, START + k * S // 10, hours * 3600 * S)
    (event,) = [one for one in told if isinstance(one, Event) and one.code == USELESS]
    assert event.sent_ns <= START + (31 + 20) * S // 10
    (text,) = [one for one in node.health(START + 5 * S).reasons if one.startswith("sensor gauge: ")]
    assert f"3,600 s too {side} and not used; set the clock of its host" in text
    assert text.endswith(f"or raise [mesh] {option}")
    assert node.health(START + 5 * S).counters[f"not used.gauge.{option}"] == 20
    told.clear()
    send(51, START + 51 * S // 10)
    send(52, START + 52 * S // 10)
    assert [one for one in told if isinstance(one, Event) and one.code == USED_AGAIN]
    assert [one for one in told if isinstance(one, Posterior) and "gauge" not in one.missing]


@pytest.fixture
def own(tmp_path: Path) -> Configuration:
    """A mesh with one sensor of one's own, that has started."""
    (tmp_path / "mesh.toml").write_text(OWN)
    return load(tmp_path / "mesh.toml").started(START)
