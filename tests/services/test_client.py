"""The client: times exactly, steps exactly, what is refused before it is sent, streams, and why nobody answers."""

from __future__ import annotations

import asyncio
import itertools
import threading
import time
from datetime import UTC, datetime, timedelta, timezone
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lsu_mesh_services.client import (
    Estimate,
    MeshError,
    Model,
    NoMesh,
    NotAllowed,
    Settings,
    Source,
    Stream,
    WrongValue,
    common_name,
    connect,
    moment,
)
from lsu_mesh_services.network.certificate_authority import Authority
from ports import free_port

from lsu_mesh.mesh.admission import Admission
from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.grid import Grid
from lsu_mesh.mesh.messages import Measurement
from lsu_mesh.mesh.model_answer import encode_model, model_answer

NS = 10**9
EXACT = [
    (1_700_000_000, 1_700_000_000 * NS),
    ("1700000000.123456789", 1_700_000_000_123_456_789),
    (" 1.7e9 ", 1_700_000_000 * NS),
    (Decimal("1700000000.000000001"), 1_700_000_000_000_000_001),
    (Fraction(1, 4), 250_000_000),
    (datetime(2024, 5, 1, 12, 0, 0, 250_001, tzinfo=UTC), 1_714_564_800_250_001_000),
    (datetime(2024, 5, 1, 14, tzinfo=timezone(timedelta(hours=2))), 1_714_564_800 * NS),
    ("2024-05-01T12:00:00Z", 1_714_564_800 * NS),
    ("2024-05-01 14:00:00.123456789+02:00", 1_714_564_800_123_456_789),
    ("2024-05-01T12:00Z", 1_714_564_800 * NS),
]


@pytest.mark.parametrize(("given_time", "ns"), EXACT, ids=lambda value: str(value))
def test_a_time_that_is_written_exactly_is_taken_exactly(given_time: Any, ns: int) -> None:
    assert moment(given_time) == (ns, 0)


@given(st.floats(min_value=0, max_value=9e9, allow_nan=False))
def test_a_float_is_known_to_half_of_its_spacing(seconds: float) -> None:
    ns, error_ns = moment(seconds)
    exact = Fraction(seconds) * NS
    spacing = Fraction(np.spacing(seconds)) * NS
    assert ns - error_ns <= exact - spacing / 2
    assert exact + spacing / 2 <= ns + error_ns
    assert error_ns <= spacing / 2 + 2


@given(st.decimals(min_value=0, max_value=9_000_000_000, places=12))
def test_what_is_rounded_to_a_nanosecond_is_not_known_to_that(seconds: Decimal) -> None:
    ns, error_ns = moment(str(seconds))
    exact = Fraction(seconds) * NS
    assert abs(exact - ns) <= error_ns <= 1
    assert (error_ns == 0) == (exact.denominator == 1)


def test_now_is_now() -> None:
    before = time.time_ns()
    ns, error_ns = moment("now")
    assert before <= ns <= time.time_ns()
    assert error_ns == 0


@pytest.mark.parametrize(
    ("wrong", "remedy"),
    [
        (1_700_000_000_000_000_000, "time_ns"), (-1, "seconds"), (float("nan"), "expected seconds"), (True, "no time"),
        ("soon", "2024-05-01T12:00:00Z"), ("2024-05-01T12:00:00", "Z or +02:00"), ("nan", "expected"),
        (datetime(2024, 5, 1), "time zone"), ("2024-13-01T12:00:00Z", "expected"), ([1], "expected seconds"),
        ("1_000", "expected"), ("Infinity", "expected"),
    ],
)  # fmt: skip
def test_what_is_no_time_is_refused_with_the_remedy(wrong: Any, remedy: str) -> None:
    with pytest.raises(WrongValue, match="time") as refusal:
        moment(wrong)
    assert remedy in str(refusal.value)


