"""Compile every kernel once, or load it from the cache, by doing a few steps of everything.

``python -m lsu_mesh.filters.warm_up`` does it at set-up, so that no process compiles anything later. Where the cache is
empty and there are cores for it, several processes compile a share of the kernels each beforehand.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time

import numpy as np

from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.registry import FILTERS, filter_class
from lsu_mesh.filters.run import run_filter
from lsu_mesh.kernels import filter_step
from lsu_mesh.kernels.linear_programs import safe_maxima
from lsu_mesh.kernels.runtime.compile import awaits_compilation
from lsu_mesh.kernels.zonotopes.stack_reduction import settle_stack
from lsu_mesh.model import LSUModel
from lsu_mesh.simulation import simulate
from lsu_mesh.supports.orthotope import Orthotope

STEPS = 4
OPTIONS: dict[str, tuple[dict[str, object], ...]] = {
    "LSUO": ({}, {"hull": "lp"}),
    "LSUP": tuple({"time_update": name} for name in ("image", "cgz", "edges", "strips")),
    "LSUCZ": ({"max_generators": 6, "max_constraints": 2}, {"point": "nearest"}),
    "ZonotopicKalman": ({}, {"form": "predictor"}),
}
"""Options whose code differs, by kind."""
SHARES = {
    "step": ("LSUO", "LSUP", "LSUPB"),
    "programs": ("LSUCZ", "ZonotopicKalman"),
    "window": ("TruncatedKalman", "WindowMAP"),
}
"""Kinds of filters whose steps have few kernels in common; kinds that are in none are compiled last."""


def warm_up() -> float:
    """Run every filter for a few steps, with and without a noise map and a domain; the seconds that it took."""
    began = time.perf_counter()
    if awaits_compilation(filter_step.advance) and awaits_compilation(safe_maxima.maxima) and _cores() > 1:
        _compile_in_processes()
    A, B, C = [[0.9, 0.2], [-0.1, 0.8]], [[0.1], [0.2]], [[1.0, 0.0], [1.0, 1.0]]
    prior = Orthotope([-1.0, -1.0], [1.0, 1.0])
    domain = Orthotope([-1.5, -1.5], [1.5, 1.5])
    for noise_map in (None, [[1.0], [0.5]]):
        model = LSUModel(A=A, B=B, C=C, rho=0.05, r=0.1, noise_map=noise_map, domain=domain)
        data = simulate(model, STEPS, seed=1)
        for kind in FILTERS:
            for options in OPTIONS.get(kind, ({},)):
                engine = filter_class(kind)(model, prior, **options)  # type: ignore[call-arg]
                run_filter(engine, data.Y, data.U)
                _one_by_one(filter_class(kind)(model, prior, **options), data.Y, data.U)  # type: ignore[call-arg]
    _timed_steps(prior)
    _reduce_a_stack()
    return time.perf_counter() - began


def _reduce_a_stack() -> None:
    """What a fusion does to the sets of its sources."""
    square = Orthotope([-1.0, -1.0], [1.0, 1.0]).to_constrained_zonotope()
    c, G, A, b = square.intersect(square).arrays
    settle_stack(c, G, A, b, 2, 0)


def _timed_steps(prior: Orthotope) -> None:
    """A continuous model at times of its own, with feedthrough, offsets, a period and a time error."""
    flow = LSUModel.continuous(
        [[-0.1, 1.0], [0.0, -0.2]], [[0.0], [1.0]], [[1.0, 0.0], [1.0, 1.0]], rho=0.05, r=0.5,
        D=[[0.1], [0.0]], a=[0.1, 0.0], d=[0.1, 0.0], period=[0.0, 360.0],
    )  # fmt: skip
    data = simulate(flow, STEPS, seed=1, dt_ns=10**8)
    engine = filter_class("LSUO")(flow.discretised(10**8), prior)  # type: ignore[call-arg]
    run_filter(engine, data.Y, data.U, times=data.times, time_errors=10**6)


def _compile_in_processes() -> None:
    """Fill the cache by one process for each share; what they leave out, or fail at, is compiled here afterwards."""
    command = [sys.executable, "-P", "-m", "lsu_mesh.filters.warm_up"]
    children = [subprocess.Popen([*command, share], stderr=subprocess.DEVNULL) for share in SHARES]
    for child in children:
        child.wait()


def _compile_share(share: str) -> None:
    """The steps of these filters alone, in the loop where they have one."""
    model = LSUModel(A=np.eye(2), B=np.eye(2), C=np.eye(2), rho=0.05, r=0.1, domain=([-9.0, -9.0], [9.0, 9.0]))
    for kind in SHARES[share]:
        for options in OPTIONS.get(kind, ({},)):
            if share == "step" and "hull" in options:
                continue
            engine = filter_class(kind)(model, Orthotope([-1.0, -1.0], [1.0, 1.0]), **options)  # type: ignore[call-arg]
            run_filter(engine, np.zeros((STEPS, 2)), np.zeros((STEPS, 2)))
            engine.update([0.0, 0.0])
            engine.condition(engine.support.interval_hull())
    if share == "programs":
        _reduce_a_stack()


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _one_by_one(engine: Filter, Y: np.ndarray, U: np.ndarray) -> None:
    for y, u in zip(Y, U, strict=True):
        engine.predict_output()
        engine.update(y)
        engine.condition(engine.support.interval_hull())
        engine.condition(engine.support)
        support = engine.support
        support.contains(support.center)
        support.support(np.ones(2))
        support.vertices()
        support.to_constrained_zonotope().bounds()
        engine.bounds()
        engine.predict(u)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        _compile_share(sys.argv[1])
    else:
        print(f"kernels ready after {warm_up():.1f} s", file=sys.stderr)
