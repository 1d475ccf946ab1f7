"""Names of ROS 2: topics, namespaces and types."""

from __future__ import annotations

import re

_TOKEN = r"[A-Za-z_][A-Za-z0-9_]*"
_TOPIC = re.compile(rf"/?{_TOKEN}(/{_TOKEN})*")
_NAMESPACE = re.compile(rf"/|(/{_TOKEN})+")
_TYPE = re.compile(r"[a-z][a-z0-9_]*/msg/[A-Z][A-Za-z0-9]*")
TOPIC_RULE = 'letters, digits and "_" between slashes, no part begins with a digit, such as "/fix"'
NAMESPACE_RULE = '"/", or a name such as "/robot1"'
TYPE_RULE = 'a message type such as "sensor_msgs/msg/NavSatFix"'


def is_topic(text: str) -> bool:
    """Whether it is a name of a topic, with or without the slash in front."""
    return _TOPIC.fullmatch(text) is not None and "__" not in text


def is_namespace(text: str) -> bool:
    """Whether it is an absolute namespace."""
    return _NAMESPACE.fullmatch(text) is not None and "__" not in text


def is_type(text: str) -> bool:
    """Whether it looks like the full name of a message type."""
    return _TYPE.fullmatch(text) is not None


def absolute(topic: str, namespace: str) -> str:
    """The topic with a slash in front; a relative one lies in the namespace."""
    if topic.startswith("/"):
        return topic
    return f"{namespace.rstrip('/')}/{topic}"


def dds_type(type_name: str) -> str:
    """``sensor_msgs::msg::dds_::NavSatFix_`` of ``sensor_msgs/msg/NavSatFix``: the name of a type on the wire."""
    package, kind, name = type_name.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def ros_type(dds_name: str) -> str:
    """``sensor_msgs/msg/NavSatFix`` of ``sensor_msgs::msg::dds_::NavSatFix_``; what is no such name stays as it is."""
    return dds_name.replace("::dds_::", "::").replace("::", "/").removesuffix("_")
