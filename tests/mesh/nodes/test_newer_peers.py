"""Peers of earlier and later releases in one mesh: the sets are the same, and who knows less says what it ignored."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgpack
import msgspec
import pytest
from local_mesh import LocalMesh

from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.messages import TYPES, Health, Message, Posterior, encode
from lsu_mesh.mesh.nodes.filter import FilterNode
from lsu_mesh.mesh.nodes.node import SECOND

LATER = {
    "input": {"time_ns"},
    "measurement": {"time_error_ns"},
    "prediction": {"base", "used", "bounds", "missing", "algorithm"},
    "posterior": {"gain_of", "point_rule", "algorithm", "mean", "covariance"},
    "fused": {"gain_of", "point_rule", "algorithm", "mean", "covariance"},
    "health": {"started_ns", "host"},
}
"""Fields that the first peers of version 1 do not send."""


def newer(message: Message) -> bytes:
    """The payload of a peer of a later release."""
    fields: dict[str, Any] = msgpack.unpackb(encode(message))
    fields["colour"] = "red"
    if "support" in fields:
        fields["support"]["shade"] = [0.5]
    return msgpack.packb(fields)


def older(message: Message) -> bytes:
    """The payload of a peer of the first release."""
    fields: dict[str, Any] = msgpack.unpackb(encode(message))
    return msgpack.packb({name: value for name, value in fields.items() if name not in LATER.get(message.topic, set())})


WRITERS = {"newer": newer, "older": older}


class MixedMesh(LocalMesh):
    """Some of its peers are of another release."""

    releases: dict[str, str] = {}  # noqa: RUF012

    def publish(self, node: Any, messages: Any) -> None:
        write = WRITERS.get(self.releases.get(node.name, ""), encode)
        for message in messages:
            self.sent.append((node.key(message), message))
            self.hand_over(node.key(message), write(message))


def sets(mesh: LocalMesh) -> list[tuple[Any, ...]]:
    """Every set that was published, to the last bit."""
    found = [m for _, m in mesh.sent if isinstance(m, Posterior)]
    return [(m.src, m.step, m.revision, m.status, msgspec.to_builtins(m.support), m.lower, m.upper) for m in found]


def ran(demo: Path, releases: dict[str, str]) -> MixedMesh:
    mesh = MixedMesh(load(demo, ["mesh.steps=30", "filters.box.transfer=predictor"]))
    mesh.releases = releases
    mesh.run(1.0)
    return mesh


@pytest.fixture(scope="module")
def alike(demo: Path) -> MixedMesh:
    return ran(demo, {})


@pytest.mark.parametrize(
    "releases",
    [
        {"s1": "newer"},
        {"s1": "older", "plant": "older"},
        {"cz": "newer", "para": "older", "plant": "newer", "s2": "older"},
        dict.fromkeys(["s1", "s2", "s3", "plant", "box", "para", "cz", "main"], "newer"),
        dict.fromkeys(["s1", "s2", "s3", "plant", "box", "para", "cz", "main"], "older"),
    ],
    ids=["a newer sensor", "an older sensor and plant", "mixed", "all newer", "all older"],
)
def test_the_sets_of_a_mesh_of_several_releases_are_the_same(
    demo: Path, alike: MixedMesh, releases: dict[str, str]
) -> None:
    mesh = ran(demo, releases)
    assert len(sets(alike)) >= 4 * 30
    assert sets(mesh) == sets(alike)
    for node in mesh.nodes.values():
        assert node.admission.refused == {}
        heard = {name for _, name in node.subscriptions()}
        is_told = any(release == "newer" and name in heard for name, release in releases.items())
        assert (node.admission.with_unknown_fields > 0) == is_told, node.name


def test_an_ignored_field_is_counted_in_the_health_and_is_no_complaint(demo: Path) -> None:
    mesh = ran(demo, {"s1": "newer"})
    node = mesh.nodes["para"]
    health = node.health(mesh.now)
    assert health.counters["unknown fields"] == 30
    assert health.counters["unknown fields.measurement.colour"] == 30
    assert (health.level, health.reasons) == ("OK", [])
    assert "unknown fields" not in mesh.nodes["cz"].health(mesh.now).counters, "it does not listen to s1"


def test_older_is_older_and_newer_is_newer() -> None:
    for topic, names in LATER.items():
        optional = {field.name for field in msgspec.structs.fields(TYPES[topic]) if not field.required}
        assert names <= optional


def test_start_and_host_are_told_where_the_service_gives_them(demo: Path) -> None:
    node = FilterNode(load(demo), "box", "1" * 16)
    silent = node.health(SECOND)
    assert isinstance(silent, Health)
    assert (silent.started_ns, silent.host) == (None, None)
    node.started_ns, node.host = 5, "lab-1"
    told = node.health(2 * SECOND)
    assert (told.started_ns, told.host) == (5, "lab-1")
