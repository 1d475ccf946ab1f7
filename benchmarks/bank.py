"""What a step of a bank costs its peer: gate and decode a batched message, filter, encode the posterior.

    python benchmarks/bank.py [--instances 10000] [--kind LSUO] [--steps 50]

Processor time of one thread, so that other load on the machine counts little. Zenoh itself is not in it.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from pathlib import Path

from lsu_mesh.mesh.bank_messages import BankPosterior
from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.messages import Message, encode
from lsu_mesh.mesh.nodes.bank_filter import BankFilterNode
from lsu_mesh.mesh.nodes.bank_plant import BankPlantNode
from lsu_mesh.mesh.nodes.bank_sensor import BankSensorNode
from lsu_mesh.mesh.nodes.schedule import Schedule

TEXT = """
[mesh]
name = "targets"
dt = 0.1
[model]
A = [[1.0, 0.1, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.1], [0.0, 0.0, 0.0, 1.0]]
rho = [0.01, 0.05, 0.01, 0.05]
[model.prior]
lower = [-5.0, -2.0, -5.0, -2.0]
upper = [5.0, 2.0, 5.0, 2.0]
[sensors.radar]
C = [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]
r = [0.5, 0.5]
[filters.targets]
kind = "LSUO"
sensors = ["radar"]
"""
PARTS = ("gate and decode", "filter", "encode", "all")


def main() -> None:
    """Run a plant, a sensor and a bank in this process, and time the bank."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--instances", type=int, default=10_000)
    parser.add_argument("--kind", default="LSUO")
    parser.add_argument("--steps", type=int, default=50)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "mesh.toml"
        file.write_text(f"{TEXT}instances = {options.instances}\n")
        configuration = load(file, [f"filters.targets.kind={options.kind}"])
    plant = BankPlantNode(configuration, "plant", "0" * 16, Schedule(0, 10.0))
    sensor = BankSensorNode(configuration, "radar", "1" * 16)
    bank = BankFilterNode(configuration, "targets", "2" * 16)
    bank.warm_up()
    times: dict[str, list[float]] = {part: [] for part in PARTS}
    in_bytes = out_bytes = 0
    for k in range(1, options.steps + 1):
        now = (k - 1) * 10**8
        truth = plant.advance(now)[0]
        payload = encode(sensor.receive(truth, now)[0])
        in_bytes = len(payload)
        marks = [time.process_time()]
        bank.deliver(key("targets", "bank_measurement", "radar"), payload, now)
        marks.append(time.process_time())
        messages: list[Message] = bank.advance(now)
        marks.append(time.process_time())
        posterior = next(one for one in messages if isinstance(one, BankPosterior))
        out_bytes = len(encode(posterior))
        marks.append(time.process_time())
        for part, begin, end in zip(PARTS, (*marks[:3], marks[0]), (*marks[1:], marks[3]), strict=True):
            times[part].append(1e3 * (end - begin))
        x = truth.matrix("x")  # type: ignore[attr-defined]
        assert ((posterior.matrix("lower") <= x) & (x <= posterior.matrix("upper"))).all(), "a set misses its target"
    print(f"{options.instances} instances of {options.kind}, {options.steps} steps; {in_bytes} B in, {out_bytes} B out")
    print(f"{'ms of processor a step':24} {'median':>8} {'worst':>8}")
    for part in PARTS:
        print(f"{part:24} {statistics.median(times[part]):8.2f} {max(times[part][1:]):8.2f}")


if __name__ == "__main__":
    main()
