"""Where results of a measurement go: ``--save`` into the history of the repository, ``--out`` into a file."""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from lsu_mesh.experiments.machine_facts import machine_facts
from lsu_mesh.experiments.mesh_speed.bench_file import BenchFile

HISTORY = Path("benchmarks") / "history"
PACKAGES = ("numpy", "numba", "msgspec", "eclipse-zenoh", "rerun-sdk")


def refusal(options: argparse.Namespace) -> str:
    """Why results could not be kept, before anything is measured; "" where they can."""
    if options.save and not HISTORY.parent.is_dir():
        return f"--save writes into {HISTORY} of the repository: run it there, or give --out FILE"
    if options.out is not None and not Path(options.out).resolve().parent.is_dir():
        return f"--out {options.out}: there is no folder {Path(options.out).parent}"
    if options.out is not None and Path(options.out).is_dir():
        return f"--out {options.out}: is a folder; give the name of a file"
    return ""


def keep(
    options: argparse.Namespace, what: str, cases: Sequence[Mapping[str, Any]], *, tree: Path | None = None
) -> None:
    """Write the results where ``--save`` and ``--out`` say, with commit, date and machine."""
    targets = [] if options.out is None else [Path(options.out)]
    if not options.save and not targets:
        return
    date = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    file = BenchFile(what, commit_of(tree or own_tree()), date, machine_facts(PACKAGES), cases=cases)
    if options.save:
        HISTORY.mkdir(exist_ok=True)
        targets.append(HISTORY / file.file_name)
    for target in targets:
        target.write_text(file.text(), encoding="utf-8")
        print(f"results: {target}", file=sys.stderr)


def own_tree() -> Path:
    """The folder that holds the packages that run."""
    import lsu_mesh

    return Path(lsu_mesh.__file__).resolve().parent.parent


def commit_of(tree: Path) -> str | None:
    """Short hash of the commit of a checkout, with ``+`` where its files differ; ``None`` outside of git."""
    try:
        found = _git(tree, "rev-parse", "--short=8", "HEAD")
        changed = _git(tree, "status", "--porcelain", "--untracked-files=no")
    except (OSError, subprocess.CalledProcessError):
        return None
    return f"{found}+" if changed else found


def _git(tree: Path, *arguments: str) -> str:
    done = subprocess.run(["git", "-C", str(tree), *arguments], capture_output=True, text=True, check=True)
    return done.stdout.strip()
