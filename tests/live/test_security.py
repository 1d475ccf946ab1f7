"""Who has no certificate stays out, and who has one can do what its role needs and nothing else: real sessions."""

from __future__ import annotations

import dataclasses
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from lsu_mesh_services.bus import Bus, Clock, SessionSettings
from lsu_mesh_services.commands.keys import make_files
from lsu_mesh_services.network.certificate_authority import LOOPBACK_HOSTS, Authority
from lsu_mesh_services.network.security import certificates
from ports import free_port
from waiting import WITHIN, until

from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.keys import key, last_key, model_key

pytestmark = pytest.mark.live

Open = Callable[..., Bus]
QUIET = 0.4
"""Seconds without a message after which none is under way any more."""
WORDS = "application/octet-stream"


@pytest.fixture(scope="module")
def secured(demo: Path, tmp_path_factory: pytest.TempPathFactory) -> Configuration:
    """The demo with TLS, and its files."""
    file = tmp_path_factory.mktemp("secured") / "mesh.toml"
    shutil.copy(demo, file)
    configuration = load(file, ["network.tls.enabled=true"])
    make_files(configuration, LOOPBACK_HOSTS, days=2)
    return configuration


@pytest.fixture
def sessions() -> Iterator[Callable[[SessionSettings], Bus]]:
    """Sessions that are closed at the end, the newest first."""
    opened: list[Bus] = []

    def begin(settings: SessionSettings) -> Bus:
        opened.append(Bus(settings, Clock()))
        return opened[-1]

    yield begin
    for bus in reversed(opened):
        bus.close()


@pytest.fixture
def endpoint() -> str:
    return f"tls/127.0.0.1:{free_port()}"


@pytest.fixture
def enter(
    secured: Configuration, sessions: Callable[[SessionSettings], Bus], endpoint: str, request: pytest.FixtureRequest
) -> Open:
    """A session with the certificate of a name; the first one listens, the others connect to it."""
    is_controlled = getattr(request, "param", True)

    def begin(name: str, *, listen: bool = False, mode: str = "peer") -> Bus:
        files = certificates(secured, name)
        assert files is not None
        if not is_controlled:
            files = dataclasses.replace(files, access_control=None)
        own = (endpoint,) if listen else () if mode == "client" else ("tls/127.0.0.1:0",)
        return sessions(SessionSettings(() if listen else (endpoint,), own, mode=mode, certificates=files))

    return begin


def came(bus: Bus, *expected: str) -> set[str]:
    """Keys of all that came, once the expected ones have, and then nothing for a while."""
    keys: set[str] = set()
    end = time.monotonic() + WITHIN
    while not keys >= set(expected):
        assert time.monotonic() < end, f"did not come: {set(expected) - keys}; came: {keys}"
        arrival = bus.next(0.1)
        keys |= set() if arrival is None else {arrival.key}
    while (arrival := bus.next(QUIET)) is not None:
        keys.add(arrival.key)
    return keys


def demo_key(topic: str, name: str) -> str:
    return key("demo", topic, name)


def test_without_a_certificate_of_the_mesh_nobody_connects(
    secured: Configuration, enter: Open, sessions: Callable[[SessionSettings], Bus], endpoint: str, tmp_path: Path
) -> None:
    recorder = enter("recorder", listen=True)
    recorder.subscribe("lsu/v1/demo/measurement/*")
    own = certificates(secured, "s1")
    assert own is not None
    foreign = Authority.new("other", 2, tmp_path / "ca.pem", tmp_path / "ca.key")
    foreign.issue("s1", LOOPBACK_HOSTS, 2, tmp_path / "s1.pem", tmp_path / "s1.key")
    stranger = dataclasses.replace(own, certificate=tmp_path / "s1.pem", key=tmp_path / "s1.key")
    knows_authority = (f'transport/link/tls/root_ca_certificate="{own.authority}"',)
    intruders = [
        sessions(SessionSettings((endpoint.replace("tls/", "tcp/"),))),
        sessions(SessionSettings((endpoint,), zenoh=knows_authority)),
        sessions(SessionSettings((endpoint,), ("tls/127.0.0.1:0",), certificates=stranger)),
    ]
    for intruder in intruders:
        intruder.subscribe("lsu/v1/demo/**")
        intruder.publish(demo_key("measurement", "s1"), b"intruder", WORDS)
    sensor = enter("s1")
    until(lambda: sensor.links() == 1 and recorder.links() == 1, "the sensor is connected")
    sensor.publish(demo_key("measurement", "s1"), b"sensor", WORDS)
    arrival = recorder.next(WITHIN)
    assert arrival is not None
    assert arrival.payload == b"sensor"
    assert recorder.next(QUIET) is None
    assert [intruder.links() for intruder in intruders] == [0, 0, 0]
    for intruder in intruders:
        while (heard := intruder.next(0)) is not None:
            assert heard.payload == b"intruder", "it hears itself at the most"


OF_OTHERS = [
    ("measurement", "s2"), ("posterior", "box"), ("posterior", "s1"), ("prediction", "box"), ("fused", "main"),
    ("fused", "s1"), ("truth", "plant"), ("input", "plant"), ("health", "box"), ("health", "s2"), ("event", "main"),
]  # fmt: skip
OWN = [("measurement", "s1"), ("health", "s1"), ("event", "s1")]


def publish_all(sensor: Bus) -> None:
    """What a sensor may not say, and then what it may."""
    for topic, name in [*OF_OTHERS, *OWN]:
        sensor.publish(demo_key(topic, name), b"said by s1", WORDS)


