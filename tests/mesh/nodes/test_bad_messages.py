"""No message hurts a peer: random bytes, wrong shapes, monstrous numbers, old and foreign ones, times to come."""

from __future__ import annotations

import gc
import itertools
import math
import os
import time
import tracemalloc
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import psutil
import pytest
from garbage_collections import Collections
from hypothesis import given, settings
from hypothesis import strategies as st

from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.estimation.step_arrivals import FURTHEST
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.message_examples import example
from lsu_mesh.mesh.messages import MAX_PAYLOAD, TYPES, Message, Reference, Refused, decode, encode
from lsu_mesh.mesh.nodes.estimator import Estimator
from lsu_mesh.mesh.nodes.filter import FilterNode
from lsu_mesh.mesh.nodes.fusion import FusionNode
from lsu_mesh.mesh.nodes.node import SECOND, Node
from lsu_mesh.mesh.nodes.plant import PlantNode
from lsu_mesh.mesh.nodes.schedule import Schedule
from lsu_mesh.mesh.nodes.sensor import SimulatedSensorNode
from lsu_mesh.mesh.simulator.recorder import RecorderSink

ROOT = Path(__file__).resolve().parents[3]
MAX_AGE_NS = 10_000_000
"""Of the thread's processor time, per message."""
FUZZED = int(os.environ.get("LSU_MESH_FUZZED", "1000000"))
"""Messages per decoder and node in the full run."""
MONSTERS = [
    math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324, 0, -1, 2**63, 2**64 - 1, -(2**63), True, None, "", "x" * 5000,
    b"\x00", [], [[]], {}, {"type": "orthotope"}, [math.nan], [1e308] * 3, [[1e308] * 3] * 3, [0.0] * 5000,
    "🜁", "a/b", "../..", 10**18,
]  # fmt: skip
few = settings(max_examples=60, deadline=None)
plain = (
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats()
    | st.text(max_size=8)
    | st.binary(max_size=8)
)
anything = st.recursive(
    plain, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=6), inner, max_size=4)
)


def fields_of(topic: str) -> dict[str, Any]:
    """The plain map of an example."""
    fields: dict[str, Any] = msgpack.unpackb(encode(example(topic)))
    return fields


def decoded_in_time(topic: str, payload: bytes) -> Message | None:
    """The message, or None where it is refused; nothing else may happen, and not for long."""
    began = time.thread_time_ns()
    try:
        return decode(topic, payload)
    except Refused:
        return None
    finally:
        assert time.thread_time_ns() - began < MAX_AGE_NS


@pytest.mark.parametrize("topic", TYPES)
@few
@given(payload=st.binary(max_size=200))
def test_random_bytes_are_refused(topic: str, payload: bytes) -> None:
    assert decoded_in_time(topic, payload) is None


@pytest.mark.parametrize("topic", TYPES)
@few
@given(data=st.data())
def test_maps_with_strange_values_are_refused_or_sound(topic: str, data: st.DataObject) -> None:
    fields = fields_of(topic)
    for name in data.draw(st.lists(st.sampled_from(sorted(fields)), min_size=1, max_size=3)):
        fields[name] = data.draw(anything | st.sampled_from(MONSTERS))
    message = decoded_in_time(topic, msgpack.packb(fields))
    if message is not None:
        assert decode(topic, encode(message)) == message


