"""What is told to ROS 2, read back by rosbags; the identifier of a publisher; which sets are told."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import pytest
from lsu_mesh_services.configuration import DEMO
from ros_messages import STORE

from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.message_examples import example
from lsu_mesh.mesh.messages import Fused, OrthotopeMessage
from lsu_mesh.mesh.observer import PeerHealth
from lsu_mesh.mesh.ros2.decoder import types_of
from lsu_mesh.mesh.ros2.encoder import DIAGNOSTICS, POINT, Encoder, Status, gid_of, is_tellable
from lsu_mesh.mesh.ros2_telling import Ros2Telling

TIME_NS = 1_764_468_000_123_456_789


@pytest.mark.parametrize("distro", ["humble", "jazzy"])
def test_a_point(distro: Any) -> None:
    data = Encoder(types_of(distro)).point(TIME_NS, "map", [1.5, -2.25])
    found: Any = STORE.deserialize_cdr(data, POINT)
    assert (found.header.stamp.sec, found.header.stamp.nanosec) == divmod(TIME_NS, 10**9)
    assert (found.header.frame_id, found.point.x, found.point.y, found.point.z) == ("map", 1.5, -2.25, 0.0)


def test_diagnostics() -> None:
    statuses = [Status("STALE", "a", "gone; late", "host", {"x lower": "1.0"}), Status("OK", "b", "fine", "", {})]
    found: Any = STORE.deserialize_cdr(Encoder(STORE).diagnostics(TIME_NS, statuses), DIAGNOSTICS)
    assert [(int(one.level), one.name, one.message, one.hardware_id) for one in found.status] == [
        (3, "a", "gone; late", "host"),
        (0, "b", "fine", ""),
    ]
    assert [(one.key, one.value) for one in found.status[0].values] == [("x lower", "1.0")]


def test_times_that_no_stamp_can_say() -> None:
    assert is_tellable(0)
    assert is_tellable(2**31 * 10**9 - 1)
    assert not is_tellable(-1)
    assert not is_tellable(2**31 * 10**9)


def test_the_identifier_is_xxh3_of_the_token() -> None:
    # the published test value of XXH3, 128 bits, of "abc": 06b05ab6733a618578af5f94892f3950, low half last
    assert gid_of("abc") == bytes.fromhex("06b05ab6733a618578af5f94892f3950")[::-1]


def telling(tmp_path: Path, publish: str) -> Ros2Telling:
    return Ros2Telling(load(DEMO, [f"network.ros2.publish={publish}"]))


def fused(step: int, boot: str = "0" * 16) -> Fused:
    known = example("fused")
    assert isinstance(known, Fused)
    lower, upper = [-1.0, -2.0, -3.0], [1.5, 2.5, 3.5]
    box = OrthotopeMessage(lower=lower, upper=upper)
    point: dict[str, Any] = {"point": [0.25, 0.5, 0.75], "mean": None, "covariance": None}
    return msgspec.structs.replace(
        known, src="fusion/main", step=step, boot=boot, support=box, lower=lower, upper=upper, **point
    )


def test_only_the_newest_step_is_told(tmp_path: Path) -> None:
    one = telling(tmp_path, '[{ estimator = "main", topic = "/e", states = ["x2"] }]')
    assert one.addresses == [("fused", "main")]
    assert one.topics == [("/e", POINT), ("/diagnostics", DIAGNOSTICS)]
    newest = fused(5)
    (told,) = one.receive(newest)
    found: Any = STORE.deserialize_cdr(told.payload, told.type)
    assert (told.topic, found.point.x, found.point.y) == ("/e", newest.point[1], 0.0)
    assert found.header.stamp.nanosec == 100_000_000
    assert one.receive(fused(4)) == [], "late data made it again"
    assert len(one.receive(fused(5))) == 1, "another revision"
    assert len(one.receive(fused(1, boot="1" * 16))) == 1, "started again"


def test_diagnostics_hold_the_newest_bounds(tmp_path: Path) -> None:
    one = telling(tmp_path, '[{ estimator = "main", topic = "/e", states = ["x2"] }]')
    newest = fused(5)
    one.receive(newest)
    (told,) = one.diagnostics([PeerHealth("main", "fusion", "WARN", ("behind",), host="h")], TIME_NS)
    (status,) = STORE.deserialize_cdr(told.payload, told.type).status  # type: ignore[attr-defined]
    values = {pair.key: pair.value for pair in status.values}
    assert (int(status.level), status.message, status.hardware_id) == (1, "behind", "h")
    assert values["x1 lower"] == repr(newest.lower[0])
    assert values["x3 upper"] == repr(newest.upper[2])
    assert values["guarantee"] == newest.guarantee
    silent = telling(tmp_path, '[{ estimator = "main", topic = "/e", states = ["x2"], diagnostics = false }]')
    assert silent.diagnostics([PeerHealth("main", "fusion", "OK")], TIME_NS) == []
    assert silent.topics == [("/e", POINT)]