@pytest.mark.parametrize("enter", [True, False], indirect=True, ids=["controlled", "not controlled"])
def test_a_sensor_publishes_its_own_keys_and_nothing_else(enter: Open, request: pytest.FixtureRequest) -> None:
    recorder = enter("recorder", listen=True)
    for topic in ("measurement", "posterior", "prediction", "fused", "truth", "input", "health", "event"):
        recorder.subscribe(f"lsu/v1/demo/{topic}/*")
    sensor = enter("s1")
    until(lambda: sensor.links() == 1, "connected")
    publish_all(sensor)
    expected = {demo_key(*own) for own in OWN}
    if "not controlled" in request.node.name:
        expected |= {demo_key(*other) for other in OF_OTHERS}
    assert came(recorder, *expected) == expected


def test_a_router_lets_through_what_the_certificates_allow_and_nothing_else(enter: Open) -> None:
    enter("router", listen=True, mode="router")
    recorder = enter("recorder", mode="client")
    for topic in ("measurement", "posterior", "health", "event"):
        recorder.subscribe(f"lsu/v1/demo/{topic}/*")
    sensor = enter("s1", mode="client")
    until(lambda: recorder.links() == 1 and sensor.links() == 1, "both are connected to the router")
    publish_all(sensor)
    expected = {demo_key(*own) for own in OWN}
    assert came(recorder, *expected) == expected


@pytest.mark.parametrize("enter", [True, False], indirect=True, ids=["controlled", "not controlled"])
def test_a_sensor_reads_the_truth_that_it_measures_and_nothing_else(
    enter: Open, request: pytest.FixtureRequest
) -> None:
    plant = enter("plant", listen=True)
    box = enter("box")
    sensor, recorder = enter("s1"), enter("recorder")
    for bus in (sensor, recorder):
        for topic in ("truth", "input", "measurement", "posterior", "health"):
            bus.subscribe(f"lsu/v1/demo/{topic}/*")
            bus.subscribe(demo_key(topic, "box" if topic == "posterior" else "plant"))
    until(lambda: all(bus.links() == 3 for bus in (plant, box, sensor, recorder)), "all are connected")
    sensor.watch_alive("lsu/v1/demo/live/*")
    box.publish(demo_key("posterior", "box"), b"a set", WORDS)
    box.declare_alive(demo_key("live", "box"))
    plant.publish(demo_key("input", "plant"), b"u", WORDS)
    plant.publish(demo_key("truth", "plant"), b"x", WORDS)
    unreadable = {demo_key("input", "plant"), demo_key("posterior", "box")}
    readable = {demo_key("truth", "plant")}
    assert came(recorder, *unreadable, *readable) == unreadable | readable
    expected = readable | {demo_key("live", "box")}
    if "not controlled" in request.node.name:
        expected |= unreadable
    assert came(sensor, *expected) == expected


@pytest.mark.parametrize(
    ("name", "is_told"), [("s1", False), ("box", True), ("cz", False), ("viewer", True)], ids=lambda value: str(value)
)
def test_the_last_set_of_a_filter_is_told_to_that_filter_and_to_readers(enter: Open, name: str, is_told: bool) -> None:
    fusion = enter("main", listen=True)
    fusion.answer(last_key("demo", "box"), lambda: (last_key("demo", "box"), b"the last set", WORDS))
    fusion.answer(model_key("demo"), lambda: (model_key("demo"), b"the model", WORDS))
    asking = enter(name)
    until(lambda: asking.links() == 1, "connected")
    asking.ask(last_key("demo", "box"))
    asking.ask(model_key("demo"))
    expected = {model_key("demo"), *([last_key("demo", "box")] if is_told else [])}
    assert came(asking, *expected) == expected


def test_readers_publish_nothing(enter: Open) -> None:
    recorder = enter("recorder", listen=True)
    for topic in ("measurement", "posterior", "health"):
        recorder.subscribe(f"lsu/v1/demo/{topic}/*")
    viewer, sensor = enter("viewer"), enter("s1")
    until(lambda: recorder.links() == 2 and viewer.links() == 2, "connected")
    for topic, name in (("measurement", "s2"), ("posterior", "box"), ("health", "viewer")):
        viewer.publish(demo_key(topic, name), b"said by a reader", WORDS)
    sensor.publish(demo_key("measurement", "s1"), b"said by s1", WORDS)
    own = demo_key("measurement", "s1")
    assert came(recorder, own) == {own}


def test_a_whole_mesh_runs_over_mutual_tls_with_access_control(start, demo: Path, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    shutil.copy(demo, tmp_path / "mesh.toml")
    made = start("keys", "init", "mesh.toml")
    assert made.wait() == 0, made.output[1]
    endpoint = f"tls/127.0.0.1:{free_port()}"
    session = start(
        "run", "mesh.toml", "--json", "--steps", "60", "--record", "secure.rrd", "-X", "network.tls.enabled=true",
        "-X", "network.entry={endpoint}", endpoint=endpoint,
    )  # fmt: skip
    assert session.wait() == 0, session.output[1]
    rows = session.of("estimator")
    assert {row["name"] for row in rows} == {"box", "para", "cz", "main"}
    for row in rows:
        assert (row["steps"], row["inside"], row["gaps"], row["refused"]) == (60, 1.0, 0, 0), row
        assert row["inconsistent"] == 0
