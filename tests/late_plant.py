"""A plant whose inputs come late, and its sensor: ``python late_plant.py ENDPOINT MESH STEPS PEER…``.

It knows the protocol, zenoh and msgpack only, and begins when the peers are there. Every second input goes out only
when a prediction was published without it, that is with the input box; every fourth only one step after that. The
steps of these predictions are printed, as a JSON list.
"""

from __future__ import annotations

import json
import queue
import sys
import time
from typing import Any

import msgpack
from plain_sensors import WITHIN_S, asked, measurement, opened


def input_message(model: str, step: int) -> bytes:
    """The payload of an input that leaves the state where it is."""
    now = time.time_ns()
    fields = {
        "v": 1, "src": "plant/plant", "boot": "70" * 8, "seq": step - 1, "step": step, "sent_ns": now, "origin_ns": now,
        "model": model, "u": [0.0],
    }  # fmt: skip
    payload: bytes = msgpack.packb(fields)
    return payload


class Predictions:
    """What the filter predicts: was the input known?"""

    def __init__(self, session: Any, key: str) -> None:
        self._came: queue.Queue[bytes] = queue.Queue()
        self._subscriber = session.declare_subscriber(key, lambda sample: self._came.put(sample.payload.to_bytes()))

    def wait_for(self, step: int, missing: list[str]) -> None:
        """Until a prediction of the step says so."""
        found: dict[str, Any] = {"step": 0, "missing": []}
        while (found["step"], found["missing"]) != (step, missing):
            found = msgpack.unpackb(self._came.get(timeout=WITHIN_S))


def wait_for_peers(session: Any, mesh: str, peers: set[str]) -> None:
    """Until each is there: a peer declares its token after its subscriptions."""
    end = time.monotonic() + WITHIN_S
    while time.monotonic() < end:
        replies = list(session.liveliness().get(f"lsu/v1/{mesh}/live/*", timeout=1.0))
        if peers <= {str(reply.ok.key_expr).rpartition("/")[2] for reply in replies if reply.ok is not None}:
            return
        time.sleep(0.1)
    raise TimeoutError(f"not all of {peers} are there")


def main(endpoint: str, mesh: str, steps: int, peers: set[str]) -> None:
    boxed: list[int] = []
    with opened(endpoint) as session:
        predictions = Predictions(session, f"lsu/v1/{mesh}/prediction/f")
        sensor = session.declare_publisher(f"lsu/v1/{mesh}/measurement/s1")
        plant = session.declare_publisher(f"lsu/v1/{mesh}/input/plant")
        wait_for_peers(session, mesh, peers)
        model = asked(session, mesh)["model"]
        while not (sensor.matching_status.matching and plant.matching_status.matching):
            time.sleep(0.01)
        owed: list[int] = []
        for step in range(1, steps + 1):
            sensor.put(measurement("s1", model, step))
            if step % 2:
                plant.put(input_message(model, step))
                predictions.wait_for(step + 1, [])
            else:
                predictions.wait_for(step + 1, ["input"])
                boxed.append(step + 1)
                owed.append(step)
            while owed and (owed[0] % 4 or owed[0] < step):
                plant.put(input_message(model, owed.pop(0)))
        print(json.dumps(boxed), flush=True)
        sys.stdin.readline()  # what it sent stays asked for until the test has looked


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]), set(sys.argv[4:]))
