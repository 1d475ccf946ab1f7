"""A sensor that listens to ROS 2, without a network: what it publishes, refuses, counts and complains of."""

from __future__ import annotations

from pathlib import Path

import pytest
from ros_messages import STORE, TIME_NS, nav_sat_fix, payload

from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.messages import Event, Measurement
from lsu_mesh.mesh.nodes.ros2_sensor import Ros2SensorNode
from lsu_mesh.mesh.ros2.attachment import Attachment, encode_attachment
from lsu_mesh.mesh.ros2.graph import Announced

TYPE = "sensor_msgs/msg/NavSatFix"
KEY = f"0/fix/sensor_msgs::msg::dds_::NavSatFix_/{STORE.hash_rihs01(TYPE)}"
SECOND = 10**9
MESH = """
[mesh]
name = "robot"
dt = 0.1
start_time = 1764467999
[model]
continuous = true
A = [[0.0, 1.0], [0.0, 0.0]]
noise_map = [[0.0], [1.0]]
rho = [2.0]
[model.prior]
lower = [-1.0, -1.0]
upper = [1.0, 1.0]
[sensors.gps]
source = "ros2"
topic = "/fix"
type = "sensor_msgs/msg/NavSatFix"
fields = ["latitude", "altitude"]
time_error = "3ms"
C = [[1.0, 0.0], [0.0, 1.0]]
r = [0.5, 0.5]
[filters.main]
kind = "LSUPB"
sensors = ["gps"]
[network.ros2]
"""


def node(folder: Path, text: str = MESH) -> Ros2SensorNode:
    (folder / "mesh.toml").write_text(text)
    return Ros2SensorNode(load(folder / "mesh.toml"), "gps", "0" * 16)


def attached(sequence: int, gid: int = 1) -> bytes:
    return encode_attachment(Attachment(sequence, TIME_NS, bytes([gid]) * 16))


def reasons(one: Ros2SensorNode, now: int) -> list[tuple[str, str]]:
    return [(complaint.level, complaint.text) for complaint in one.complaints(now)]


def test_a_message_becomes_a_measurement_at_its_stamp(tmp_path: Path) -> None:
    one, arrival = node(tmp_path), TIME_NS + 7_000_000
    (found,) = one.take(KEY, payload(nav_sat_fix()), attached(1), arrival)
    assert isinstance(found, Measurement)
    assert (found.step, found.y) == (0, [47.123456789, 401.5])
    assert (found.time_ns, found.time_error_ns, found.sent_ns) == (TIME_NS, 3_000_000, arrival)
    assert one.step() == 12, "1.12 s after t_0"
    (again,) = one.take(KEY, payload(nav_sat_fix(status=-1)), attached(2), arrival)
    assert isinstance(again, Measurement)
    assert (again.y, again.seq) == ([None, None], 1)
    assert one.counters() == {"ros2 received": 2.0}


def test_a_receive_time_is_that_of_the_arrival(tmp_path: Path) -> None:
    one = node(tmp_path, MESH.replace("time_error", 'stamp = "receive"\ntime_error'))
    (found,) = one.take(KEY, payload(nav_sat_fix(sec=0, nanosec=0)), b"", TIME_NS + 5)
    assert isinstance(found, Measurement)
    assert (found.time_ns, found.time_error_ns) == (TIME_NS + 5, 3_000_000)


def test_after_a_standstill_no_receive_time_is_believed(tmp_path: Path) -> None:
    received = node(tmp_path, MESH.replace("time_error", 'stamp = "receive"\ntime_error'))
    stamped = node(tmp_path)
    for one in (received, stamped):
        one.admission.stood_still = True
    (found,) = stamped.take(KEY, payload(nav_sat_fix()), b"", TIME_NS)
    assert isinstance(found, Measurement), "its stamp is right whenever it comes"
    (told,) = received.take(KEY, payload(nav_sat_fix()), b"", TIME_NS)
    assert isinstance(told, Event)
    assert told.about["reason"] == "standstill"
    received.admission.stood_still = False
    (found,) = received.take(KEY, payload(nav_sat_fix()), b"", TIME_NS)
    assert isinstance(found, Measurement)


