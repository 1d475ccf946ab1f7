"""Two sensors of other releases, with zenoh and msgpack only: ``python plain_sensors.py ENDPOINT MESH FILTER STEPS``.

``s1`` is of a later release: its measurements have one more field. ``s2`` is of the first release: its measurements
lack what came later. Each step is sent when the filter's posterior of the step before has come. What came is printed
as JSON lines: the model, then every posterior.
"""

from __future__ import annotations

import json
import queue
import sys
import time
from typing import Any

import msgpack
import zenoh

TRUTH, ERROR = 0.3, 0.01
WITHIN_S = 60.0
"""For a model or a posterior to come, on a busy machine."""


def opened(endpoint: str) -> Any:
    """A session that links to everyone of the mesh."""
    configuration = zenoh.Config()
    for name, value in (
        ("mode", "peer"), ("connect/endpoints", [endpoint]), ("listen/endpoints", ["tcp/127.0.0.1:0"]),
        ("connect/timeout_ms", -1), ("scouting/multicast/enabled", False),
    ):  # fmt: skip
        configuration.insert_json5(name, json.dumps(value))
    return zenoh.open(configuration)


def asked(session: Any, mesh: str) -> dict[str, Any]:
    """The model, as soon as an estimator is there to tell it."""
    end = time.monotonic() + WITHIN_S
    while time.monotonic() < end:
        for reply in session.get(f"lsu/v1/{mesh}/model", timeout=1.0):
            if reply.ok is not None:
                model: dict[str, Any] = msgpack.unpackb(reply.ok.payload.to_bytes())
                return model
        time.sleep(0.1)
    raise TimeoutError("nobody tells the model")


def measurement(name: str, model: str, step: int) -> bytes:
    """The payload of a sensor."""
    now = time.time_ns()
    fields = {
        "v": 1, "src": f"sensor/{name}", "boot": f"{ord(name[-1]):016x}", "seq": step - 1, "step": step, "sent_ns": now,
        "origin_ns": now, "model": model, "y": [TRUTH + (ERROR if step % 2 else -ERROR)], "time_ns": now,
    }  # fmt: skip
    return msgpack.packb(fields | ({"colour": {"of": ["the", "paint"]}} if name == "s1" else {}))


def main(endpoint: str, mesh: str, filter_name: str, steps: int) -> None:
    came: queue.Queue[bytes] = queue.Queue()
    with opened(endpoint) as session:
        key = f"lsu/v1/{mesh}/posterior/{filter_name}"
        subscriber = session.declare_subscriber(key, lambda sample: came.put(sample.payload.to_bytes()))
        publishers = {name: session.declare_publisher(f"lsu/v1/{mesh}/measurement/{name}") for name in ("s1", "s2")}
        model = asked(session, mesh)
        print(json.dumps(model), flush=True)
        while not all(publisher.matching_status.matching for publisher in publishers.values()):
            time.sleep(0.01)
        time.sleep(
            1.0
        )  # some reader is there; a recorder's subscription may come a moment later, and there is no cache
        for step in range(1, steps + 1):
            for name, publisher in publishers.items():
                publisher.put(measurement(name, model["model"], step))
            posterior = msgpack.unpackb(came.get(timeout=WITHIN_S))
            while posterior["step"] < step or posterior["missing"]:  # a busy filter may begin before both have come
                posterior = msgpack.unpackb(came.get(timeout=WITHIN_S))
            print(json.dumps(posterior), flush=True)
        sys.stdin.readline()  # its measurements stay asked for until the test has looked
        subscriber.undeclare()


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3], int(sys.argv[4]))
