"""How much the ratio of output errors on S2 depends on the seed: its smallest cell, over ten seeds.

LSUO never measures the velocity of S2, so its error is that of a random walk from the start; even the mean over 100
runs moves by a tenth and more from seed to seed.
"""

from __future__ import annotations

from collections.abc import Sequence

from lsu_mesh.experiments.comparison import Row, ours, stated
from lsu_mesh.experiments.l2019.criteria import KINDS, START, Job, of_a_filter, run_bank
from lsu_mesh.experiments.l2019.priors import ABOUT
from lsu_mesh.experiments.monte_carlo import simulate_all
from lsu_mesh.experiments.outcome import Spread
from lsu_mesh.experiments.workers import Watch, spread, unwatched

SEEDS = 10
MIN_RATIO, MAX_RATIO = 75.0, 410.0
"""The range to reach, T3 ÷ T4 of S2 over the grid."""
NOISE = 0.1
"""ρ and r of the corner in which the ratio is about the smallest."""


def ratio(job: Job) -> float:
    """T3 ÷ T4 in the one cell of a job."""
    models = job.models()
    data = simulate_all(models, job.draws(), START)
    box, body = (
        of_a_filter(run_bank(*KINDS[name], models, job.runs, data), data, models[0].C)["T outputs"].mean()
        for name in ("LSUO", "LSUP")
    )
    return float(box / body)


def ratios(seed: int, runs: int, steps: int, watch: Watch = unwatched) -> dict[int, float]:
    """By seed."""
    seeds = range(seed, seed + SEEDS)
    jobs = [Job(system="S2", rho=NOISE, levels=(NOISE,), runs=runs, steps=steps, seed=one) for one in seeds]
    return dict(zip(seeds, spread(ratio, jobs, watch), strict=True))


def of_seeds(found: dict[int, float]) -> list[Row]:
    """The ratio over seeds, and which of them are below the range to reach."""
    below = [seed for seed, value in found.items() if value < MIN_RATIO]
    values = Spread.of(list(found.values()))
    where = f"T3 ÷ T4 at ρ = r = {NOISE:g}, seeds {min(found)} to {max(found)}"
    told = f"{_listed(below)}, down to {min(found.values()):.3g}" if below else "none"
    return [
        stated(("S2", where), "about 100", values, holds=ABOUT[0] <= values.mean <= ABOUT[1]),
        ours(("S2", f"{where}: those below {MIN_RATIO:g}"), told),
    ]


def _listed(seeds: Sequence[int]) -> str:
    return ", ".join(map(str, seeds))
