"""Measurements that came over HTTP, on their way to the mesh."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, cast

import pytest
from gateway_mesh import MESH, START_NS
from lsu_mesh_services.bus import Bus, Clock
from lsu_mesh_services.gateway.measurement_request import Reading
from lsu_mesh_services.gateway.publisher import Publisher
from lsu_mesh_services.gateway.refusal import Refusal

from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.messages import Measurement, decode

NOW = START_NS + 60 * 10**9


class Wire:
    """A session that keeps what it is given."""

    def __init__(self, links: int = 1) -> None:
        self.count, self.sent = links, list[tuple[str, bytes, str]]()

    def links(self) -> int:
        return self.count

    def publish(self, key: str, payload: bytes, encoding: str) -> None:
        self.sent.append((key, payload, encoding))


class Stopped:
    """A clock that stands."""

    def now(self) -> int:
        return NOW


def publisher(wire: Wire) -> Publisher:
    return Publisher(cast(Bus, wire), cast(Clock, Stopped()), argparse.Namespace())


def sent(wire: Wire) -> list[Measurement]:
    messages = [decode("measurement", payload) for _, payload, _ in wire.sent]
    return [message for message in messages if isinstance(message, Measurement)]


def test_messages_are_those_of_a_sensor_that_sends_times(configuration: Configuration) -> None:
    wire = Wire()
    one = publisher(wire)
    for k in range(3):
        told = one.publish(configuration, "gauge", Reading([float(k), None], NOW - k, 5))
        assert told.step == 600
    assert [(key, encoding) for key, _, encoding in wire.sent] == [
        ("lsu/v1/lab/measurement/gauge", "application/msgpack;lsu.measurement/1")
    ] * 3
    messages = sent(wire)
    assert [message.seq for message in messages] == [0, 1, 2]
    assert {message.step for message in messages} == {0}, "receivers count it from the time"
    assert [message.time_ns for message in messages] == [NOW, NOW - 1, NOW - 2]
    assert {message.time_error_ns for message in messages} == {5}
    assert {message.model for message in messages} == {configuration.digest()}
    assert len({message.boot for message in messages}) == 1
    assert publisher(wire)._boot != messages[0].boot


def refused(configuration: Configuration, wire: Wire, time_ns: int = NOW, name: str = "gauge") -> Refusal:
    with pytest.raises(Refusal) as found:
        publisher(wire).publish(configuration, name, Reading([1.0, 2.0], time_ns, 0))
    assert wire.sent == []
    return found.value


def test_what_nobody_would_take_is_not_sent(configuration: Configuration, tmp_path: Path) -> None:
    ahead = refused(configuration, Wire(), NOW + 3 * 10**9)
    assert (ahead.status, ahead.key) == (422, "time")
    assert "3 s ahead" in ahead.text
    (tmp_path / "strict.toml").write_text(MESH.replace("past = 1000000000\n", ""))
    behind = refused(load(tmp_path / "strict.toml"), Wire(), NOW - 60 * 10**9)
    assert "60 s behind" in behind.text
    assert refused(configuration, Wire(links=0)).status == 503


def test_before_the_start_is_known_no_time_has_a_step(tmp_path: Path) -> None:
    text = MESH.replace('start_time = "2026-05-01T12:00:00Z"', 'start_time = "now"')
    (tmp_path / "file.csv").write_text("step,y\n1,0.5\n")
    (tmp_path / "mesh.toml").write_text(text)
    refusal = refused(load(tmp_path / "mesh.toml"), Wire())
    assert refusal.status == 503
    assert "no estimator of the mesh has told when it started" in refusal.text


def test_a_discrete_model_takes_no_time_between_its_steps(tmp_path: Path) -> None:
    text = MESH.replace("continuous = true\n", "").replace('time_error = "1ms"\n', "")
    text = text.replace("noise_map = [[0.0], [1.0]]\nrho = [2.0]", "rho = [2.0, 2.0]")
    (tmp_path / "file.csv").write_text("step,y\n1,0.5\n")
    (tmp_path / "mesh.toml").write_text(text)
    configuration: Any = load(tmp_path / "mesh.toml")
    refusal = refused(configuration, Wire(), NOW - 5)
    assert (refusal.status, refusal.key) == (409, "time")
    assert "continuous model" in refusal.text
