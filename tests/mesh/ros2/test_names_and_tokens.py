"""Keys, tokens and attachments, byte by byte as those who define them write them down.

The strings of rmw_zenoh are those of docs/design.md of its rolling branch as of rmw_zenoh_cpp 0.2.5 and later; the
forms are those of TopicInfo, Entity and qos_to_keyexpr in rmw_zenoh_cpp/src/detail/liveliness_utils.cpp, and of
serialize_to_zbytes in attachment_helpers.cpp there. Those of ros2dds follow liveliness_mgt.rs and ros2_utils.rs of
zenoh-plugin-ros2dds (main, August 2026).
"""

from __future__ import annotations

import pytest
import zenoh
from zenoh import ext

from lsu_mesh.mesh.ros2.attachment import Attachment, decode_attachment, encode_attachment
from lsu_mesh.mesh.ros2.dialects import dialect_of
from lsu_mesh.mesh.ros2.graph import Announced, Endpoint, Node
from lsu_mesh.mesh.ros2.names import absolute, dds_type, is_namespace, is_topic, is_type, ros_type
from lsu_mesh.mesh.ros2.rmw_zenoh import RmwZenoh, quality_text
from lsu_mesh.mesh.ros2.ros2dds import Ros2Dds
from lsu_mesh.mesh.ros2.settings import Ros2Network

STRING = "std_msgs/msg/String"
HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
CHATTER = f"0/chatter/std_msgs::msg::dds_::String_/{HASH}"
LISTENER = "aac3178e146ba6f1fc6e6a4085e77f21"
LISTENER_NODE = f"@ros2_lv/2/{LISTENER}/0/0/NN/%/%/listener"
SUBSCRIPTION = f"@ros2_lv/2/{LISTENER}/0/10/MS/%/%/listener/%chatter/std_msgs::msg::dds_::String_/{HASH}/::,10:,:,:,,"
TALKER = "8b20917502ee955ac4476e0266340d5c"
PUBLISHER = f"@ros2_lv/2/{TALKER}/0/10/MP/%/%/talker/%chatter/std_msgs::msg::dds_::String_/{HASH}/::,7:,:,:,,"
BRIDGE = f"@/{TALKER}/@ros2_lv/MP/bot1§chatter/std_msgs§msg§String/:::1,7"
WRONG_TYPE = "the topic is of type std_msgs/msg/String, not std_msgs/msg/Int32"
GID = bytes(range(16))


def test_the_dialect_is_that_of_the_settings() -> None:
    assert isinstance(dialect_of(Ros2Network()), RmwZenoh)
    assert isinstance(dialect_of(Ros2Network(dialect="ros2dds")), Ros2Dds)


def test_keys_of_rmw_zenoh() -> None:
    plain, robot = RmwZenoh(Ros2Network()), RmwZenoh(Ros2Network(namespace="/robot1"))
    assert plain.data_key("chatter", STRING, HASH) == CHATTER
    assert plain.data_key("/chatter", STRING, HASH) == CHATTER
    assert robot.data_key("chatter", STRING, HASH) == CHATTER.replace("0/", "0/robot1/", 1)
    assert robot.data_key("/chatter", STRING, HASH) == CHATTER, "an absolute name is in no namespace"
    assert RmwZenoh(Ros2Network(domain_id=2)).data_keys("/a/b") == "2/a/b/*/*"


def test_tokens_of_rmw_zenoh() -> None:
    two = RmwZenoh(Ros2Network(domain_id=2))
    listener, talker = Node(LISTENER, 0, "listener"), Node(TALKER, 0, "talker")
    assert two.node_token(listener) == LISTENER_NODE
    assert two.endpoint_token(listener, Endpoint("MS", 10, "/chatter", STRING, HASH, 10)) == SUBSCRIPTION
    assert two.endpoint_token(talker, Endpoint("MP", 10, "chatter", STRING, HASH, 7)) == PUBLISHER
    robot = RmwZenoh(Ros2Network(namespace="/a/b"))
    token = robot.endpoint_token(talker, Endpoint("MP", 1, "c", STRING, HASH, 42))
    assert token == f"@ros2_lv/0/{TALKER}/0/1/MP/%/%a%b/talker/%a%b%c/std_msgs::msg::dds_::String_/{HASH}/::,:,:,:,,"
    assert quality_text(42) == "::,:,:,:,,"


