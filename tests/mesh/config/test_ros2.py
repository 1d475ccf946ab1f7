"""``source = "ros2"`` and ``[network.ros2]``: what is read, and the mistakes with the nearest names."""

from __future__ import annotations

from pathlib import Path

import pytest

from lsu_mesh.mesh.config import ConfigurationError, load
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.ros2.settings import Ros2Network, Ros2Topic

MESH = """
[mesh]
name = "robot"
dt = 0.1
[model]
continuous = true
A = [[0.0, 1.0], [0.0, 0.0]]
noise_map = [[0.0], [1.0]]
rho = [2.0]
states = ["position", "speed"]
[model.prior]
lower = [-1.0, -1.0]
upper = [1.0, 1.0]
[sensors.gps]
source = "ros2"
topic = "fix"
type = "sensor_msgs/msg/NavSatFix"
fields = ["latitude"]
C = [[1.0, 0.0]]
r = [0.5]
[filters.main]
kind = "LSUPB"
sensors = ["gps"]
[network]
entry = "tcp/127.0.0.1:7448"
[network.ros2]
"""
PUBLISH = 'publish = [{ estimator = "main", topic = "/estimate", states = ["position"] }]'


def read(folder: Path, text: str = MESH) -> Configuration:
    (folder / "mesh.toml").write_text(text)
    return load(folder / "mesh.toml")


def test_a_topic_and_the_defaults_of_its_network(tmp_path: Path) -> None:
    mesh = read(tmp_path)
    sensor = mesh.sensors["gps"]
    assert sensor.source == "ros2"
    assert sensor.is_live
    assert not mesh.is_external("sensor", "gps"), "the mesh starts it"
    assert sensor.ros2 == Ros2Topic("fix", "sensor_msgs/msg/NavSatFix", ("latitude",), "header")
    assert mesh.network.ros2 == Ros2Network()
    assert mesh.network.ros2.connect == ("tcp/localhost:7447",)
    assert mesh.awaits_start
    assert [str(one) for one in mesh.warnings] == []


def test_all_of_a_network(tmp_path: Path) -> None:
    more = 'connect = ["tcp/10.0.0.2:7447"]\nlisten = ["tcp/127.0.0.1:0"]\ndomain_id = 7\ndialect = "ros2dds"\n'
    mesh = read(tmp_path, f'{MESH}{more}namespace = "/bot1"\ndistro = "humble"\n{PUBLISH}')
    found = mesh.network.ros2
    assert (found.connect, found.listen) == (("tcp/10.0.0.2:7447",), ("tcp/127.0.0.1:0",))
    assert (found.domain_id, found.dialect, found.namespace, found.distro) == (7, "ros2dds", "/bot1", "humble")
    (told,) = found.publish
    assert (told.estimator, told.topic, told.states) == ("main", "/estimate", ("position",))
    assert (told.frame_id, told.diagnostics) == ("map", True)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('topic = "fix"\n', ""), 'topic: is missing; source = "ros2" needs'),
        (('type = "sensor_msgs/msg/NavSatFix"\n', ""), "type: is missing"),
        (('fields = ["latitude"]\n', ""), "fields: is missing"),
        (('"fix"', '"7fix"'), '"7fix" is no topic'),
        (('"fix"', '"/a//b"'), "is no topic"),
        (("sensor_msgs/msg/NavSatFix", "NavSatFix"), '"NavSatFix" is no type'),
        (("NavSatFix", "NavSatFixx"), 'did you mean "sensor_msgs/msg/NavSatFix"?'),
        (('["latitude"]', '["lattitude"]'), 'did you mean "latitude"?'),
        (('["latitude"]', '["latitude[0]"]'), "[0] needs a list"),
        (('["latitude"]', '["status"]'), "is no number, it is a sensor_msgs/msg/NavSatStatus"),
        (('["latitude"]', '["status.statu"]'), 'did you mean "status"?'),
        (('["latitude"]', '["header.frame_id"]'), "is no number, it is a string"),
        (('["latitude"]', '["position_covariance[9]"]'), "the list has 9 entries, [0] to [8]"),
        (('["latitude"]', '["lat itude"]'), "is no path"),
        (('["latitude"]', '["latitude", "longitude"]'), "expected 1 paths, one per row of C, found 2"),
        (('["latitude"]', '["latitude"]\nstamp = "receive"'), "time_error: is missing"),
        (('["latitude"]', '["latitude"]\nstamp = "headr"'), 'did you mean "header"?'),
        (("sensor_msgs/msg/NavSatFix", "geometry_msgs/msg/Point"), "has no header; set stamp"),
        (('source = "ros2"', 'source = "external"'), 'topic: has no effect without source = "ros2"'),
        (('source = "ros2"', 'source = "ros"'), 'did you mean "ros2"?'),
        (("[network.ros2]", "[network.ros2]\ndomain_id = 233"), "domain_id"),
        (("[network.ros2]", '[network.ros2]\ndialect = "rmw_zeno"'), 'did you mean "rmw_zenoh"?'),
        (("[network.ros2]", '[network.ros2]\ndistro = "jazy"'), 'did you mean "jazzy"?'),
        (("[network.ros2]", '[network.ros2]\nnamespace = "bot"'), '"bot" is no namespace'),
        (("[network.ros2]", '[network.ros2]\nconnect = ["localhost"]'), '[network.ros2] connect: "localhost" is no'),
        (("[network.ros2]", "[network.ros2]\ndomian_id = 1"), 'did you mean "domain_id"?'),
        (("[network.ros2]", f"[network.ros2]\n{PUBLISH.replace('main', 'mian')}"), 'did you mean "main"?'),
        (("[network.ros2]", f"[network.ros2]\n{PUBLISH.replace('position', 'postion')}"), 'did you mean "position"?'),
        (("[network.ros2]", f"[network.ros2]\n{PUBLISH.replace('states', 'state')}"), "states: is missing"),
    ],
)
def test_mistakes_name_the_key_and_the_nearest(tmp_path: Path, change: tuple[str, str], words: str) -> None:
    assert change[0] in MESH
    with pytest.raises(ConfigurationError) as error:
        read(tmp_path, MESH.replace(*change, 1))
    assert any(words in one.sentence for one in error.value.records), [one.sentence for one in error.value.records]


def test_a_receive_time_with_its_error_is_fine(tmp_path: Path) -> None:
    text = MESH.replace('["latitude"]', '["latitude"]\nstamp = "receive"\ntime_error = "50ms"')
    sensor = read(tmp_path, text).sensors["gps"]
    assert sensor.ros2 is not None
    assert (sensor.ros2.stamp, sensor.time_error_ns) == ("receive", 50_000_000)


def test_the_port_of_the_router_of_ros2_is_warned_of(tmp_path: Path) -> None:
    (warning,) = read(tmp_path, MESH.replace("7448", "7447")).warnings
    assert "where the router of ROS 2 is looked for too" in str(warning)
    assert '"tcp/127.0.0.1:7448"' in str(warning)


def test_without_rosbags_only_the_spelling_is_checked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lsu_mesh.mesh.config.ros2.find_spec", lambda name: None)
    assert read(tmp_path, MESH.replace('["latitude"]', '["lattitude"]')).sensors["gps"].ros2 is not None
