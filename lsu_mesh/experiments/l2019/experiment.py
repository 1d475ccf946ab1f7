"""Lainová, Kuklišová Pavelková, Jirsa 2019, research report 2381: state estimation and output prediction on S1–S3."""

from __future__ import annotations

import numpy as np

from lsu_mesh.experiments.comparison import table
from lsu_mesh.experiments.l2019.claims import claims
from lsu_mesh.experiments.l2019.criteria import START, TRANSIENT, Job, criteria, with_zonotopes
from lsu_mesh.experiments.l2019.figures import figures
from lsu_mesh.experiments.l2019.overlap import EVERY, SIGNED, overlap
from lsu_mesh.experiments.l2019.priors import by_prior
from lsu_mesh.experiments.l2019.priors import rows as rows_of_priors
from lsu_mesh.experiments.l2019.seeds import MAX_RATIO, MIN_RATIO, of_seeds, ratios
from lsu_mesh.experiments.l2019.surfaces import Surfaces, every_cell, filters, ranges
from lsu_mesh.experiments.l2019.wrong_widening import Losses, losses
from lsu_mesh.experiments.outcome import Check, Outcome
from lsu_mesh.experiments.workers import Watch, part, spread, unwatched

SYSTEMS = ("S1", "S2", "S3")
LEVELS = tuple(float(level) for level in np.round(np.linspace(0.01, 0.1, 10), 2))
"""Of rho and of r."""
THIN_LEVELS = LEVELS[::3]
RUNS, STEPS = 100, 500
QUICK_RUNS, QUICK_STEPS = 3, 200
OVERLAP_RUNS = 4
THIN_RUNS, THIN_STEPS = 4, 100
TITLE = (
    "Lainová, Kuklišová Pavelková, Jirsa (2019): Approximate Bayesian state estimation and output prediction using "
    "state-space model with uniform noise, research report 2381"
)
STATEMENTS = "What the report says of its figures (section 4.5); *here*: over the cells of the grid"
RATIOS = "criteria ÷ those of the report's LSUO (geometric means over the grid), and outside in the worst cell"
ERRATA = (
    "(9): the volume of a parallelotope needs the division by |det V|.",
    "(3): `V_i z` with i ≤ k; an intersection of strips is in general no zonotope.",
    "(7): `max |ξ_i| ≤ 1`.",
    "(18): `B_i u` belongs outside the sum over j, else it is counted n times.",
    "(41)–(44): the half-length is `r + Σ_i |C T_i|`. The signed sum as printed leaves outputs outside (see above).",
    "Section 3.3, LSUP, step 2 should cite (36), not (33).",
    "The Kullback–Leibler step does not explain states outside LSUP's bounds: its minimiser contains the support.",
    "Section 4.5 speaks of P7 and P6 where P7 and P8 are meant.",
)


