"""Every estimator answers the query for the model, and the access control lets it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgpack
import pytest
from local_mesh import LocalMesh
from lsu_mesh_services.bus import Clock
from lsu_mesh_services.mesh_start import MeshStart
from lsu_mesh_services.network.receive_queue import ReceiveQueue
from lsu_mesh_services.peer import Peer

from lsu_mesh.mesh.access import access
from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.keys import model_key

Answers = Callable[[], tuple[str, bytes, str] | None]
ESTIMATORS = {"box", "para", "cz", "main"}


class Line:
    """A bus that keeps what is declared."""

    def __init__(self) -> None:
        self.answers: dict[str, Answers] = {}
        self.arrivals = ReceiveQueue()

    def answer(self, address: str, answers: Answers) -> None:
        self.answers[address] = answers

    def ignore(self, *_: object) -> None:
        pass

    announce = subscribe = subscribe_live = watch_alive = declare_alive = ask = ask_cache = ignore
    recover = bound_age = watch_listeners = ignore


@pytest.mark.parametrize("changes", [[], ["filters.box.transfer=predictor"]], ids=["plain", "transfer"])
def test_filters_and_fusions_answer_and_nobody_else(demo: Path, changes: list[str]) -> None:
    configuration = load(demo, changes)
    asked = model_key("demo")
    answered = {}
    for name, node in LocalMesh(configuration).nodes.items():
        line: Any = Line()
        Peer(node, line, Clock(), MeshStart(configuration, node.role, name)).declare()
        may = access(configuration, node.role, name)
        assert (asked in line.answers) == (asked in may.answers), name
        if asked in line.answers:
            answered[name] = line.answers[asked]()
    assert set(answered) == ESTIMATORS
    assert {(address, encoding) for address, _, encoding in answered.values()} == {(asked, "application/msgpack")}
    told = {name: msgpack.unpackb(payload) for name, (_, payload, _) in answered.items()}
    assert len({one.pop("boot") for one in told.values()}) == len(ESTIMATORS), "each says who it is"
    assert all(one == told["box"] for one in told.values()), "all else is the same"
    assert told["box"]["model"] == configuration.digest()