@given(
    st.integers(0, 2 * 10**18), st.fractions(min_value=Fraction(1, 1000), max_value=100, max_denominator=1000),
    st.integers(-5, 10**6), st.integers(-2, 2),
)  # fmt: skip
def test_an_input_is_of_the_step_in_which_it_begins(start: int, dt: Fraction, k: int, off: int) -> None:
    answer = {"model": "m", "dt": float(dt), "dt_exact": str(dt), "start_ns": start, "sensors": {}, "B": None}
    model, grid = Model.read(answer), Grid(start, dt)
    at = grid.time_of(k) + off
    found = model.step_within(at)
    assert grid.time_of(found) <= at < grid.time_of(found + 1)
    assert model.time_of(k) == grid.time_of(k)


MESH = """
[mesh]
name = "lab"
dt = 0.1
start_time = 1700000000
[model]
continuous = true
A = [[-1.0]]
B = [[1.0, 0.5]]
rho = [0.1]
[model.prior]
lower = [0.0]
upper = [1.0]
[model.input_box]
lower = [-1.0, -1.0]
upper = [1.0, 1.0]
[plant]
name = "arm"
source = "external"
[sensors.gps]
source = "external"
time_error = "2ms"
outputs = ["x", "y"]
C = [[1.0], [2.0]]
r = [0.1, 0.1]
[sensors.log]
source = "external"
C = [[1.0]]
r = [0.1]
[filters.main]
kind = "LSUO"
sensors = ["gps", "log"]
"""


class Line:
    """A mesh and a session, as far as a source uses them; keeps what is put."""

    def __init__(self, file: Path) -> None:
        file.write_text(MESH)
        self.configuration = load(file)
        self.answer: dict[str, Any] = msgpack.unpackb(encode_model(model_answer(self.configuration)))
        self.name = "lab"
        self.sent: list[tuple[str, bytes]] = []
        self.declared: list[str] = []

    def model(self) -> Model:
        return Model.read(self.answer)

    def key(self, topic: str, name: str) -> str:
        return f"lsu/v1/lab/{topic}/{name}"

    def declare_publisher(self, session: object, key: str) -> Any:
        self.declared.append(key)

        def put(payload: bytes, encoding: str) -> None:
            self.sent.append((key, payload))

        return SimpleNamespace(put=put, undeclare=lambda: None)

    def liveliness(self) -> Any:
        return SimpleNamespace(declare_token=self.declared.append)

    def source(self, role: str, name: str) -> Source:
        line: Any = self
        return Source(line, line, role, name=name)


@pytest.fixture
def line(tmp_path: Path) -> Line:
    return Line(tmp_path / "mesh.toml")


def test_what_a_sensor_sends_is_admitted_at_its_step(line: Line) -> None:
    gps = line.source("sensor", "gps")
    gps.publish([1, None], time="1700000000.25", time_error="0.001")
    gps.publish({"y": Decimal("2.5")}, time=1700000000.3)
    gps.publish(np.array([1.0, 2.0]), time_ns=1_700_000_001_000_000_001)
    admission = Admission(line.configuration, ("measurement",))
    found = [admission.admit(key, payload) for key, payload in line.sent]
    assert admission.refused.total() == 0, admission.last_refusal
    assert all(isinstance(message, Measurement) for message in found)
    assert [message.step for message in found if message is not None] == [3, 3, 11]
    messages: list[Any] = found
    assert [message.y for message in messages] == [[1.0, None], [None, 2.5], [1.0, 2.0]]
    spacing_ns = 120
    assert [message.time_error_ns for message in messages] == [3_000_000, 2_000_000 + spacing_ns, 2_000_000]
    assert [message.seq for message in messages] == [0, 1, 2]
    assert gps.counters == {"published": 3}


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (1.0, "found 1 value(s), expected 2: x, y"), ([1.0, 2.0, 3.0], "expected 2"), ([1.0, float("nan")], "y = nan"),
        ([float("inf"), 1.0], "x = inf"), ({"z": 1.0}, "no output 'z'; its outputs: x, y"), ([True, 1.0], "x = True"),
        (["1.0", 1.0], "x = '1.0'"), ([10**400, 1.0], "finite number"), (None, "found 1 value(s)"),
    ],
)  # fmt: skip
def test_what_the_mesh_would_refuse_is_not_sent(line: Line, values: Any, words: str) -> None:
    gps = line.source("sensor", "gps")
    with pytest.raises(WrongValue) as refusal:
        gps.publish(values)
    assert words in str(refusal.value)
    assert line.sent == []
    assert gps.counters == {"refused": 1}


