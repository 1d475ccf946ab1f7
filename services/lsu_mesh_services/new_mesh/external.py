"""A mesh whose measurements come from programs of one's own."""

EXTERNAL = """\
# A mesh whose sensor is a program of your own. Start it with: lsu-mesh run FILE
# Send a measurement, from any program that prints numbers:  echo 1.5 | lsu-mesh publish gauge -c FILE

[mesh]
name = "external"
# an estimate is published every dt seconds while data come
dt = 0.1

# x = (position, speed): dx/dt = A x + noise_map w
[model]
continuous = true
states = ["position", "speed"]
units = ["m", "m/s"]
A = [[0.0, 1.0], [0.0, 0.0]]
noise_map = [[0.0], [1.0]]
# |w| ≤ rho at every moment, here the acceleration in m/s²: what must be right
rho = [2.0]

# a box that holds the state when the mesh starts
[model.prior]
lower = [-100.0, -10.0]
upper = [100.0, 10.0]

# a box that holds the state at every moment: a filter that was restarted may begin from it
[model.domain]
lower = [-1000.0, -50.0]
upper = [1000.0, 50.0]

[sensors.gauge]
source = "external"
C = [[1.0, 0.0]]
# |v| ≤ r: what must be right
r = [0.5]
# what is not known of the times of its measurements: "5ms" says ± 5 ms
time_error = "0ms"

[filters.main]
kind = "LSUCZ"
sensors = ["gauge"]
"""