def test_publishers_are_found_by_their_tokens() -> None:
    two = RmwZenoh(Ros2Network(domain_id=2))
    wanted = zenoh.KeyExpr(two.publisher_tokens("/chatter"))
    assert wanted.includes(zenoh.KeyExpr(PUBLISHER))
    assert not wanted.intersects(zenoh.KeyExpr(SUBSCRIPTION))
    assert not wanted.intersects(zenoh.KeyExpr(PUBLISHER.replace("%chatter", "%chat")))
    assert two.announced(PUBLISHER) == Announced("/talker", STRING)
    assert two.announced(LISTENER_NODE) is None
    assert zenoh.KeyExpr(RmwZenoh(Ros2Network()).data_keys("chatter")).includes(zenoh.KeyExpr(CHATTER))
    assert not zenoh.KeyExpr(RmwZenoh(Ros2Network()).data_keys("chatter")).intersects(
        zenoh.KeyExpr(f"0/chatter/far/std_msgs::msg::dds_::String_/{HASH}")
    )


def test_a_wrong_type_or_hash_is_explained() -> None:
    plain, humble = RmwZenoh(Ros2Network()), RmwZenoh(Ros2Network(distro="humble"))
    assert plain.refusal(CHATTER, STRING, HASH) == ""
    assert plain.refusal(CHATTER, "std_msgs/msg/Int32", HASH) == WRONG_TYPE
    other = plain.refusal(CHATTER, STRING, HASH.replace("df668", "00000"))
    assert "the sender's fields are others" in other
    old = plain.refusal(CHATTER.replace(HASH, "TypeHashNotSupported"), STRING, HASH)
    assert 'distro = "humble"' in old
    new = humble.refusal(CHATTER, STRING, "TypeHashNotSupported")
    assert "sent by a later release" in new


def test_keys_and_tokens_of_ros2dds() -> None:
    plain, robot = Ros2Dds(Ros2Network()), Ros2Dds(Ros2Network(namespace="/bot1"))
    assert plain.data_key("/chatter", STRING, HASH) == plain.data_keys("chatter") == "chatter"
    assert robot.data_key("/chatter", STRING, HASH) == robot.data_keys("/chatter") == "bot1/chatter"
    wanted = zenoh.KeyExpr(robot.publisher_tokens("/chatter"))
    assert wanted.includes(zenoh.KeyExpr(BRIDGE))
    assert robot.announced(BRIDGE) == Announced(f"the bridge {TALKER}", STRING)
    assert robot.announced("@/x/@ros2_lv") is None
    assert robot.refusal("bot1/chatter", STRING, HASH) == ""
    node = Node(TALKER, 0, "n")
    assert robot.node_token(node) == robot.endpoint_token(node, Endpoint("MP", 1, "t", STRING, HASH, 1)) == ""


def test_attachments_are_those_of_zenohs_own_serialisation() -> None:
    attachment = Attachment(5, 1_764_468_000_123_456_789, GID)
    expected = ext.z_serialize((ext.Int64(5), ext.Int64(attachment.sent_ns), GID)).to_bytes()
    assert encode_attachment(attachment) == expected
    assert len(expected) == 33
    assert expected[16] == 16
    assert decode_attachment(expected) == attachment


def test_attachments_with_names_of_older_releases_are_read_too() -> None:
    old = ext.z_serialize(
        ("sequence_number", ext.Int64(7), "source_timestamp", ext.Int64(11), "source_gid", GID)
    ).to_bytes()  # rmw_zenoh_cpp 0.2.0 to 0.2.3
    assert decode_attachment(old) == Attachment(7, 11, GID)
    for length in range(len(old)):
        assert decode_attachment(old[:length]) is None


@pytest.mark.parametrize("data", [b"", b"\0" * 16, b"\0" * 17 + b"x", b"\0" * 16 + b"\x10" + b"\1" * 15])
def test_what_is_no_attachment(data: bytes) -> None:
    assert decode_attachment(data) is None


def test_names() -> None:
    assert all(map(is_topic, ("/fix", "fix", "/a/b_2", "_x")))
    assert not any(map(is_topic, ("", "/", "/a/", "a//b", "/2a", "a-b", "/a__b", "~x", "a b")))
    assert all(map(is_namespace, ("/", "/a", "/a/b")))
    assert not any(map(is_namespace, ("", "a", "/a/", "//")))
    assert all(map(is_type, (STRING, "my_pkg/msg/Thing2")))
    assert not any(map(is_type, ("std_msgs/String", "std_msgs/srv/String", "std_msgs/msg/string", "String")))
    assert absolute("fix", "/") == "/fix"
    assert absolute("fix", "/a") == "/a/fix"
    assert dds_type(STRING) == "std_msgs::msg::dds_::String_"
    assert ros_type("std_msgs::msg::dds_::String_") == STRING
