"""Bounds that explain recorded data: for who does not know rho and r.

The smallest half-widths with which *some* course of states passes through all data are a lower limit of the true ones:
they explain the data, they do not prove containment. A margin is put on them, and they are tried on the part of the
data that was not used. Sets that are built on such bounds are guaranteed only as far as the bounds are true.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData, ModelError
from lsu_mesh.filters.lsucz import LSUCZ
from lsu_mesh.filters.window.batch_map import Record, batch_map, record
from lsu_mesh.filters.window.program import HalfWidths, WindowSolution
from lsu_mesh.filters.window.structure import Structure, Unknown, UnknownEntries
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope

Learn = Literal["both", "r", "rho", "separate"]
LEARN: tuple[Learn, ...] = ("both", "r", "rho", "separate")
MAX_BROKEN = 1000
"""So many reports that break the bounds are named, no more."""


class Broken(NamedTuple):
    """A report that contradicts the bounds and all reports before it: step (from 1), output (from 0), value.

    ``gap``: by how much it misses; 0 where only several reports of a step together do.
    """

    step: int
    output: int
    value: float
    gap: float


class HeldOut(NamedTuple):
    """What the part of the data says that was not used.

    first, last: its steps; factor: by what the bounds must be multiplied to explain it, at most 1 where they do;
    broken: the reports that contradict, ``None`` where there was no set to start a filter from.
    """

    first: int
    last: int
    factor: float
    broken: tuple[Broken, ...] | None

    @property
    def is_explained(self) -> bool:
        """Whether the bounds explain it."""
        return self.factor <= 1.0


class Explanation(NamedTuple):
    """Bounds that explain data, and how they were found.

    model: with rho, r and the found entries in force; rho (q,), r (m,): smallest × margin; smallest_rho, smallest_r;
    factor: smallest ÷ given half-widths, nan for ``learn="separate"``; theta (t,), entries: unknown entries; first,
    last: steps that were used; held_out: the trial on the rest, or None.
    """

    model: LSUModel
    rho: Vector
    r: Vector
    smallest_rho: Vector
    smallest_r: Vector
    factor: float
    margin: float
    learn: Learn
    theta: Vector
    entries: tuple[Unknown, ...]
    first: int
    last: int
    held_out: HeldOut | None


def explain(
    model: LSUModel,
    Y: ArrayLike,
    U: ArrayLike | None = None,
    *,
    learn: Learn = "both",
    unknown: UnknownEntries = (),
    margin: float = 1.2,
    share: float = 0.5,
    prior: Orthotope | tuple[ArrayLike, ArrayLike] | None = None,
) -> Explanation:
    """Bounds, and unknown entries of A, B, C, that explain the first ``share`` of the data.

    Parameters
    ----------
    model:
        LSU model; its rho and r give the ratio of the half-widths, its domain confines the states.
    Y, U:
        Outputs (T, m), NaN where missing; inputs (T, p).
    learn:
        ``"both"``, ``"r"``, ``"rho"``: one factor of the half-widths given, the others are kept. ``"separate"``: every
        half-width for itself, Σ rho + Σ r smallest; some may come out as 0.
    unknown:
        Entries such as ``Unknown("A", 1, 2, -1.0, 1.0)``.
    margin:
        The smallest half-widths are multiplied by it, at least 1.
    share:
        Share of the data that is used, above 0; the bounds are tried on the rest.
    prior:
        A box that holds x_1, for the programs and for the filter that names broken reports; else the domain.

    Raises
    ------
    ModelError
        An argument is wrong.
    InconsistentData
        No factor explains the data: what is kept contradicts them.
    """
    check_choices(learn, margin, share)
    plain, data = plain_record(model, Y, U)
    structure = Structure(plain, unknown=unknown)
    data = record(structure, data.Y, data.U)
    box = Orthotope(*prior) if isinstance(prior, tuple) else prior
    count = min(len(data.Y), max(2, round(share * len(data.Y))))
    answer = smallest(structure, Record(data.Y[:count], data.U[: count - 1]), learn, box)
    grown_rho, grown_r = (learn != "r"), (learn != "rho")
    rho = answer.rho * (margin if grown_rho else 1.0)
    r = answer.r * (margin if grown_r else 1.0)
    found = structure.model_at(answer.theta, rho, r)
    rest = Record(data.Y[count:], data.U[count:]) if len(data.Y) - count >= 2 else None
    held_out = None if rest is None else _try(found, rest, count + 1)
    found = _restored(found, model)
    return Explanation(
        model=found,
        rho=rho,
        r=r,
        smallest_rho=answer.rho,
        smallest_r=answer.r,
        factor=np.nan if learn == "separate" else answer.objective,
        margin=margin,
        learn=learn,
        theta=answer.theta,
        entries=structure.entries,
        first=1,
        last=count,
        held_out=held_out,
    )


def plain_record(model: LSUModel, Y: ArrayLike, U: ArrayLike | None) -> tuple[LSUModel, Record]:
    """The model without D, a and d, and its data: ``y − D u − d``, and for the offset an input that is 1."""
    if not isinstance(model, LSUModel):
        raise ModelError("explain takes a discrete model; rate_identification.explain_rates takes a continuous one")
    if model.radii is not None:
        raise ModelError("explain takes no step of a continuous model; rate_identification.explain_rates does")
    if model.period is not None:
        raise ModelError("identification knows no period: unwrap the outputs first")
    checked = record(Structure(model.replace(D=None, a=None, d=None)), Y, U)
    if model.D is None and model.a is None and model.d is None:
        return model, checked
    outputs, inputs = np.array(checked.Y), checked.U
    if model.d is not None:
        outputs -= model.d
    if model.D is not None:
        last = np.array(U, dtype=np.float64).reshape(-1, model.input_count)[len(inputs) : len(outputs)]
        if len(last) == 0:
            raise ModelError(f"D ≠ 0: the last output depends on the last input; give U with {len(outputs)} rows")
        outputs -= np.vstack([inputs, last]) @ model.D.T
    if model.a is None:
        return model.replace(D=None, d=None), Record(outputs, inputs)
    B = np.zeros((model.state_count, 0)) if model.B is None else model.B
    plain = model.replace(B=np.hstack([B, model.a.reshape(-1, 1)]), a=None, D=None, d=None)
    return plain, Record(outputs, np.hstack([inputs, np.ones((len(inputs), 1))]))


def _restored(found: LSUModel, model: LSUModel) -> LSUModel:
    """The found model with the offset and the parts of the outputs where they were."""
    if model.a is not None and found.B is not None:
        p = model.input_count
        found = found.replace(B=found.B[:, :p] if p else None, inputs=model.inputs, a=found.B[:, p])
    return found if model.has_plain_outputs else found.replace(D=model.D, d=model.d)


def smallest(structure: Structure, data: Record, learn: Learn, first: Orthotope | None = None) -> WindowSolution:
    """The smallest half-widths that explain a record, by linear programming."""
    q = structure.noise_count
    shape = np.concatenate([structure.model.rho, structure.model.r])
    if learn == "separate":
        widths = HalfWidths.separate(np.zeros(shape.size), np.full(shape.size, np.inf), np.ones(shape.size))
        return batch_map(structure, data, widths, first)
    learns = np.concatenate([np.full(q, learn != "r"), np.full(shape.size - q, learn != "rho")])
    if not (shape[learns] > 0).any():
        raise ModelError(f'learn = "{learn}": all these half-widths are 0; give their ratio in rho and r')
    return batch_map(structure, data, HalfWidths.common_factor(shape, learns), first)


def check_choices(learn: str, margin: float, share: float) -> None:
    if learn not in LEARN:
        raise ModelError(f"learn must be one of {', '.join(LEARN)}, it is {learn!r}")
    if not (np.isfinite(margin) and margin >= 1.0):
        raise ModelError(f"margin must be at least 1, it is {margin}")
    if not 0.0 < share <= 1.0:
        raise ModelError(f"share must be above 0 and at most 1, it is {share}")


def _try(model: LSUModel, data: Record, first: int) -> HeldOut:
    factor = smallest(Structure(model), data, "both").objective
    return HeldOut(first, first + len(data.Y) - 1, factor, broken_reports(model, data, first))


def broken_reports(model: LSUModel, data: Record, first: int) -> tuple[Broken, ...] | None:
    """The reports that contradict the model's bounds and all reports before them, by LSU-CZ from the domain.

    A report that does is left out. ``None`` without a domain.
    """
    if model.domain is None:
        return None
    filter = LSUCZ(model, model.domain)
    broken: list[Broken] = []
    for k, y in enumerate(data.Y):
        left = np.array(y)
        while not np.isnan(left).all():
            try:
                filter.update(left)
            except InconsistentData as error:
                rows = error.rows or tuple(np.flatnonzero(~np.isnan(left)).tolist())
                broken += [Broken(first + k, i, float(y[i]), float(error.gap)) for i in rows]
                left[list(rows)] = np.nan
                continue
            break
        if len(broken) >= MAX_BROKEN:
            break
        if k + 1 < len(data.Y):
            filter.predict(data.U[k] if data.U.shape[1] else None)
    return tuple(broken)


def report(found: Explanation) -> str:
    """How the bounds were found, for people."""
    model, words = found.model, []
    kept = {"r": "rho is kept", "rho": "r is kept"}.get(found.learn, "")
    way = "each half-width for itself" if found.learn == "separate" else "one factor of the half-widths given"
    words.append(f"steps {found.first} to {found.last} were used: {way}{', ' + kept if kept else ''}")
    if np.isfinite(found.factor):
        words.append(f"the smallest factor that explains them is {found.factor:.6g}; margin {found.margin:g}")
    rows = zip(model.outputs, found.smallest_r, found.r, strict=True)
    words += [f"  r of {name}: smallest {low:.6g}, with margin {high:.6g}" for name, low, high in rows]
    noise = zip(found.smallest_rho, found.rho, strict=True)
    words += [f"  rho {i + 1}: smallest {low:.6g}, with margin {high:.6g}" for i, (low, high) in enumerate(noise)]
    words += [f"  {e.matrix}{(e.row, e.column)} = {x:.6g}" for e, x in zip(found.entries, found.theta, strict=True)]
    held = found.held_out
    if held is None:
        words.append("all data were used: nothing is left to try the bounds on")
        return "\n".join(words)
    verdict = "explained" if held.is_explained else "NOT explained"
    words.append(
        f"steps {held.first} to {held.last} were not used: {verdict}; they need {held.factor:.6g} of the bounds"
    )
    words += [
        f"  step {b.step}: {model.outputs[b.output]} = {b.value:.6g} breaks them"
        + (f" by {b.gap:.4g}" if b.gap > 0.0 else " together with others of the step")
        for b in held.broken or ()
    ]
    words.append("bounds that explain data do not prove containment: call sets that are built on them learned")
    return "\n".join(words)


def learn_choice(text: str) -> Learn:
    """The choice of this name."""
    check_choices(text, 1.0, 1.0)
    return cast("Learn", text)
