"""Messages of ROS 2 as rosbags serialises them, and what they say."""

from __future__ import annotations

from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_JAZZY)
SEC, NANOSEC = 1_764_468_000, 123_456_789
TIME_NS = SEC * 10**9 + NANOSEC
SCAN_COUNT = 1081


def made(type_name: str, **fields: Any) -> Any:
    return STORE.types[type_name](**fields)


def header(sec: int = SEC, nanosec: int = NANOSEC) -> Any:
    return made(
        "std_msgs/msg/Header", stamp=made("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec), frame_id="a"
    )


def vector(x: float, y: float, z: float) -> Any:
    return made("geometry_msgs/msg/Vector3", x=x, y=y, z=z)


def nav_sat_fix(latitude: float = 47.123456789, status: int = 0, **time: int) -> Any:
    return made(
        "sensor_msgs/msg/NavSatFix",
        header=header(**time),
        status=made("sensor_msgs/msg/NavSatStatus", status=status, service=1),
        latitude=latitude,
        longitude=-8.25,
        altitude=401.5,
        position_covariance=np.arange(9.0),
        position_covariance_type=2,
    )


def imu(orientation_known: bool = True) -> Any:
    covariance = np.zeros(9)
    unknown = np.array([-1.0, *[0.0] * 8])
    return made(
        "sensor_msgs/msg/Imu",
        header=header(),
        orientation=made("geometry_msgs/msg/Quaternion", x=0.1, y=0.2, z=0.3, w=0.9),
        orientation_covariance=covariance if orientation_known else unknown,
        angular_velocity=vector(1.25, -2.5, 3.75),
        angular_velocity_covariance=covariance,
        linear_acceleration=vector(0.1, 0.2, 9.81),
        linear_acceleration_covariance=covariance,
    )


def distance(found: float = 3.25) -> Any:
    """A Range; 3.25 is exact in the message's single precision."""
    return made(
        "sensor_msgs/msg/Range",
        header=header(),
        radiation_type=1,
        field_of_view=0.5,
        min_range=0.25,
        max_range=8.0,
        range=found,
        variance=0.0,
    )


def pose_stamped() -> Any:
    pose = made(
        "geometry_msgs/msg/Pose",
        position=made("geometry_msgs/msg/Point", x=1.5, y=-2.5, z=1e-300),
        orientation=made("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
    )
    return made("geometry_msgs/msg/PoseStamped", header=header(), pose=pose)


def laser_scan(count: int = SCAN_COUNT) -> Any:
    return made(
        "sensor_msgs/msg/LaserScan",
        header=header(),
        angle_min=-1.0,
        angle_max=1.0,
        angle_increment=0.001,
        time_increment=0.0,
        scan_time=0.025,
        range_min=0.5,
        range_max=30.0,
        ranges=np.linspace(0.25, 31.0, count, dtype=np.float32),
        intensities=np.zeros(count, dtype=np.float32),
    )


MESSAGES = {
    "sensor_msgs/msg/NavSatFix": nav_sat_fix,
    "sensor_msgs/msg/Imu": imu,
    "sensor_msgs/msg/Range": distance,
    "geometry_msgs/msg/PoseStamped": pose_stamped,
    "sensor_msgs/msg/LaserScan": laser_scan,
}


def payload(message: Any, *, little_endian: bool = True) -> bytes:
    return bytes(STORE.serialize_cdr(message, message.__msgtype__, little_endian=little_endian))