@pytest.mark.parametrize("topic", TYPES)
@few
@given(data=st.data())
def test_flipped_and_cut_payloads_are_refused_or_sound(topic: str, data: st.DataObject) -> None:
    payload = bytearray(encode(example(topic)))
    for _ in range(data.draw(st.integers(1, 3))):
        payload[data.draw(st.integers(0, len(payload) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    decoded_in_time(topic, bytes(payload[: data.draw(st.integers(0, len(payload)))]))


@pytest.mark.parametrize(
    "payload",
    [
        b"\x91" * 100_000,  # lists in lists
        b"\x81\xa1v" * 50_000,  # maps in maps
        b"\xdd\x06\x00\x00\x00",  # a list that claims 100 million entries
        b"\xc6\x06\x40\x00\x00" + b"x" * 10,  # bytes that claim 100 MB
        b"\xdb\x06\x40\x00\x00",  # text that claims 100 MB
        b"\xdf\x06\x00\x00\x00\xa1v\x01",  # a map that claims 100 million entries
        b"\x00" * (MAX_PAYLOAD + 1),
        b"",
    ],
    ids=["deep lists", "deep maps", "list claim", "bytes claim", "text claim", "map claim", "too large", "empty"],
)
def test_monstrous_claims_cost_nothing(payload: bytes) -> None:
    tracemalloc.start()
    try:
        for topic in TYPES:
            assert decoded_in_time(topic, payload) is None
        assert tracemalloc.get_traced_memory()[1] < 4 * len(payload) + 2**20
    finally:
        tracemalloc.stop()


# -- nodes


def configuration_of(*overrides: str) -> Configuration:
    """The demo with every kind of filter, endless."""
    kinds = ("bundle", "LSUPB"), ("zono", "ZonotopicKalman"), ("taker", "LSUO")
    more = [f'filters.{name}={{kind="{kind}", sensors=["s1", "s2"]}}' for name, kind in kinds]
    names = ["box", "para", "cz", *(name for name, _ in kinds)]
    given_ = [*more, 'filters.taker.transfer="predictor"', f"fusion.main.sources={names}", *overrides]
    return load(ROOT / "services" / "lsu_mesh_services" / "demo.toml", given_)


class ForgetfulDisk(list[Reference]):
    """What a recorder stores is not in its memory."""

    def __iadd__(self, stored: Iterable[Reference]) -> ForgetfulDisk:  # type: ignore[override]
        return self


def nodes_of(configuration: Configuration) -> list[Node]:
    """One node of each role and kind."""
    boots = (f"{number:016x}" for number in itertools.count(1))
    made: list[Node] = [FilterNode(configuration, name, next(boots)) for name in configuration.filters]
    made += [FusionNode(configuration, name, next(boots)) for name in configuration.fusion]
    made.append(PlantNode(configuration, "plant", next(boots), Schedule(SECOND, 50.0)))
    made += [
        SimulatedSensorNode(configuration, "s1", next(boots)),
        RecorderSink(configuration, "recorder", next(boots), ForgetfulDisk()),
    ]
    return made


def address_of(configuration: Configuration, fields: dict[str, Any], topic: str) -> str:
    """The key that a message's own ``src`` belongs to."""
    return key(configuration.mesh.name, topic, str(fields["src"]).rpartition("/")[2])


SOURCES = {
    "truth": ["plant/plant"], "input": ["plant/plant"], "measurement": ["sensor/s1", "sensor/s2", "sensor/s3"],
    "prediction": ["filter/box", "filter/cz"], "posterior": ["filter/box", "filter/cz", "filter/zono"],
    "fused": ["fusion/main"], "health": ["filter/box"], "event": ["filter/box"],
}  # fmt: skip


class Hostile:
    """Well-formed messages of known peers that say whatever the generator likes."""

    def __init__(self, configuration: Configuration, seed: int) -> None:
        self._configuration = configuration
        self._rng = np.random.default_rng(seed)
        self._old: list[tuple[str, bytes]] = []

    def messages(self, count: int) -> Iterator[tuple[str, bytes]]:
        """Addresses and payloads."""
        for _ in range(count):
            if self._old and self._rng.random() < 0.1:
                yield self._old[int(self._rng.integers(len(self._old)))]
                continue
            topic = list(SOURCES)[int(self._rng.integers(len(SOURCES)))]
            fields = self._fields(topic)
            made = address_of(self._configuration, fields, topic), msgpack.packb(fields)
            self._old = [*self._old[-200:], made]
            yield made

    def _fields(self, topic: str) -> dict[str, Any]:
        rng, fields = self._rng, fields_of(topic)
        fields["src"] = SOURCES[topic][int(rng.integers(len(SOURCES[topic])))]
        fields["model"] = self._configuration.digest()
        fields["boot"] = f"{int(rng.integers(3)) if rng.random() < 0.9 else int(rng.integers(2**40)):016x}"
        fields["seq"] = int(rng.integers(10_000)) if rng.random() < 0.95 else int(rng.integers(2**62))
        fields["step"] = int(rng.integers(1, 400)) if rng.random() < 0.95 else int(rng.integers(2**62))
        fields["sent_ns"] = fields["origin_ns"] = int(rng.integers(2**62))
        self._fill(fields)
        return fields

    def _fill(self, fields: dict[str, Any]) -> None:
        """Numbers of the right shape and of any size."""
        n, scale = 3, float(10.0 ** self._rng.choice([-300, -3, 0, 1, 5, 150, 307]))
        box = np.sort(scale * np.clip(self._rng.normal(size=(2, n)), -9, 9), axis=0)
        values = {"x": box[0], "u": box[0, :1], "y": box[0, :1], "lower": box[0], "upper": box[1], "point": box[0]}
        for name, value in values.items():
            if name in fields:
                fields[name] = value.tolist()
        if "support" in fields:
            fields["support"] = self._support(box)
            fields["epoch"] = int(self._rng.integers(3))
        if "y_lower" in fields:
            fields["y_lower"], fields["y_upper"] = box[0].tolist(), box[1].tolist()
            fields["y_point"] = box[0].tolist()

    def _support(self, box: np.ndarray) -> dict[str, Any]:
        kind = self._rng.integers(4)
        lower, upper = box.tolist()
        columns = int(self._rng.choice([0, 1, 3, 8, 500]))
        generators = (np.ones((3, columns)) * box[1, :1]).tolist()
        if kind == 0:
            return {"type": "orthotope", "lower": lower, "upper": upper}
        if kind == 1:
            return {"type": "parallelotope", "center": lower, "generators": np.diag(box[1]).tolist()}
        if kind == 2:
            return {"type": "zonotope", "center": lower, "generators": generators}
        A, b = np.ones((2, columns)).tolist(), box[0, :2].tolist()
        return {"type": "constrained_zonotope", "center": lower, "generators": generators, "A": A, "b": b}


def assault(configuration: Configuration, node: Node, seed: int, count: int) -> list[int]:
    """Processor time of each delivery, in nanoseconds, without garbage collections; ticks in between.

    Each seed begins after the one before, if that had the same count.
    """
    now, times, collections = (2 + seed * (1 + count // 400)) * SECOND, [], Collections()
    for number, (address, payload) in enumerate(Hostile(configuration, seed).messages(count)):
        before, began = collections.took_ns, time.thread_time_ns()
        said = node.deliver(address, payload, now)
        times.append(time.thread_time_ns() - began - (collections.took_ns - before))
        if number % 8 == 0:
            now += SECOND // 50
            said = [*said, *node.tick(now)]
        for message in said:
            decode(message.topic, encode(message))
    collections.end()
    return times


def node_ids() -> list[str]:
    return [f"{node.role}-{node.name}" for node in nodes_of(configuration_of())]


@pytest.mark.parametrize("number", range(len(node_ids())), ids=node_ids())
def test_hostile_messages_neither_kill_nor_slow_a_node(number: int) -> None:
    configuration = configuration_of()
    node = nodes_of(configuration)[number]
    node.warm_up()
    times = assault(configuration, node, number, 300)
    assert sorted(times)[-2] < MAX_AGE_NS
    assert node.health(10**12).counters["received"] + node.admission.refused.total() + node.admission.duplicates >= 300


def test_a_set_of_monstrous_complexity_is_refused() -> None:
    configuration = configuration_of()
    fields = fields_of("posterior") | {"model": configuration.digest(), "lower": [0.0] * 3, "upper": [1.0] * 3}
    fields |= {
        "point": [0.0] * 3,
        "mean": None,
        "covariance": None,
        "support": {"type": "zonotope", "center": [0.0] * 3, "generators": [[0.1] * 4000] * 3},
    }
    node = FusionNode(configuration, "main", "f" * 16)
    node.deliver("lsu/v1/demo/posterior/box", msgpack.packb(fields), SECOND)
    assert node.admission.refused == {"complexity": 1}


@pytest.mark.parametrize("role", ["fusion", "filter"])
def test_a_set_that_is_empty_kills_nobody(role: str) -> None:
    configuration = configuration_of()
    nothing = {
        "type": "constrained_zonotope",
        "center": [0.0] * 3,
        "generators": [[0.1], [0.1], [0.1]],
        "A": [[1.0]],
        "b": [9.0],
    }
    fields = fields_of("posterior") | {"model": configuration.digest(), "lower": [-1.0] * 3, "upper": [1.0] * 3}
    fields |= {
        "point": [0.0] * 3,
        "mean": None,
        "covariance": None,
        "support": nothing,
        "step": 9,
        "src": "filter/cz",
        "status": "ok",
    }
    drive = fields_of("input") | {
        "model": configuration.digest(),
        "u": [0.0],
        "step": 9,
        "src": "plant/plant",
        "time_ns": None,
    }
    node = (
        FusionNode(configuration, "main", "f" * 16) if role == "fusion" else FilterNode(configuration, "cz", "f" * 16)
    )
    node.deliver("lsu/v1/demo/input/plant", msgpack.packb(drive), SECOND)
    node.deliver("lsu/v1/demo/posterior/cz", msgpack.packb(fields), SECOND)
    assert node.admission.refused == {}
    for second in range(2, 6):
        node.tick(second * SECOND)
    assert node.last_posterior is None or node.last_posterior.status != "ok"


def measurement(configuration: Configuration, step: int, seq: int) -> bytes:
    own = {"src": "sensor/s1", "step": step, "seq": seq, "y": [0.0], "time_error_ns": None}
    return msgpack.packb(fields_of("measurement") | own | {"model": configuration.digest()})


def test_a_step_behind_the_end_of_the_mesh_is_refused() -> None:
    configuration = configuration_of("mesh.steps=10")
    node = FilterNode(configuration, "box", "f" * 16)
    node.deliver("lsu/v1/demo/measurement/s1", measurement(configuration, 12, 0), SECOND)
    assert node.admission.refused == {"step": 1}


def test_a_step_from_the_future_does_not_make_the_present_late(tmp_path: Path) -> None:
    file = tmp_path / "mesh.toml"
    text = (ROOT / "services" / "lsu_mesh_services" / "demo.toml").read_text().replace("steps = 600\n", "")
    file.write_text(text.replace("B = [[0.1], [0.6], [0.3]]\n", "").replace('inputs = "normal"\n', ""))
    configuration = load(file)
    node = FilterNode(configuration, "para", "f" * 16)
    sent = itertools.count()
    for step in (1, 2, 3, 2**40, 4, 5):
        node.deliver(
            "lsu/v1/demo/measurement/s1", measurement(configuration, step, next(sent)), step % 2**20 * SECOND // 50
        )
        node.tick(step % 2**20 * SECOND // 50)
    assert isinstance(node, Estimator)
    assert node.current == 6
    assert node.counters()["from the future"] == 1
    far = 5 + FURTHEST
    node.deliver("lsu/v1/demo/measurement/s1", measurement(configuration, far, next(sent)), SECOND)
    node.tick(2 * SECOND)
    assert 6 < node.current <= far, "what may be true is believed, in bounded time"


@pytest.mark.soak
@pytest.mark.timeout(20_000)
@pytest.mark.parametrize("number", range(len(node_ids())), ids=node_ids())
def test_a_million_hostile_messages_per_node(number: int) -> None:
    configuration = configuration_of()
    node = nodes_of(configuration)[number]
    node.warm_up()
    gc.collect()
    gc.freeze()  # as a peer does
    assault(configuration, node, 0, FUZZED // 100)
    process = psutil.Process()
    before = process.memory_info().rss
    slowest = max(max(assault(configuration, node, seed, FUZZED // 100)) for seed in range(1, 101))
    grown = process.memory_info().rss - before
    gc.unfreeze()
    print(
        f"{node.role} {node.name}: {FUZZED:,} messages, slowest {slowest * 1e-6:.2f} ms of processor time, "
        f"memory grew by {grown / 2**20:.1f} MiB",
        flush=True,
    )
    assert slowest < MAX_AGE_NS
    assert grown < 100 * 2**20


@pytest.mark.soak
@pytest.mark.timeout(20_000)
@pytest.mark.parametrize("topic", TYPES)
def test_a_million_broken_payloads_per_decoder(topic: str) -> None:
    rng = np.random.default_rng(0)
    valid = encode(example(topic))
    process = psutil.Process()
    before, slowest, sound = process.memory_info().rss, 0, 0
    for _ in range(FUZZED):
        payload = bytearray(valid)
        payload[int(rng.integers(len(payload)))] = int(rng.integers(256))
        broken = bytes(payload[: int(rng.integers(len(payload) + 1))] if rng.random() < 0.3 else payload)
        began = time.thread_time_ns()
        sound += decoded_in_time(topic, broken) is not None
        slowest = max(slowest, time.thread_time_ns() - began)
    grown = process.memory_info().rss - before
    print(
        f"decoder of {topic}: {FUZZED:,} payloads, {sound} of them sound, slowest {slowest * 1e-6:.2f} ms of "
        f"processor time, memory grew by {grown / 2**20:.1f} MiB",
        flush=True,
    )
    assert grown < 100 * 2**20
