"""Values that a message marks as invalid, as the definitions of the types say: nothing was measured there.

A NavSatFix without a fix, a part of an Imu whose covariance begins with -1, a range outside of its sensor's limits.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

IsInvalid: TypeAlias = Callable[[Any, float], bool]
"""Of a message and the value of a field of it."""


def _without_fix(message: Any, value: float) -> bool:
    return bool(message.status.status < 0)


def _without_estimate(part: str) -> IsInvalid:
    name = f"{part}_covariance"

    def is_invalid(message: Any, value: float) -> bool:
        return bool(getattr(message, name)[0] == -1.0)

    return is_invalid


def _out_of_range(message: Any, value: float) -> bool:
    return not message.min_range <= value <= message.max_range


def _out_of_scan(message: Any, value: float) -> bool:
    return not message.range_min <= value <= message.range_max


_RULES: dict[str, dict[str, IsInvalid]] = {
    "sensor_msgs/msg/NavSatFix": dict.fromkeys(("latitude", "longitude", "altitude"), _without_fix),
    "sensor_msgs/msg/Imu": {
        part: _without_estimate(part) for part in ("orientation", "angular_velocity", "linear_acceleration")
    },
    "sensor_msgs/msg/Range": {"range": _out_of_range},
    "sensor_msgs/msg/LaserScan": {"ranges": _out_of_scan},
}
"""By type and the first field of a path."""


def rule_of(type_name: str, first_field: str) -> IsInvalid | None:
    """How a field of a type is marked as invalid; None where the type does not say."""
    return _RULES.get(type_name, {}).get(first_field)
