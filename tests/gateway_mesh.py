"""A small mesh whose sensor is a program, for the tests of the gateway."""

from __future__ import annotations

MESH = """
[mesh]
name = "lab"
dt = 0.1
start_time = "2026-05-01T12:00:00Z"
past = 1000000000
[model]
continuous = true
states = ["position", "speed"]
units = ["m", "m/s"]
A = [[0.0, 1.0], [0.0, 0.0]]
noise_map = [[0.0], [1.0]]
rho = [2.0]
[model.prior]
lower = [-10.0, -10.0]
upper = [10.0, 10.0]
[sensors.gauge]
source = "external"
C = [[1.0, 0.0], [0.0, 1.0]]
r = [0.5, 0.5]
time_error = "1ms"
[sensors.file]
C = [[1.0, 0.0]]
r = [0.5]
file = "file.csv"
columns = ["y"]
step = "step"
[filters.box]
kind = "LSUO"
sensors = ["gauge", "file"]
[fusion.main]
sources = ["box"]
"""
START_NS = 1_777_636_800_000_000_000
"""``start_time`` in MESH."""
