"""The library alone: four filters on the three-state system of Pavelková & Jirsa 2018, without any network.

The time of a step includes the volume of its set; for LSUCZ, whose polytope is enumerated for it, that is most of it.
"""

from __future__ import annotations

import time

import numpy as np

from lsu_mesh import LSUCZ, LSUO, LSUP, LSUPB, Orthotope, fuse, metrics, run_filter, simulate, systems


def main() -> None:
    model = systems.get("P3", rho=0.1, r=0.3)
    prior = Orthotope([-5.0] * 3, [5.0] * 3)
    data = simulate(model, steps=500, seed=1)
    print(f"{'filter':8}{'truth inside':>14}{'mean width':>12}{'RMSE':>8}{'CPU µs a step':>15}")
    for made in (LSUO, LSUP, LSUPB, LSUCZ):
        run_filter(made(model, prior), data.Y[:20], data.U[:20])  # load the compiled kernels
        began = time.process_time()
        run = run_filter(made(model, prior), data.Y, data.U)
        cost = (time.process_time() - began) / len(data.Y) * 1e6
        inside, error = metrics.containment(run.lower, run.upper, data.X), metrics.rmse(run.points, data.X)
        width = metrics.mean_width(run.lower, run.upper).mean()
        print(f"{made.kind:8}{inside:14.1%}{width:12.4f}{error:8.4f}{cost:15.2f}")

    box, parallelotope = LSUO(model, prior), LSUP(model, prior)
    for y, u in zip(data.Y, data.U, strict=True):
        box.update(y), parallelotope.update(y)
        last = fuse([box.support, parallelotope.support])
        box.predict(u), parallelotope.predict(u)
    print("\nfused at the last step:", np.round(last.bounds[0], 3), np.round(last.bounds[1], 3))


if __name__ == "__main__":
    main()