def run(quick: bool = False, seed: int = 1, watch: Watch = unwatched) -> Outcome:
    """All criteria over the grid, on all cores."""
    runs, steps = (QUICK_RUNS, QUICK_STEPS) if quick else (RUNS, STEPS)
    surfaces = full_grid(seed, runs, steps, watch)
    few, short = (1, THIN_STEPS // 2) if quick else (THIN_RUNS, THIN_STEPS)
    thin = thin_grid(seed, few, short, part(watch, 0.78, 0.9))
    levels = f"ρ, r ∈ {{{', '.join(f'{level:g}' for level in THIN_LEVELS)}}}"
    job = Job(system="S2", rho=0.0, levels=(), runs=runs, steps=steps, seed=seed)
    priors = by_prior(THIN_LEVELS, job, part(watch, 0.9, 0.94))
    rows = [*claims(surfaces, wrongly_widened(seed, few, steps, part(watch, 0.94, 0.97))), *rows_of_priors(priors)]
    if steps >= STEPS:
        rows += of_seeds(ratios(seed, runs, steps, part(watch, 0.97, 1.0)))
    drawn, captions = figures(surfaces)
    tables = [
        table("l2019-statements", STATEMENTS, ["system", "criterion"], rows),
        ranges(surfaces),
        filters(surfaces, "l2019-filters", f"All filters, {runs} runs × {steps} steps: {RATIOS}"),
        filters(
            thin, "l2019-thinned", f"With LSUCZ, on the thinned grid {levels}, {few} runs × {short} steps: {RATIOS}"
        ),
        every_cell(surfaces),
    ]
    return Outcome(
        tables=tables,
        checks=checks(surfaces, thin, steps),
        figures=drawn,
        title=TITLE,
        notes=_notes(runs, steps, seed),
        captions=captions,
        errata=ERRATA,
    )


def full_grid(seed: int, runs: int, steps: int, watch: Watch = unwatched) -> Surfaces:
    """The criteria of all filters with a compiled bank in all cells; P9 over fewer runs and steps."""
    jobs = [
        Job(system=system, rho=rho, levels=LEVELS, runs=runs, steps=steps, seed=seed)
        for system in SYSTEMS
        for rho in LEVELS
    ]
    found = spread(criteria, jobs, part(watch, 0.0, 0.7))
    few = [job._replace(runs=min(OVERLAP_RUNS, runs)) for job in jobs]
    surfaces = Surfaces(LEVELS, LEVELS)
    for row, (inside, outside) in zip(found, spread(overlap, few, part(watch, 0.7, 0.78)), strict=True):
        row["", "P9"] = inside
        row["", SIGNED] = outside
    for i, system in enumerate(SYSTEMS):
        surfaces.add(system, found[i * len(LEVELS) : (i + 1) * len(LEVELS)])
    return surfaces


def thin_grid(seed: int, runs: int, steps: int, watch: Watch = unwatched) -> Surfaces:
    """The criteria of single filters, with LSUCZ, in every third row and column of the grid."""
    jobs = [
        Job(system=system, rho=rho, levels=THIN_LEVELS, runs=runs, steps=steps, seed=seed)
        for system in SYSTEMS
        for rho in THIN_LEVELS
    ]
    found = spread(with_zonotopes, jobs, watch)
    surfaces = Surfaces(THIN_LEVELS, THIN_LEVELS)
    for i, system in enumerate(SYSTEMS):
        surfaces.add(system, found[i * len(THIN_LEVELS) : (i + 1) * len(THIN_LEVELS)])
    return surfaces


def wrongly_widened(seed: int, runs: int, steps: int, watch: Watch = unwatched) -> dict[str, list[Losses]]:
    """What LSUP loses with the wrong time update, by system, at the corners of the grid."""
    ends = (LEVELS[0], LEVELS[-1])
    jobs = [
        Job(system=system, rho=rho, levels=(r,), runs=runs, steps=steps, seed=seed)
        for system in SYSTEMS
        for rho in ends
        for r in ends
    ]
    found = spread(losses, jobs, watch)
    return {system: found[i * len(ends) ** 2 : (i + 1) * len(ends) ** 2] for i, system in enumerate(SYSTEMS)}


def checks(surfaces: Surfaces, thin: Surfaces, steps: int) -> list[Check]:
    """The numbers to reach; those of volumes are of the grid's corners, those of S2's outputs of the full record."""
    outside = max(
        float(values.max())
        for grid in (surfaces, thin)
        for key, values in grid.mean.items()
        if key[2] in ("P states outside", "P outputs outside")
    )
    volumes = surfaces.of("S1", "V1") / surfaces.of("S1", "V2")
    corners = volumes[np.ix_([0, -1], [0, -1])]
    outputs = surfaces.of("S2", "T3") / surfaces.of("S2", "T4")
    right = surfaces.of("S1", "T4") / surfaces.of("S1", "T3")
    of_the_full_record = [
        Check("l2019: S2, output TNSE LSUO ÷ LSUP, smallest cell", float(outputs.min()), MIN_RATIO, "at least"),
        Check("l2019: S2, output TNSE LSUO ÷ LSUP, largest cell", float(outputs.max()), MAX_RATIO),
    ]
    return [
        Check("l2019: states or outputs outside, any filter and cell, %", outside, 0.0),
        Check("l2019: S1, volume LSUO ÷ LSUP, smallest corner of the grid", float(corners.min()), 280.0, "at least"),
        Check("l2019: S1, volume LSUO ÷ LSUP, largest corner of the grid", float(corners.max()), 1375.0),
        Check("l2019: S1, T4 ÷ T3 with the right predictor, farthest from 1", float(np.abs(right - 1.0).max()), 0.1),
        *(of_the_full_record if steps >= STEPS else ()),
    ]


def _notes(runs: int, steps: int, seed: int) -> str:
    return (
        f"Systems S1, S2, S3; ρ and r on the grid {LEVELS[0]:g}, {LEVELS[1]:g}, …, {LEVELS[-1]:g}; {runs} Monte Carlo "
        f"runs × {steps} steps, u ~ N(0, 1), seed {seed}, the same noise sequences in every cell. The report gives no "
        f"prior: here the box ±{START:g} in every state, from which x_1 is drawn. Volumes and lengths are means over "
        f"the steps after the first {TRANSIENT}, so that the prior does not show; everything else is over all steps. "
        f"LSUO is the report's (the hull is not met with the prediction), LSUP its parallelotope along the image of "
        f"the edges. P9, a ratio of volumes of polytopes, is taken at every {EVERY}th step of {OVERLAP_RUNS} runs. The "
        "report shows surfaces without numbers, so its text is what can be compared.\n\n"
        "S2 measures the position alone. Its velocity is never seen by LSUO, so the error over all states is that of "
        "the velocity. Two statements on T1 and T2 do not hold over all states. Both hold together if the error is "
        "summed over the measured position alone, so that may be what the report did."
    )
