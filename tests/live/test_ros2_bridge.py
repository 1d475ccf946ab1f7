"""What a node of ROS 2, in plain zenoh, gets from a running mesh: the graph's tokens, points, diagnostics."""

from __future__ import annotations

import json
import queue
import time
from collections.abc import Callable, Iterator
from typing import Any

import msgpack
import pytest
import zenoh
from lsu_mesh_services.bus import Bus, Clock, SessionSettings
from ports import free_port
from ros_messages import STORE

from lsu_mesh.mesh.ros2.attachment import decode_attachment
from lsu_mesh.mesh.ros2.encoder import gid_of

pytestmark = pytest.mark.live

Start = Callable[..., Any]
POINT, ARRAY = "geometry_msgs/msg/PointStamped", "diagnostic_msgs/msg/DiagnosticArray"
DDS = {
    POINT: "geometry_msgs::msg::dds_::PointStamped_",
    ARRAY: "diagnostic_msgs::msg::dds_::DiagnosticArray_",
}
PUBLISH = '[{ estimator = "main", topic = "/estimate", states = ["x1", "x3"], frame_id = "lab" }]'
STEPS = 400


def opened(*listen: str, connect: str = "", mode: str = "peer") -> Any:
    configuration = zenoh.Config()
    for name, value in (
        ("mode", mode), ("listen/endpoints", listen), ("connect/endpoints", [connect] if connect else []),
        ("scouting/multicast/enabled", False),
    ):  # fmt: skip
        configuration.insert_json5(name, json.dumps(value))
    return zenoh.open(configuration)


@pytest.fixture
def router() -> Iterator[str]:
    """Where a router listens, as rmw_zenohd does."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with opened(endpoint, mode="router"):
        yield endpoint


def key(topic: str, type_name: str) -> str:
    return f"0/{topic}/{DDS[type_name]}/{STORE.hash_rihs01(type_name)}"


def until(condition: Callable[[], bool], within_s: float = 60.0) -> None:
    end = time.monotonic() + within_s
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_estimates_and_health_reach_ros2(start: Start, router: str, demo: Any) -> None:
    entry = f"tcp/127.0.0.1:{free_port()}"
    options = ("-X", f'network.entry="{entry}"', "-X", f'network.ros2.connect=["{router}"]')
    options += ("-X", f"network.ros2.publish={PUBLISH}", "-c", str(demo))
    came: queue.Queue[tuple[str, bytes, bytes]] = queue.Queue()
    with opened("tcp/127.0.0.1:0", connect=router) as session:
        for topic, type_name in (("estimate", POINT), ("diagnostics", ARRAY)):
            session.declare_subscriber(
                key(topic, type_name),
                lambda sample, t=type_name: came.put((t, sample.payload.to_bytes(), sample.attachment.to_bytes())),
            )
        start("bridge", "ros2", *options)

        shown: list[str] = []

        def tokens() -> list[str]:
            replies = session.liveliness().get("@ros2_lv/0/**", timeout=1.0)
            return sorted(str(reply.ok.key_expr) for reply in replies if reply.ok is not None)

        until(lambda: len(found := tokens()) == 3 and not shown.extend(found))
        node, *publishers = sorted(shown, key=lambda token: "/NN/" not in token)
        zid = node.split("/")[2]
        assert node == f"@ros2_lv/0/{zid}/0/0/NN/%/%/lsu_mesh_bridge"
        begin, hashes = f"@ros2_lv/0/{zid}/0", {one: STORE.hash_rihs01(one) for one in DDS}
        assert publishers == [
            f"{begin}/1/MP/%/%/lsu_mesh_bridge/%estimate/{DDS[POINT]}/{hashes[POINT]}/::,10:,:,:,,",
            f"{begin}/2/MP/%/%/lsu_mesh_bridge/%diagnostics/{DDS[ARRAY]}/{hashes[ARRAY]}/::,10:,:,:,,",
        ]
        gids = dict(zip((POINT, ARRAY), map(gid_of, publishers), strict=True))
        with Bus(SessionSettings(connect=(entry,), cache=10**4), Clock()) as bus:
            bus.subscribe("lsu/v1/demo/fused/main")
            arguments = ("--steps", str(STEPS), "--no-record", "-X", f'network.entry="{entry}"')
            run = start("run", str(demo), "--json", *arguments)
            assert run.wait(120) == 0, run.output
            fused: dict[int, list[list[float]]] = {}
            while (arrival := bus.next(1.0)) is not None:
                if arrival.what == "sample":
                    message = msgpack.unpackb(arrival.payload)
                    fused.setdefault(message["step"], []).append(message["point"])
        check(came, fused, gids)


def check(came: queue.Queue[tuple[str, bytes, bytes]], fused: dict[int, Any], gids: dict[str, bytes]) -> None:
    """Points are those of the mesh at the times of their steps; numbers count; diagnostics name the estimator."""
    sequences: dict[str, list[int]] = {POINT: [], ARRAY: []}
    steps, levels = [], set()
    while not came.empty():
        type_name, data, attached = came.get()
        attachment = decode_attachment(attached)
        assert attachment is not None
        assert attachment.gid == gids[type_name]
        sequences[type_name].append(attachment.sequence)
        message: Any = STORE.deserialize_cdr(data, type_name)
        if type_name == ARRAY:
            (status,) = message.status
            levels.add(int(status.level))
            assert status.name == "lsu_mesh: demo/fusion/main"
            continue
        assert message.header.frame_id == "lab"
        time_ns = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        step, rest = divmod(time_ns, 20_000_000)
        assert rest == 0
        steps.append(step)
        point = message.point
        assert [point.x, point.y, point.z] in [[x[0], x[2], 0.0] for x in fused[step]]
    assert steps == sorted(steps)
    assert len(set(steps)) > STEPS / 2
    assert steps[-1] == STEPS
    for numbers in sequences.values():
        assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    assert 0 in levels
