"""What needs the parallelotopes themselves, on a thinned subset: P9, and the report's formula for output bounds."""

from __future__ import annotations

import numpy as np

from lsu_mesh.experiments.l2019.criteria import KINDS, START, Job, PerRun, prior
from lsu_mesh.experiments.monte_carlo import simulate_all
from lsu_mesh.filters.bank import FilterBank
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.parallelotope import Parallelotope
from lsu_mesh.supports.support import Support

SIGNED = "P outputs outside, signed sum"
EVERY = 50
"""P9 is taken at every 50th step."""


def overlap(job: Job) -> tuple[PerRun, PerRun]:
    """P9 and the outputs outside by the signed sum (43), (44), both in per cent, (levels, runs)."""
    models = job.models()
    data = simulate_all(models, job.draws(), START)
    every = [model for model in models for _ in range(job.runs)]
    priors = [prior(models[0])] * len(every)
    (box, box_options), (body, body_options) = KINDS["LSUO"], KINDS["LSUP"]
    boxes = FilterBank(box, every, priors, threads=1, **box_options)
    bodies = FilterBank(body, every, priors, threads=1, **body_options)
    shares, outside = [], []
    for k in range(job.steps):
        outside.append([_is_outside(bodies.support(i), model, data.Y[i, k]) for i, model in enumerate(every)])
        boxes.update(data.Y[:, k])
        bodies.update(data.Y[:, k])
        if (k + 1) % EVERY == 0:
            shares.append([_share_inside(bodies, boxes, i) for i in range(len(every))])
        boxes.predict(data.U[:, k])
        bodies.predict(data.U[:, k])
    shape = (len(models), job.runs)
    return 100.0 * np.mean(shares, axis=0).reshape(shape), 100.0 * np.mean(outside, axis=0).reshape(shape)


def _share_inside(bodies: FilterBank, boxes: FilterBank, i: int) -> float:
    """Volume of the parallelotope in the box ÷ its volume."""
    body, box = bodies.support(i), boxes.support(i)
    lower, upper = body.bounds()
    box_lower, box_upper = box.bounds()
    if (lower >= box_lower).all() and (upper <= box_upper).all():
        return 1.0
    return min(1.0, body.intersect(box).volume() / body.volume())


def _is_outside(body: Support, model: LSUModel, y: PerRun) -> bool:
    """Whether y leaves ``C c ± (r + Σ_i C T_i)``, where the sum should be that of absolute values."""
    assert isinstance(body, Parallelotope)
    reach = model.r + (model.C @ body.generators).sum(axis=1)
    return bool((np.abs(y - model.C @ body.center) > reach).any())
