"""After its rehearsal a peer loads no kernel for transfers, for starts from sets, or for its reach."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from lsu_mesh import LSUO, LSUModel, Orthotope
from lsu_mesh.mesh.estimation.warm_up import warm_up

SCRIPT = """
import gc
import sys
from pathlib import Path

import numpy as np
from numba.core.dispatcher import Dispatcher

from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.nodes.filter import FilterNode
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.parallelotope import Parallelotope

def loaded():
    kernels = [kernel for kernel in gc.get_objects() if isinstance(kernel, Dispatcher)]
    return {(kernel.py_func.__name__, str(signature)) for kernel in kernels for signature in kernel.signatures}

node = FilterNode(load(Path(sys.argv[1])), sys.argv[2], "0" * 16)
before = node.engine.bounds()
node.warm_up()
assert np.array_equal(before, node.engine.bounds()), "left as it was"
known = loaded()
box = Orthotope([-4.0] * 3, [4.0] * 3)
slab = Orthotope([-0.1, -3.0, -3.0], [0.1, 3.0, 3.0])
for other in (Parallelotope([0.0] * 3, 5.0 * np.eye(3)), box, node.engine.support, slab):
    node.engine.condition(other)
    node.engine.predict(np.zeros(1))
    node.engine.reset(other)
    node.engine.predict(np.zeros(1))
node.held.reach.begin(box)
node.held.reach.predict(np.zeros(1), 1)
print(sorted(loaded() - known))
"""


@pytest.mark.parametrize("name", ["box", "para", "cz"])
def test_nothing_is_loaded_after_the_rehearsal(name: str, demo: Path) -> None:
    command = [sys.executable, "-c", SCRIPT, str(demo), name]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[]"


def test_a_state_that_leaves_its_domain_in_the_rehearsal_ends_only_that() -> None:
    model = LSUModel(A=[[2.0]], B=None, C=[[1.0]], rho=[0.1], r=[0.5], domain=Orthotope([0.0], [9.0]))
    engine = LSUO(model, Orthotope([4.0], [5.0]))
    before = np.array(engine.bounds())
    demo_like = SimpleNamespace(input_box=None, has_one_model=True, continuous=None, input_delay_ns=0)
    warm_up(engine, demo_like)  # type: ignore[arg-type]
    assert np.array_equal(before, engine.bounds())


FUSION = """
from types import SimpleNamespace

from lsu_mesh.fusion.policies import POLICIES
from lsu_mesh.mesh.estimation.fusion_step import Source, fusion_step
from lsu_mesh.mesh.nodes.fusion import FusionNode

node = FusionNode(load(Path(sys.argv[1])), "main", "0" * 16)
before = node.engine.snapshot()
node.warm_up()
assert node.engine.snapshot() is before, "left as it was"
known = loaded()
slanted = Parallelotope([0.0] * 3, np.eye(3) + 0.2)
bundle = Orthotope([-0.1, -3.0, -3.0], [0.1, 3.0, 3.0]).to_constrained_zonotope().meet_strips([[1.0] * 3], [0.0], [0.5])
sources = []
for name, support in (("box", slanted.interval_hull()), ("cz", bundle), ("para", slanted)):
    lower, upper = (side.tolist() for side in support.bounds())
    sources.append(Source(name, SimpleNamespace(name=name, lower=lower, upper=upper), support))
for _ in range(3):
    assert fusion_step(node.engine, sources, POLICIES["intersect"], 0, has_prediction=True).basis == "both"
    node.engine.predict(np.zeros(1))
print(sorted(loaded() - known))
"""


def test_no_kernel_is_loaded_by_the_first_fusion(root: Path) -> None:
    script = SCRIPT.split("node = ")[0] + FUSION
    command = [sys.executable, "-P", "-c", script, str(root / "services" / "lsu_mesh_services" / "demo.toml")]
    answer = subprocess.run(command, capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]", answer.stdout