@pytest.mark.parametrize(
    ("key", "data", "reason", "words"),
    [
        (KEY, b"nonsense", "decoding", "8 bytes are no sensor_msgs/msg/NavSatFix"),
        (KEY, payload(nav_sat_fix(sec=0, nanosec=0)), "stamp", "the sender does not set it"),
        (KEY.replace("NavSatFix_", "Imu_"), b"", "type", "the topic is of type sensor_msgs/msg/Imu, not"),
        (KEY[:-4] + "0000", payload(nav_sat_fix()), "type", "the sender's fields are others"),
    ],
)
def test_what_does_not_fit_is_refused_and_named(tmp_path: Path, key: str, data: bytes, reason: str, words: str) -> None:
    one = node(tmp_path)
    (told,) = one.take(key, data, b"", SECOND)
    assert isinstance(told, Event)
    assert (told.level, told.code, told.about["reason"]) == ("WARN", "ros2-refused", reason)
    assert words in told.text
    assert one.take(key, data, b"", 2 * SECOND) == [], "told once in five seconds"
    assert one.counters() == {"ros2 received": 2.0, f"ros2 refused: {reason}": 2.0}
    levels = [level for level, text in reasons(one, 2 * SECOND) if words in text]
    assert levels == ["ERROR"], "nothing else came"
    assert len(one.take(key, data, b"", 7 * SECOND)) == 1


def test_silence_says_what_is_known(tmp_path: Path) -> None:
    one = node(tmp_path)
    assert reasons(one, SECOND) == []
    one.listening.links = 0
    (level, text), *_ = reasons(one, 4 * SECOND)
    assert level == "WARN"
    assert text == (
        "nothing of /fix for 3.0 s: no link to ROS 2, looked for at tcp/localhost:7447; start rmw_zenohd or the "
        "bridge, or set connect"
    )
    one.listening.links = 1
    (level, text), *_ = reasons(one, 7 * SECOND)
    assert level == "ERROR"
    assert "no publisher of it in domain 0" in text
    one.listening.publishers["token"] = Announced("/receiver", TYPE)
    assert "/receiver is there and sends nothing" in reasons(one, 7 * SECOND)[0][1]
    one.listening.publishers["token"] = Announced("/receiver", "sensor_msgs/msg/Imu")
    assert "its publisher sends sensor_msgs/msg/Imu, not sensor_msgs/msg/NavSatFix" in reasons(one, 7 * SECOND)[0][1]


def test_a_slow_topic_is_not_silent(tmp_path: Path) -> None:
    one = node(tmp_path)
    for i in range(3):
        one.take(KEY, payload(nav_sat_fix()), attached(i + 1), 10 * i * SECOND)
    assert reasons(one, 60 * SECOND) == []
    assert len(reasons(one, 71 * SECOND)) == 1


def test_messages_that_are_missing_between_numbers_are_counted(tmp_path: Path) -> None:
    one, data = node(tmp_path), payload(nav_sat_fix())
    for sequence in (5, 6, 9, 10):
        one.take(KEY, data, attached(sequence), SECOND)
    one.take(KEY, data, attached(1, gid=2), SECOND)
    one.take(KEY, data, attached(1), SECOND)  # it was restarted
    one.take(KEY, data, attached(2), SECOND)
    assert one.counters()["ros2 lost"] == 2.0
    assert ("WARN", "2 message(s) of /fix so far were lost on the way") in reasons(one, SECOND)


def test_two_publishers_are_named(tmp_path: Path) -> None:
    one = node(tmp_path)
    one.listening.publishers |= {"a": Announced("/left", TYPE), "b": Announced("/right", TYPE)}
    assert ("WARN", "2 publishers send /fix: /left, /right") in reasons(one, 0)
