"""Plants and sensors, and the command that starts them, load neither numba nor SciPy."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

HEAVY = ("numba", "scipy", "llvmlite", "rerun")
NODES = """
import json, sys
from pathlib import Path
from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.messages import VERSION, Truth
from lsu_mesh.mesh.model_answer import encode_model, model_answer
from lsu_mesh.mesh.nodes.plant import PlantNode
from lsu_mesh.mesh.nodes.schedule import Schedule
from lsu_mesh.mesh.nodes.sensor import SimulatedSensorNode

configuration = load(Path(sys.argv[1]), json.loads(sys.argv[2]), makes_filters=False)
plant = PlantNode(configuration, "plant", "0" * 16, Schedule(0, 50.0))
sensor = SimulatedSensorNode(configuration, "s1", "1" * 16)
for node in (plant, sensor):
    node.warm_up()
    encode_model(model_answer(configuration, node.boot))
truths = [message for message in plant.advance(10**9) if isinstance(message, Truth)]
assert truths
assert all(sensor.receive(truth, 10**9) for truth in truths)
"""
RUN = """
import sys
import lsu_mesh_services.commands.run, lsu_mesh_services.commands.peer, lsu_mesh_services.peer
"""


def loaded_by(program: str, *arguments: str) -> list[str]:
    """Which heavy packages a process has loaded after a program."""
    check = f"{program}\nimport json, sys\nprint(json.dumps([name for name in {HEAVY!r} if name in sys.modules]))"
    command = [sys.executable, "-c", check, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=Path(__file__).parents[3])
    assert done.returncode == 0, done.stderr
    loaded: list[str] = json.loads(done.stdout)
    return loaded


@pytest.mark.parametrize(
    "overrides",
    [
        [],
        ["sensors.s1.D=[[0.5]]"],
        ["model.noise_map=[[1.0], [0.5], [0.0]]", "model.rho=[0.1]", 'filters.para.kind="LSUPB"'],
        ['filters.para.kind="TruncatedKalman"', 'fusion.main.sources=["box", "cz"]'],
    ],
)
def test_a_plant_and_a_sensor_load_neither_numba_nor_scipy(demo: Path, overrides: list[str]) -> None:
    assert loaded_by(NODES, str(demo), json.dumps(overrides)) == []


def test_the_commands_that_start_them_load_neither(demo: Path) -> None:
    assert loaded_by(RUN) == []


def test_a_filter_does_load_numba(demo: Path) -> None:
    """The check above can fail."""
    assert loaded_by(NODES.replace(", makes_filters=False", ""), str(demo), "[]") != []
