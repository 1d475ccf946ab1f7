"""A node of ROS 2 with plain zenoh: ``python ros2_talker.py ENDPOINT ROLE DIALECT HZ COUNT``.

It listens at ENDPOINT, as "peer" or as "router" (rmw_zenohd is one), shows the tokens of a node and of a publisher,
waits until somebody listens to the topic, and publishes COUNT fixes as rmw_zenoh does, or as the bridge from DDS:
serialised by rosbags, with an attachment or without. The latitude counts messages; the stamp is the time of sending.
It prints "listened to", then a JSON line with all stamps, and leaves when its standard input ends.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import zenoh
from ros_messages import STORE, nav_sat_fix, payload
from zenoh import ext

TYPE, DDS_TYPE = "sensor_msgs/msg/NavSatFix", "sensor_msgs::msg::dds_::NavSatFix_"
HASH = STORE.hash_rihs01(TYPE)
WITHIN_S = 60.0


def opened(endpoint: str, role: str) -> Any:
    configuration = zenoh.Config()
    for name, value in (
        ("mode", role), ("listen/endpoints", [endpoint]), ("scouting/multicast/enabled", False),
    ):  # fmt: skip
        configuration.insert_json5(name, json.dumps(value))
    return zenoh.open(configuration)


def tokens(session: Any, dialect: str) -> list[str]:
    zid = str(session.zid())
    if dialect == "ros2dds":
        return [f"@/{zid}/@ros2_lv/MP/fix/sensor_msgs§msg§NavSatFix/:::1,10"]
    node = f"@ros2_lv/0/{zid}/0/0/NN/%/%/receiver"
    return [node, f"@ros2_lv/0/{zid}/0/1/MP/%/%/receiver/%fix/{DDS_TYPE}/{HASH}/::,10:,:,:,,"]


def main(endpoint: str, role: str, dialect: str, hz: float, count: int) -> None:
    with opened(endpoint, role) as session:
        declared = [session.liveliness().declare_token(token) for token in tokens(session, dialect)]
        key = "fix" if dialect == "ros2dds" else f"0/fix/{DDS_TYPE}/{HASH}"
        publisher = session.declare_publisher(key, congestion_control=zenoh.CongestionControl.DROP)
        end = time.monotonic() + WITHIN_S
        while not publisher.matching_status.matching and time.monotonic() < end:
            time.sleep(0.01)
        print("listened to", flush=True)
        stamps = []
        begin = time.monotonic()
        for i in range(count):
            time.sleep(max(0.0, begin + i / hz - time.monotonic()))
            now = time.time_ns()
            message = nav_sat_fix(float(i), sec=now // 10**9, nanosec=now % 10**9)
            attachment = ext.z_serialize((ext.Int64(i + 1), ext.Int64(now), bytes(range(16))))
            publisher.put(payload(message), attachment=None if dialect == "ros2dds" else attachment)
            stamps.append(now)
        print(json.dumps({"stamps": stamps}), flush=True)
        sys.stdin.read()
        for token in declared:
            token.undeclare()


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3], float(sys.argv[4]), int(sys.argv[5]))
