"""Payloads that rosbags serialised: right values, right times, in time; what is invalid, and what is refused."""

from __future__ import annotations

import math
import struct
import time
from typing import Any

import numpy as np
import pytest
from ros_messages import (
    MESSAGES,
    NANOSEC,
    SEC,
    STORE,
    TIME_NS,
    distance,
    imu,
    laser_scan,
    made,
    nav_sat_fix,
    payload,
    pose_stamped,
)

from lsu_mesh.mesh.ros2.decoder import Decoder, Reading, UnfitMessage, has_header, type_hash_of, types_of
from lsu_mesh.mesh.ros2.fields import NoSuchField, check_path, compile_path, parse_path

FIELDS = {
    "sensor_msgs/msg/NavSatFix": (("latitude", "longitude", "altitude"), (47.123456789, -8.25, 401.5)),
    "sensor_msgs/msg/Imu": (
        ("angular_velocity.y", "linear_acceleration.z", "orientation.w", "orientation_covariance[0]"),
        (-2.5, 9.81, 0.9, 0.0),
    ),
    "sensor_msgs/msg/Range": (("range", "max_range"), (3.25, 8.0)),
    "geometry_msgs/msg/PoseStamped": (("pose.position.x", "pose.position.y", "pose.position.z"), (1.5, -2.5, 1e-300)),
    "sensor_msgs/msg/LaserScan": (
        ("ranges[100]", "ranges[1079]"),
        tuple(float(one) for one in np.linspace(0.25, 31.0, 1081, dtype=np.float32)[[100, 1079]]),
    ),
}
LIMIT_S = 100e-6


def decoder(type_name: str, *paths: str, stamped: bool = True) -> Decoder:
    for path in paths:
        check_path(STORE, type_name, path)
    return Decoder(STORE, type_name, paths, stamped=stamped)


def refused(one: Decoder, data: bytes) -> UnfitMessage:
    with pytest.raises(UnfitMessage) as error:
        one.decode(data)
    return error.value


@pytest.mark.parametrize("little_endian", [True, False], ids=["little", "big"])
@pytest.mark.parametrize("type_name", MESSAGES)
def test_values_and_time_are_exact(type_name: str, little_endian: bool) -> None:
    paths, values = FIELDS[type_name]
    data = payload(MESSAGES[type_name](), little_endian=little_endian)
    expected: list[float | None] = list(values)
    if type_name == "sensor_msgs/msg/LaserScan":
        assert values[1] > 30.0
        expected[1] = None  # beyond range_max
    assert decoder(type_name, *paths).decode(data) == Reading(expected, TIME_NS)


@pytest.mark.parametrize(("sec", "nanosec"), [(0, 1), (2**31 - 1, 999_999_999), (1_700_000_000, 0), (1, 999_999_999)])
def test_stamps_are_exact_to_the_nanosecond(sec: int, nanosec: int) -> None:
    found = decoder("sensor_msgs/msg/NavSatFix", "latitude").decode(payload(nav_sat_fix(sec=sec, nanosec=nanosec)))
    assert found.time_ns == sec * 1_000_000_000 + nanosec


@pytest.mark.parametrize(("sec", "nanosec", "words"), [(0, 0, "is 0"), (-1, 0, "before 1970"), (5, 10**9, "less than")])
def test_stamps_that_are_none_are_refused(sec: int, nanosec: int, words: str) -> None:
    found = refused(decoder("sensor_msgs/msg/NavSatFix", "latitude"), payload(nav_sat_fix(sec=sec, nanosec=nanosec)))
    assert found.reason == "stamp"
    assert words in str(found)


def test_without_a_stamp_no_time_is_read() -> None:
    data = payload(nav_sat_fix(sec=0, nanosec=0))
    assert decoder("sensor_msgs/msg/NavSatFix", "latitude", stamped=False).decode(data).time_ns is None


def test_a_fix_that_is_none_measures_nothing() -> None:
    one = decoder("sensor_msgs/msg/NavSatFix", "latitude", "position_covariance[1]")
    assert one.decode(payload(nav_sat_fix(status=-1))).y == [None, 1.0]
    assert one.decode(payload(nav_sat_fix(status=0))).y == [47.123456789, 1.0]


def test_what_an_imu_does_not_estimate_is_missing() -> None:
    one = decoder("sensor_msgs/msg/Imu", "orientation.w", "angular_velocity.x")
    assert one.decode(payload(imu(orientation_known=False))).y == [None, 1.25]