def test_unknown_and_simulated_sources_are_named(line: Line) -> None:
    with pytest.raises(WrongValue, match="no sensor 'gsp'; its sensors: gps, log"):
        line.source("sensor", "gsp")
    with pytest.raises(NotAllowed, match="this is 'arm'"):
        line.source("plant", "plant")
    del line.answer["sensors"]["gps"]["source"]
    with pytest.raises(NotAllowed, match="'simulated'"):
        line.source("sensor", "gps")
    assert line.declared == []


def test_an_input_goes_to_the_step_that_it_begins_in(line: Line) -> None:
    arm = line.source("plant", "arm")
    for at in ("1700000000.3", "1700000000.35", "1700000000.05"):
        arm.publish([1.0, -1.0], time=at)
    found = [msgpack.unpackb(payload) for _, payload in line.sent]
    assert [(one["step"], one["time_ns"] % NS) for one in found] == [(3, 300_000_000), (3, 350_000_000)]
    with pytest.raises(WrongValue, match="expected a finite number"):
        arm.publish([None, 1.0])


def test_a_mesh_without_times_wants_steps(line: Line) -> None:
    line.answer["start_ns"] = None
    gps = line.source("sensor", "gps")
    with pytest.raises(WrongValue, match="step="):
        gps.publish([1.0, 2.0])
    gps.publish([1.0, 2.0], step=7)
    found = msgpack.unpackb(line.sent[-1][1])
    assert (found["step"], found["time_error_ns"]) == (7, None)


def test_a_mesh_that_began_anew_is_followed_and_what_was_cached_for_the_other_is_forgotten(line: Line) -> None:
    gps = line.source("sensor", "gps")
    gps.publish([1.0, 2.0])
    line.answer["model"] = "f" * 16
    gps.publish([1.0, 2.0])
    assert [msgpack.unpackb(payload)["model"] for _, payload in line.sent] == [line.configuration.digest(), "f" * 16]
    key = "lsu/v1/lab/measurement/gps"
    assert line.declared == ["lsu/v1/lab/live/gps", key, key]


def test_health_is_admitted(line: Line) -> None:
    gps = line.source("sensor", "gps")
    gps.publish([1.0, 2.0], time=1700000001)
    gps.publish_health(line.model(), 2, ["nobody answers"])
    admission = Admission(line.configuration, ("health",))
    message: Any = admission.admit(*line.sent[-1])
    assert message is not None, admission.last_refusal
    assert (message.role, message.level, message.step) == ("sensor", "WARN", 10)
    assert message.counters == {"published": 1.0, "links": 2.0}


def test_a_slow_program_keeps_the_newest_and_counts_what_it_lost() -> None:
    stream: Stream[int] = Stream(3)
    for number in range(5):
        stream.put(number)
    stream.close()
    assert list(stream) == [2, 3, 4]
    assert stream.dropped == 2
    assert stream.next(0) is None


def test_async_iteration_is_woken_from_another_thread() -> None:
    stream: Stream[int] = Stream(8)

    def send() -> None:
        for number in range(3):
            time.sleep(0.02)
            stream.put(number)
        stream.close()

    async def take() -> list[int]:
        return [one async for one in stream]

    sender = threading.Thread(target=send)
    sender.start()
    assert asyncio.run(take()) == [0, 1, 2]
    sender.join()


