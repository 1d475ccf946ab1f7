"""The checkout whose programs are measured: this one, or another one beside it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

PROGRAMS = ("lsu_mesh/__init__.py", "services/lsu_mesh_services/__main__.py")
"""What a checkout holds."""


class DoesNotCompile(Exception):
    """The kernels of a checkout do not compile; the message is what Python said."""


def tree_refusal(tree: str | None) -> str:
    """Why a folder cannot be measured; "" where it can."""
    absent = [] if tree is None else [name for name in PROGRAMS if not (Path(tree) / name).is_file()]
    return f"--tree {tree}: is no checkout of lsu-mesh; there is no {absent[0]}" if absent else ""


def environment_of(tree: Path | None) -> dict[str, str]:
    """Variables under which Python imports the packages of a checkout; ``None``: those of this process."""
    paths = {} if tree is None else {"PYTHONPATH": os.pathsep.join([str(tree), str(tree / "services")])}
    return {**os.environ, "PYTHONSAFEPATH": "1", **paths}


def compile_kernels(tree: Path | None) -> None:
    """Compile once, in a process of the checkout, so that its peers only load; :class:`DoesNotCompile`."""
    command = [sys.executable, "-P", "-m", "lsu_mesh.filters.warm_up"]
    try:
        subprocess.run(command, env=environment_of(tree), capture_output=True, text=True, check=True)
    except subprocess.CalledProcessError as error:
        raise DoesNotCompile(f"the kernels do not compile:\n{error.stderr}") from None
