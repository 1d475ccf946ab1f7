"""A filter computes predictions while somebody listens to them, and only then: real sessions, also by a router."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
from lsu_mesh_services.bus import Bus, Clock, SessionSettings
from lsu_mesh_services.mesh_start import MeshStart
from lsu_mesh_services.peer import Peer
from ports import free_port
from waiting import until

from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.messages import VERSION, Input, Measurement, Message, decode, encode
from lsu_mesh.mesh.nodes.filter import FilterNode

pytestmark = pytest.mark.live
ADDRESS = key("demo", "prediction", "box")


class Station(NamedTuple):
    """A filter in its session, and a way to open further ones."""

    node: FilterNode
    peer: Peer
    join: Callable[[], Bus]

    def listens(self, expected: bool) -> None:
        """Wait until the filter knows whether anybody listens."""

        def is_so() -> bool:
            self.peer.turn()
            return self.node.predicts is expected

        until(is_so, f"predicts: {expected}")

    def step(self, k: int) -> None:
        """All that the filter needs for one step."""
        now, at = time.time_ns(), self.node.configuration.grid.time_of(k)
        digest = self.node.configuration.digest()
        common = {"v": VERSION, "boot": "2" * 16, "seq": k - 1, "step": k, "model": digest}
        common |= {"sent_ns": now, "origin_ns": now}
        u = Input(**common, src="plant/plant", u=[0.0])
        data: list[Message] = [
            u,
            *(Measurement(**common, src=f"sensor/{name}", time_ns=at, y=[0.0]) for name in ("s1", "s2")),
        ]
        for message in data:
            self.node.deliver(key("demo", message.topic, message.name), encode(message), now)
        self.peer.turn()


@pytest.fixture(params=["direct", "router"])
def station(demo: Path, request: pytest.FixtureRequest) -> Iterator[Station]:
    endpoint, clock = f"tcp/127.0.0.1:{free_port()}", Clock()
    is_routed = request.param == "router"
    with contextlib.ExitStack() as stack:
        if is_routed:
            stack.enter_context(Bus(SessionSettings(listen=(endpoint,), mode="router"), clock))
        own = SessionSettings(connect=(endpoint,)) if is_routed else SessionSettings(listen=(endpoint,))
        bus = stack.enter_context(Bus(own, clock))
        mode, listen = ("client", ()) if is_routed else ("peer", ("tcp/127.0.0.1:0",))

        def join() -> Bus:
            other = stack.enter_context(Bus(SessionSettings((endpoint,), listen, mode=mode), clock))
            until(lambda: other.links() > 0, "connected")
            return other

        node = FilterNode(load(demo), "box", "1" * 16)
        peer = Peer(node, bus, clock, MeshStart(node.configuration, "filter", "box"))
        peer.declare()
        yield Station(node, peer, join)


def predicted(bus: Bus) -> list[tuple[int, int]]:
    """Steps and sequence numbers of the predictions that came, once nothing has come for a moment."""
    found = []
    while (arrival := bus.next(0.5)) is not None:
        message = decode("prediction", arrival.payload)
        found.append((message.step, message.seq))
    return found


def test_predictions_are_published_while_somebody_listens(station: Station) -> None:
    station.listens(False)
    station.step(1)
    assert station.node.step() == 2, "the step is done all the same"
    listener = station.join()
    listener.subscribe(ADDRESS)
    station.listens(True)
    station.step(2)
    station.step(3)
    assert predicted(listener) == [(3, 0), (4, 1)], "of the next step, without a gap in the numbers"
    other = station.join()
    other.subscribe_live(key("demo", "prediction", "*"))
    listener.close()
    time.sleep(0.5)
    station.listens(True)
    other.close()
    station.listens(False)
    station.step(4)
    assert station.node.step() == 5
    late = station.join()
    late.subscribe(ADDRESS)
    station.listens(True)
    assert predicted(late) == [(3, 0), (4, 1)], "from the cache, and none of the step that nobody listened to"


def test_what_other_filters_take_is_published_in_any_case(demo: Path) -> None:
    with Bus(SessionSettings(), clock := Clock()) as bus:
        for overrides, expected in (([], False), (['filters.cz.transfer="predictor"'], True)):
            node = FilterNode(load(demo, overrides), "box", "1" * 16)
            peer = Peer(node, bus, clock, MeshStart(node.configuration, "filter", "box"))
            peer.declare()
            peer.turn()
            assert node.predicts is expected