def test_an_estimate_gives_arrays_on_request() -> None:
    support = {"type": "zonotope", "center": [0.5], "generators": [[1.0, 2.0]]}
    estimate = Estimate(
        name="main", step=1, time_ns=None, lower=[-2.5], upper=[3.5], point=[0.5], status="ok", guarantee="declared",
        support=support, raw={},
    )  # fmt: skip
    found = estimate.numpy()
    assert found.support["generators"].shape == (1, 2)
    assert found.lower.tolist() == [-2.5]
    assert found.support["type"] == "zonotope"
    assert isinstance(estimate.lower, list)


def test_the_file_tells_where_the_mesh_is(tmp_path: Path) -> None:
    file = tmp_path / "mesh.toml"
    file.write_text('[mesh]\nname = "lab"\n[network]\nconnect = ["tls/h:1"]\n[network.tls]\nenabled = true\n')
    settings = Settings.read(file)
    assert (settings.mesh, settings.connect) == ("lab", ("tls/127.0.0.1:7447", "tls/h:1"))
    assert settings.file("key", "gps") == tmp_path / "keys" / "gps.key"
    for text in ("[mesh", "[mesh]\n", "mesh = 1\n"):
        file.write_text(text)
        with pytest.raises(MeshError, match=r"mesh\.toml: is no configuration"):
            Settings.read(file)
    with pytest.raises(MeshError, match="which mesh"):
        connect()


def test_nobody_there_is_told_within_a_second_and_raised_in_the_end() -> None:
    told: list[tuple[float, str]] = []
    entry, began = f"tcp/127.0.0.1:{free_port()}", time.monotonic()

    def tell(words: str) -> None:
        told.append((time.monotonic() - began, words))

    with connect(name="lab", entry=entry, wait=1.5, tell=tell) as mesh, pytest.raises(NoMesh) as silence:
        mesh.sensor("gps")
    assert f"nobody answers lsu/v1/lab/model, trying {entry}" in str(silence.value)
    assert "refused" in str(silence.value)
    assert told[0][0] < 1.0
    assert len(told) == 1, "the same is told once"


def test_a_name_of_a_host_that_is_not_known_is_told() -> None:
    with connect(name="lab", entry="tcp/no-such-host.invalid:7447", wait=0.1) as mesh, pytest.raises(NoMesh) as silence:
        mesh.model()
    assert "no-such-host.invalid: name not known" in str(silence.value)


@pytest.fixture
def secured(tmp_path: Path) -> Settings:
    """Files of a mesh with TLS, where the certificate of gps is that of s1."""
    (tmp_path / "keys").mkdir()
    keys = tmp_path / "keys"
    authority = Authority.new("lab", 2, keys / "ca.pem", keys / "ca.key")
    authority.issue("s1", ("localhost",), 2, keys / "gps.pem", keys / "gps.key")
    return Settings("lab", ("tls/127.0.0.1:7447",), tls={"enabled": True}, folder=tmp_path, wait=0.1)


def test_a_certificate_says_whose_it_is(secured: Settings) -> None:
    assert common_name(secured.file("certificate", "gps")) == "s1"


def test_what_a_certificate_does_not_allow_is_told_before_anything_is_sent(secured: Settings) -> None:
    from lsu_mesh_services.client import Mesh

    with Mesh(secured) as mesh:
        with pytest.raises(NotAllowed, match="certificate of 's1', which may publish as 's1' and nobody else"):
            mesh.sensor("gps")
        with pytest.raises(NotAllowed, match=r"there is no file .*viewer\.pem for 'viewer'"):
            mesh.estimates("main")


def test_streams_of_a_mesh_end_when_it_is_left() -> None:
    mesh = connect(name="lab", entry=f"tcp/127.0.0.1:{free_port()}")
    estimates, events = mesh.estimates("main"), mesh.events()
    threading.Timer(0.2, mesh.close).start()
    assert list(itertools.islice(estimates, 3)) == []
    assert events.next(5) is None
    with pytest.raises(NoMesh, match="left it"):
        mesh.model()
