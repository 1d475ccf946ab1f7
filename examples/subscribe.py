"""Print the bounds that a running mesh publishes: python subscribe.py [ENDPOINT [NAME]] (needs only zenoh and msgpack).

NAME is a filter or a fusion; without it all fused bounds are printed.
"""

import contextlib
import json
import sys

import msgpack
import zenoh

configuration = zenoh.Config()
configuration.insert_json5("mode", '"client"')
configuration.insert_json5("connect/endpoints", json.dumps([*sys.argv[1:2]] or ["tcp/127.0.0.1:7447"]))
configuration.insert_json5("connect/timeout_ms", "-1")  # wait for the mesh
name = sys.argv[2] if len(sys.argv) > 2 else "*"
topics = ("fused",) if name == "*" else ("posterior", "fused")
with (
    contextlib.suppress(KeyboardInterrupt),
    zenoh.open(configuration) as session,
    session.declare_subscriber(f"lsu/v1/*/*/{name}") as published,
):
    for sample in published:
        if str(sample.key_expr).split("/")[3] in topics:
            message = msgpack.unpackb(sample.payload.to_bytes())
            bounds = zip(message["lower"], message["upper"], strict=True)
            words = "  ".join(f"[{low:8.4f}, {high:8.4f}]" for low, high in bounds)
            print(f"step {message['step']:5d}  {words}", flush=True)
