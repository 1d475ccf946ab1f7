"""A mesh whose measurements come from programs of one's own."""

EXTERNAL = """\
# A mesh whose sensor is a program of your own.

[mesh]
name = "external"
dt = 0.1

# x = (position, speed)
[model]
A = [[1.0, 0.1], [0.0, 1.0]]
# |w| ≤ rho, per step: what must be right
rho = [0.01, 0.2]

# a box that holds the first state
[model.prior]
lower = [-100.0, -10.0]
upper = [100.0, 10.0]

[sensors.gauge]
source = "external"
C = [[1.0, 0.0]]
# |v| ≤ r: what must be right
r = [0.5]

[filters.main]
kind = "LSUCZ"
sensors = ["gauge"]
"""
