"""The bounds of a continuous model that explain data of equal steps: rho as a rate, r as it is."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.errors import ModelError
from lsu_mesh.filters.window.batch_map import Record
from lsu_mesh.filters.window.structure import Structure
from lsu_mesh.identification import (
    Explanation,
    HeldOut,
    Learn,
    broken_reports,
    check_choices,
    plain_record,
    smallest,
)
from lsu_mesh.model import ContinuousModel, LSUModel

LEAST_SHARE = 1e-9
"""A column of a step's noise that adds less than this to every state is below what a linear program can tell."""


def explain_rates(
    flow: ContinuousModel,
    Y: ArrayLike,
    U: ArrayLike | None = None,
    *,
    dt_ns: int,
    learn: Learn = "both",
    margin: float = 1.2,
    share: float = 0.5,
) -> Explanation:
    """The factor of the *rate* rho, of r, or of both, that explains the first ``share`` of the data.

    ``ẋ = A x + B u + a + N w(t)``, ``|w(t)| ≤ factor · rho`` at every moment. All noises of a step of ``dt_ns`` make a
    set that grows as rho does, so that one factor of the step's noise is one of the rate, whatever dt is. That set is
    too large by its ``noise_share`` at most: the factor is a lower limit of the true one, as always.

    Parameters
    ----------
    flow:
        Its rho and r give the ratio of the half-widths. Its domain is used to name broken reports only.
    Y, U:
        Outputs (T, m) at the times 0, dt, 2 dt, …, NaN where missing; inputs (T, p), each held for one step.
    dt_ns:
        Length of every step in nanoseconds.
    learn, margin, share:
        As of :func:`lsu_mesh.identification.explain`, without ``"separate"``.

    Returns
    -------
    Explanation
        rho, smallest_rho (q,): rates; model: the one of a step with the rates found, its ``flow`` the continuous one.

    Raises
    ------
    ModelError
        An argument is wrong, or ``learn="separate"``: the columns of a step's noise are no noises of their own.
    InconsistentData
        No factor explains the data.
    """
    check_choices(learn, margin, share)
    if learn == "separate":
        raise ModelError(
            'learn = "separate" is not possible for a continuous model: several columns of a step\'s noise come from '
            'one rate; take "both", "r" or "rho"'
        )
    model, data = plain_record(_with_noise_as_state(flow, dt_ns), Y, U)
    count = min(len(data.Y), max(2, round(share * len(data.Y))))
    answer = smallest(Structure(model), _begun(Record(data.Y[:count], data.U[: count - 1])), learn)
    of_rho = 1.0 if learn == "r" else answer.objective
    more_rho, more_r = (1.0 if learn == "r" else margin), (1.0 if learn == "rho" else margin)
    found = flow.replace(rho=more_rho * of_rho * flow.rates.rho, r=more_r * answer.r)
    held_out = None
    if len(data.Y) - count >= 2:
        grown = model.replace(rho=more_rho * answer.rho, r=more_r * answer.r)
        rest = Record(data.Y[count:], data.U[count:])
        factor = smallest(Structure(grown), _begun(rest), "both").objective
        own = found.replace(D=None, d=None).discretised(dt_ns)
        broken = broken_reports(own, Record(rest.Y, rest.U[:, : flow.input_count]), count + 1)
        held_out = HeldOut(count + 1, len(data.Y), factor, broken)
    return Explanation(
        model=found.discretised(dt_ns),
        rho=np.array(found.rates.rho),
        r=np.array(found.rates.r),
        smallest_rho=of_rho * flow.rates.rho,
        smallest_r=answer.r,
        factor=answer.objective,
        margin=margin,
        learn=learn,
        theta=np.zeros(0),
        entries=(),
        first=1,
        last=count,
        held_out=held_out,
    )


def _with_noise_as_state(flow: ContinuousModel, dt_ns: int) -> LSUModel:
    """The model of a step ``x⁺ = A_h x + B_h u + a_h + G g``, ``g⁺ = w``: noises of their own, as programs need them.

    The radii of A_h, B_h and a_h are left out: they are rounding, far below what a linear program can tell.
    """
    step = flow.discretised(dt_ns)
    assert step.noise_map is not None
    reach = np.abs(step.noise_map) * step.rho
    kept = (reach > LEAST_SHARE * reach.sum(axis=1, keepdims=True)).any(axis=0)
    G, rho, n = step.noise_map[:, kept], step.rho[kept], step.state_count
    c = len(rho)
    return LSUModel(
        A=np.block([[np.array(step.A), G], [np.zeros((c, n + c))]]),
        B=None if step.B is None else np.vstack([step.B, np.zeros((c, step.input_count))]),
        C=np.hstack([step.C, np.zeros((step.output_count, c))]),
        rho=rho,
        r=step.r,
        noise_map=np.vstack([np.zeros((n, c)), np.eye(c)]),
        D=step.D,
        a=None if step.a is None else np.append(step.a, np.zeros(c)),
        d=step.d,
        period=step.period,
        outputs=step.outputs,
    )


def _begun(data: Record) -> Record:
    """The data with a step before them, of which nothing is known: the noise of the first step is then bounded too."""
    m, p = data.Y.shape[1], data.U.shape[1]
    return Record(np.vstack([np.full((1, m), np.nan), data.Y]), np.vstack([np.zeros((1, p)), data.U]))
