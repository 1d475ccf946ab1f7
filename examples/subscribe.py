"""Print the fused bounds of a running mesh: python subscribe.py [endpoint] (needs only zenoh and msgpack)."""

import contextlib
import json
import sys

import msgpack
import zenoh

configuration = zenoh.Config()
configuration.insert_json5("mode", '"client"')
configuration.insert_json5("connect/endpoints", json.dumps([*sys.argv[1:2]] or ["tcp/127.0.0.1:7447"]))
configuration.insert_json5("connect/timeout_ms", "-1")  # wait for the mesh
with (
    contextlib.suppress(KeyboardInterrupt),
    zenoh.open(configuration) as session,
    session.declare_subscriber("lsu/v1/*/fused/*") as fused,
):
    for sample in fused:
        message = msgpack.unpackb(sample.payload.to_bytes())
        bounds = zip(message["lower"], message["upper"], strict=True)
        words = "  ".join(f"[{low:8.4f}, {high:8.4f}]" for low, high in bounds)
        print(f"step {message['step']:5d}  {words}", flush=True)