@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan, 0.2, 8.5])
def test_distances_beyond_the_sensor_are_missing(value: float) -> None:
    assert decoder("sensor_msgs/msg/Range", "range").decode(payload(distance(value))).y == [None]


def test_bytes_that_are_no_such_message_are_refused() -> None:
    one, data = decoder("geometry_msgs/msg/PoseStamped", "pose.position.x"), payload(pose_stamped())
    for wrong in (b"", b"\0\1", data[:-1], data[:4], data + bytes(8), b"\xff\xff" + data[2:]):
        assert refused(one, wrong).reason == "decoding"
    assert one.decode(data + bytes(3)).y == [1.5], "DDS pads a message to four bytes"


def test_any_cut_is_refused_and_nothing_else_is_raised() -> None:
    for type_name, make in MESSAGES.items():
        one, data = decoder(type_name, FIELDS[type_name][0][0]), payload(make())
        for length in range(min(len(data), 400)):
            refused(one, data[:length])


def test_a_list_that_is_too_short_is_refused_by_name() -> None:
    found = refused(decoder("sensor_msgs/msg/LaserScan", "ranges[50]"), payload(laser_scan(50)))
    assert found.reason == "fields"
    assert str(found) == "ranges[50]: the list of this message is shorter"


def test_whole_numbers_are_never_rounded() -> None:
    one = decoder("std_msgs/msg/Int64", "data", stamped=False)
    assert one.decode(payload(made("std_msgs/msg/Int64", data=2**53))).y == [float(2**53)]
    found = refused(one, payload(made("std_msgs/msg/Int64", data=2**53 + 1)))
    assert "would be rounded" in str(found)
    layout = made("std_msgs/msg/MultiArrayLayout", dim=[], data_offset=0)
    array = made("std_msgs/msg/Int64MultiArray", layout=layout, data=np.array([2**60 + 1]))
    of_array = decoder("std_msgs/msg/Int64MultiArray", "data[0]", stamped=False)
    assert "would be rounded" in str(refused(of_array, payload(array)))


def test_single_precision_is_read_as_it_was_sent() -> None:
    (found,) = decoder("sensor_msgs/msg/Range", "range").decode(payload(distance(0.7))).y
    assert found == struct.unpack("<f", struct.pack("<f", 0.7))[0] != 0.7


@pytest.mark.parametrize("type_name", MESSAGES)
def test_decoding_is_fast(type_name: str) -> None:
    one, data = decoder(type_name, *FIELDS[type_name][0]), payload(MESSAGES[type_name]())
    best = math.inf
    for _ in range(20):
        begin = time.perf_counter()
        for _ in range(50):
            one.decode(data)
        best = min(best, (time.perf_counter() - begin) / 50)
    print(f"{type_name}: {best * 1e6:.1f} µs for {len(data)} bytes")
    assert best <= LIMIT_S


@pytest.mark.parametrize("text", ["", ".x", "x.", "x..y", "x[", "x[]", "x[-1]", "x[1", "3x", "x y", "x[1][2]", "ü"])
def test_what_is_no_path(text: str) -> None:
    assert parse_path(text) is None


def test_paths_through_lists_of_messages() -> None:
    path = "transforms[1].transform.translation.x"
    check_path(STORE, "tf2_msgs/msg/TFMessage", path)
    assert parse_path(path) == ("transforms", 1, "transform", "translation", "x")

    class Any2:
        def __init__(self, **fields: Any) -> None:
            self.__dict__.update(fields)

    inner = Any2(transform=Any2(translation=Any2(x=4.0)))
    assert compile_path(path)(Any2(transforms=[None, inner])) == 4.0
    with pytest.raises(NoSuchField) as error:
        check_path(STORE, "tf2_msgs/msg/TFMessage", "transforms[1].transform.translatoin.x")
    assert error.value.name == "translatoin"
    assert "translation" in error.value.known


def test_hashes_and_headers() -> None:
    # rmw_zenoh, docs/design.md of the rolling branch: the key of the topic chatter
    chatter = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    assert type_hash_of("jazzy", "std_msgs/msg/String") == chatter
    assert type_hash_of("humble", "std_msgs/msg/String") == "TypeHashNotSupported"
    assert has_header(types_of("jazzy"), "sensor_msgs/msg/Imu")
    assert not has_header(types_of("jazzy"), "geometry_msgs/msg/Point")
    assert divmod(TIME_NS, 10**9) == (SEC, NANOSEC)
