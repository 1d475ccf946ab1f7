"""What LSU-CZ and the zonotopic Kalman filter have in common: one compiled function for steps, runs and banks."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar, NamedTuple

import numpy as np

from lsu_mesh.array_types import Array, Matrix, Stack, Vector
from lsu_mesh.filters.compiled_loop import CompiledLoop, LoopData, LoopResult
from lsu_mesh.filters.density import Density, PointEstimate
from lsu_mesh.filters.validation import KernelModel
from lsu_mesh.kernels import set_run
from lsu_mesh.kernels.points.room import room
from lsu_mesh.kernels.run_tables import Estimates, Models, Record
from lsu_mesh.kernels.zonotopes.packed_set import HEAD, packed_size
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.reduction import Body

ALL_ROWS = set_run.OUTPUT | set_run.UPDATE | set_run.RECORD


class PackedSet(NamedTuple):
    """A set (c, G, A, b) and a box beside it; ``is_hull``: the box is met with the hull of the set."""

    body: Body
    lower: Vector
    upper: Vector
    is_hull: bool


class CompiledSets(CompiledLoop):
    """A filter whose steps are those of ``kernels/set_run.py``, as far as these can tell.

    A step of which compiled code says nothing is done in Python, with the same bits; so an error is always raised
    there.
    """

    has_compiled_points: ClassVar[bool] = False
    has_compiled_volumes: ClassVar[bool] = False
    min_share: ClassVar[int] = 2
    _arrays: KernelModel
    _estimate: PointEstimate
    _kind: set_run.Kind

    @property
    @abstractmethod
    def _packed(self) -> PackedSet:
        """What is held."""

    @abstractmethod
    def _hold_packed(self, held: PackedSet, density: Density | None) -> None:
        """Hold a set that a loop has left."""

    def _started_tables(self, n: int, m: int) -> None:
        """Memory for single steps, made once: of n states and m outputs."""
        self._outcome = np.zeros((1, 2), dtype=np.int64)
        self._nothing_kept = np.empty((1, 0, 0))
        self._no_estimates = Estimates(0, np.zeros((1, n)), np.zeros((1, n, n)))
        states, outputs = np.empty((3, 1, 1, n)), np.empty((3, 1, 1, m))
        self._record = Record(
            states[0], states[1], states[2], np.empty((1, 1)), outputs[0], outputs[1], outputs[2]
        )  # fmt: skip
        a, domain = self._arrays, self.model.domain
        self._own_models = _one_model(a, a.C, r=a.r, widths=a.widths, domain=domain, Q=self._no_estimates.covariances)

    def _stepped(
        self, action: int, arrays: KernelModel, *, P: Matrix, y: Vector, r: Vector, u: Vector, widths: Vector,
        domain: Orthotope | None = None,
    ) -> PackedSet | None:  # fmt: skip
        """One action on what is held; ``None`` where compiled code cannot tell, or finds a contradiction."""
        line = self._swept(action, arrays, P, y=y, r=r, u=u, widths=widths, domain=domain)
        return None if self._outcome[0, 1] else unpacked(line, self._packed.lower.size)

    def _output(self, arrays: KernelModel) -> tuple[Vector, Vector, tuple[Vector, Vector]] | None:
        """The interval (m,), (m,) of ``C x + v``, and the bounds of x; ``None`` where compiled code cannot tell."""
        C, r, record = arrays.C, arrays.r, self._record
        if r.size != record.y_lower.shape[2]:
            return None
        self._swept(
            set_run.OUTPUT, arrays, C, y=np.zeros(r.size), r=r, u=np.zeros(arrays.B.shape[1]), widths=arrays.widths
        )
        if self._outcome[0, 1]:
            return None
        bounds = record.lower[0, 0].copy(), record.upper[0, 0].copy()
        return record.y_lower[0, 0].copy(), record.y_upper[0, 0].copy(), bounds

    def _output_point(self, C: Matrix) -> Vector:
        """``C x`` (m,) of the point x; by the rule ``"centre"`` in the order of compiled code, which has that one."""
        point = self.point
        if self._estimate.rule != "centre":
            return np.asarray(C @ point)
        coordinates, image = point.tolist(), np.zeros(len(C))
        for i, row in enumerate(C.tolist()):
            total = 0.0
            for entry, coordinate in zip(row, coordinates, strict=True):
                total += entry * coordinate
            image[i] = total
        return image

    def _swept(
        self, action: int, arrays: KernelModel, P: Matrix, *, y: Vector, r: Vector, u: Vector, widths: Vector,
        domain: Orthotope | None = None,
    ) -> Vector:  # fmt: skip
        """The line of memory that is left; the record of the filter holds bounds and outputs."""
        held, a = self._packed, self._arrays
        constraints, generators = held.body[2].shape
        n = held.lower.size
        states = np.empty((1, packed_size(n, generators + r.size + widths.size + 3 * n, constraints + r.size + n)))
        pack(held, states[0])
        is_own = arrays is a and P is a.C and r is a.r and widths is a.widths
        models = self._own_models
        if not is_own or (domain is not self.model.domain and action == set_run.PREDICT):
            Q = self._no_estimates.covariances
            models = _one_model(arrays, P, r=r, widths=widths, domain=domain, Q=Q)
        set_run.sweep(
            action | set_run.LAST_PREDICTION, self._kind, states, models, y.reshape(1, 1, -1), u.reshape(1, 1, -1),
            self._record, self._nothing_kept, self._outcome, 0, 1, self._no_estimates, self._estimate.room,
        )  # fmt: skip
        line: Vector = states[0]
        return line

    @property
    def loop_state(self) -> Array:
        """The set in a line that is long enough for every set that a run can come to."""
        held, model = self._packed, self.model
        n = held.lower.size
        constraints, generators = held.body[2].shape
        most = self._kind.max_constraints if self._kind.family == set_run.CONSTRAINED else 0
        most = self._kind.max_generators if most < 0 else most
        columns = max(generators, self._kind.max_generators) + self._arrays.G.shape[1] + 3 * n
        line = np.zeros(packed_size(n, columns + model.output_count, max(constraints, most) + n + model.output_count))
        pack(held, line)
        return line

    def hold_loop_state(self, state: Array, density: Density | None) -> None:
        self._hold_packed(unpacked(state, self.model.state_count), density)

    def run_states(
        self, states: Array, models: Models, estimates: Estimates, data: LoopData, result: LoopResult,
        first: int, last: int, kept: Stack,
    ) -> None:  # fmt: skip
        actions = ALL_ROWS if data.updates else 0
        actions |= set_run.PREDICT | (set_run.LAST_PREDICTION if data.last_prediction else 0)
        set_run.sweep(
            actions, self._kind, states, models, data.Y, data.U, result.record, kept,
            result.outcome, first, last, estimates, room(self.model.state_count),
        )  # fmt: skip

    def estimates(self, densities: Sequence[Density | None]) -> Estimates:
        return self._estimate.tables(densities)


def pack(held: PackedSet, line: Vector) -> None:
    """Write what is held to a line of memory, as ``kernels/zonotopes/packed_set.py`` says."""
    c, G, A, b = held.body
    n, g, m = c.size, G.shape[1], b.size
    line[0], line[1], line[2] = g, m, held.is_hull
    at = HEAD + 3 * n
    np.concatenate((c, held.lower, held.upper, G.ravel(), A.ravel(), b), out=line[HEAD : at + (n + m) * g + m])


def unpacked(line: Vector, n: int) -> PackedSet:
    """What a line holds, dimension n: views of it."""
    g, m = int(line[0]), int(line[1])
    at = HEAD + 3 * n
    after = at + n * g
    end = after + m * g
    body = (line[HEAD : HEAD + n], line[at:after].reshape(n, g), line[after:end].reshape(m, g), line[end : end + m])
    return PackedSet(body, line[HEAD + n : HEAD + 2 * n], line[HEAD + 2 * n : at], bool(line[2]))


def _one_model(
    arrays: KernelModel, P: Matrix, *, r: Vector, widths: Vector, domain: Orthotope | None, Q: Stack
) -> Models:  # fmt: skip
    """A model as a bank of one takes it, with outputs P x, r and widths of a step; domain (0 or 4, n)."""
    sides = [] if domain is None else [domain.lower, domain.upper, domain.center, domain.half_widths]
    return Models(
        A=arrays.A[np.newaxis],
        B=arrays.B[np.newaxis],
        C=P[np.newaxis],
        G=arrays.G[np.newaxis],
        widths=widths[np.newaxis],
        r=r[np.newaxis],
        domains=np.array([sides]) if sides else np.empty((1, 0, len(arrays.A))),
        Q=Q,
    )
