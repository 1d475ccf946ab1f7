"""The session with ROS 2, and ports that its router holds."""

from __future__ import annotations

import argparse
import socket
from pathlib import Path

import pytest
from lsu_mesh_services.bus import Bus, Clock, NoSession, SessionSettings
from lsu_mesh_services.network.receive_queue import ReceiveQueue
from lsu_mesh_services.network.security import InsecureSession
from lsu_mesh_services.ros2.session import open_ros2, ros2_settings
from ports import free_port

from lsu_mesh.mesh.config import load


@pytest.fixture
def taken() -> str:
    return f"tcp/127.0.0.1:{free_port()}"


def held(port: int) -> socket.socket:
    listener = socket.socket()
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    listener.bind(("127.0.0.1", port))
    listener.listen()
    return listener


def test_a_port_that_is_taken_says_what_to_do(taken: str) -> None:
    with held(int(taken.rpartition(":")[2])):
        with pytest.raises(NoSession) as error:
            Bus(SessionSettings(listen=(taken,)), Clock())
        assert '-X network.entry="tcp/127.0.0.1:PORT"' in str(error.value)
        assert "rmw_zenohd" not in str(error.value)
        with pytest.raises(NoSession) as error:
            open_ros2(SessionSettings(listen=(taken,)), Clock(), ReceiveQueue())
        assert str(error.value).startswith("ROS 2: cannot listen on")
        assert "choose another one with [network.ros2] listen" in str(error.value)


def test_on_7447_the_error_names_the_router_of_ros2() -> None:
    try:
        listener = held(7447)
    except OSError:
        pytest.skip("somebody else holds 7447")
    with listener, pytest.raises(NoSession) as error:
        Bus(SessionSettings(listen=("tcp/127.0.0.1:7447",)), Clock())
    assert "rmw_zenohd, the router of ROS 2, and zenohd listen on 7447" in str(error.value)
    assert '-X network.entry="tcp/127.0.0.1:PORT"' in str(error.value)


def test_listening_for_other_hosts_has_to_be_meant(demo: Path) -> None:
    open_to_all = load(demo, ['network.ros2.listen=["tcp/0.0.0.0:7500"]'])
    with pytest.raises(InsecureSession):
        ros2_settings(open_to_all, argparse.Namespace(insecure=False))
    assert ros2_settings(open_to_all, argparse.Namespace(insecure=True)).listen == ("tcp/0.0.0.0:7500",)
    plain = ros2_settings(load(demo), argparse.Namespace(insecure=False))
    assert (plain.connect, plain.listen) == (("tcp/localhost:7447",), ("tcp/127.0.0.1:0",))


def test_arrivals_of_both_sessions_come_by_one_queue() -> None:
    endpoint, clock = f"tcp/127.0.0.1:{free_port()}", Clock()
    with Bus(SessionSettings(listen=(endpoint,)), clock) as other:
        other.announce_plain("0/fix/type/hash")
        with (
            Bus(SessionSettings(), clock) as mesh,
            Bus(SessionSettings(connect=(endpoint,)), clock, mesh.arrivals) as one,
        ):
            one.subscribe_plain("0/fix/*/*", "ros2")
            one.watch_tokens("@ros2_lv/0/**", "there", "gone")
            other.declare_alive("@ros2_lv/0/x")
            there = mesh.next(10.0)
            assert there is not None
            assert (there.what, there.key) == ("there", "@ros2_lv/0/x")
            found = None
            for _ in range(100):
                other.put_plain("0/fix/type/hash", b"data", b"attached")
                if (found := mesh.next(0.1)) is not None:
                    break
            assert found is not None
            assert (found.what, found.key, found.payload) == ("ros2", "0/fix/type/hash", b"data")
            assert found.attachment == b"attached"
