"""The four steps that every filter has."""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from typing import ClassVar, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import ModelError
from lsu_mesh.filters.density import Density
from lsu_mesh.filters.point_rule import PointRule
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support

Guarantee = Literal["declared", "learned", "none"]
GainOf = Literal["support", "hull"]
"""Whose volumes the gain of a transfer compares."""


class OutputPrediction(NamedTuple):
    """Interval (lower, upper) that surely holds y_k before it is measured, and its point estimate; each (m,)."""

    lower: Vector
    upper: Vector
    point: Vector


class Filter(ABC):
    """A recursive estimator of x: ``x⁺ = A x + B u + a + N w``, ``y = C x + D u + d + v``, ``|w| ≤ rho``, ``|v| ≤ r``.

    Between steps the filter holds one set: before :meth:`update` the prior or prediction of x_k, after it the
    posterior.
    """

    kind: ClassVar[str]
    """Name in errors; a class that states none is called by its class name."""
    algorithm: ClassVar[int] = 1
    """Number of the arithmetic of this kind, raised whenever the bits of its sets change; published with each set."""
    conditioning: ClassVar[int] = 1
    """Number of the arithmetic of :meth:`condition` alone; what a filter with transfers publishes rises with it."""
    skips_met: bool = True
    """Whether a set that holds the one met last is left out; a fusion, whose sources may be equal, goes through all."""
    smooths: ClassVar[bool] = False
    """Whether the class has the option ``lag`` and holds the sets of so many earlier states too."""
    guarantee: ClassVar[Guarantee]
    """``"declared"``: the sets hold the state as long as the declared bounds do. ``"none"``: they are estimates.

    It has no default: a filter promises only what its author has written down.
    """

    def __init_subclass__(cls) -> None:
        """Raises ``TypeError`` for a class that can be made and does not state its guarantee."""
        super().__init_subclass__()
        if "kind" not in cls.__dict__:
            cls.kind = cls.__name__
        stated = getattr(cls, "guarantee", None)
        if stated is None and inspect.isabstract(cls):
            return
        if stated not in get_args(Guarantee):
            found = "states no guarantee" if stated is None else f"states the guarantee {stated!r}"
            raise TypeError(
                f"the filter {cls.__module__}.{cls.__qualname__} {found}; write in its class "
                '`guarantee = "declared"` if its sets hold the state whenever the declared bounds hold '
                '(lsu_mesh.testing.check_filter tests it), or `guarantee = "none"` if they are estimates'
            )

    @property
    @abstractmethod
    def model(self) -> LSUModel:
        """The model in force when no step says otherwise."""

    @property
    @abstractmethod
    def support(self) -> Support:
        """The set that holds the state now."""

    @property
    @abstractmethod
    def point(self) -> Vector:
        """Point estimate (n,) of the state now, by the :attr:`point_rule`."""

    @property
    def point_rule(self) -> PointRule:
        """``"mean"`` and ``"nearest"``: :attr:`point` is never proved to lie outside of :attr:`support` or bounds.

        ``"centre"``: it may, as the centre of a hull may; what a class says that promises nothing.
        """
        return "centre"

    @property
    def density(self) -> Density | None:
        """Mean and covariance beside the set that the point estimate is taken from; ``None`` where there are none."""
        return None

    @abstractmethod
    def predict_output(self, u: ArrayLike | Orthotope | None = None, model: LSUModel | None = None) -> OutputPrediction:
        """Interval of y_k before the data, ``C X ⊕ D u ⊕ d ⊕ [−r, r]``; of a periodic output a value not wrapped.

        u (p,), or a box of it, is needed where D ≠ 0, else not read; the outputs are those of ``model`` where given.
        """

    @abstractmethod
    def update(
        self,
        y: ArrayLike,
        r: ArrayLike | None = None,
        model: LSUModel | None = None,
        u: ArrayLike | Orthotope | None = None,
    ) -> Support:
        """Data update with y (m,); NaN is a missing output; r (m,) holds for this step only.

        ``model``: its outputs (C, D, d, period, r) are those of this step only, of another sensor for example. ``u``
        (p,): the input that acts from this moment on, or a box that holds it; needed where D ≠ 0, else not read.

        Raises
        ------
        ModelError
            D ≠ 0 and no u is given, or an argument does not fit.
        InconsistentData
            The strips are proved to miss the set; the filter keeps the state that it had.
        """

    @abstractmethod
    def predict(
        self,
        u: ArrayLike | Orthotope | None = None,
        rho: ArrayLike | None = None,
        model: LSUModel | None = None,
    ) -> Support:
        """Time update k → k+1 with input u (p,), or a box of unknown inputs; rho and model are of this step only.

        The result is met with ``model.domain``. ``u=None`` with a model that has inputs raises ``ModelError``.
        """

    @abstractmethod
    def condition(self, support: Support, gain: GainOf | None = "support") -> float:
        """Bayesian transfer: keep ``self ∩ support`` (or a set of this class that holds it).

        Returns the gain ``ln vol(before) − ln vol(after)`` in nats, never negative: with ``gain="support"`` of the
        supports up to three states, above and for flat sets of the interval hulls, by their sides that have a width;
        with ``"hull"`` of the hulls; with ``None`` of what the class measures at no cost.

        The same set again changes nothing, bit by bit, until data, a time update or another set have come in between.
        ``InconsistentData`` on a proved empty intersection; the filter then keeps the state that it had.
        """

    @property
    def last_met(self) -> Support | None:
        """The set that was met last, where nothing has changed the own one since; part of :meth:`snapshot`."""
        return None

    @last_met.setter
    def last_met(self, support: Support) -> None:
        """A class that remembers none goes through each set again."""
        del support

    @abstractmethod
    def reset(self, support: Support) -> None:
        """Start again from a set that is known to hold the state now."""

    def resume(self, support: Support, lower: Vector, upper: Vector) -> None:
        """Continue from what a filter of this class published: its :attr:`support` and its :meth:`bounds` (n,), (n,).

        The later sets are those of that filter, bit by bit, if :attr:`is_resumable`; the later points are with its
        density, see :meth:`take_density`.
        """
        self.reset(support)

    def take_density(self, density: Density) -> None:  # noqa: B027  a filter without a density has nothing to take
        """After :meth:`resume` or :meth:`reset`: go on from this :attr:`density`, where the filter has one at all."""

    @property
    def is_resumable(self) -> bool:
        """Whether support and bounds are all that later sets depend on."""
        return False

    @abstractmethod
    def snapshot(self) -> object:
        """The state of the filter as an immutable value, for :meth:`restore`."""

    @abstractmethod
    def restore(self, snapshot: object) -> None:
        """Return to a state taken by :meth:`snapshot`, bit by bit."""

    @property
    def half_widths(self) -> tuple[Vector, Vector]:
        """Half-widths (q,), (m,) of the noise that the filter goes by: the model's, or its own estimates."""
        return np.array(self.model.rho), np.array(self.model.r)

    def bounds(self) -> tuple[Vector, Vector]:
        """Interval hull ``(lower, upper)`` of the state now."""
        return self.support.bounds()

    @property
    def lag(self) -> int:
        """L: so many steps back :meth:`smoothed` goes; 0 where the class does not smooth."""
        return 0

    @property
    def held_steps(self) -> int:
        """So many steps back states are held now, at most :attr:`lag`; fewer after a start."""
        return 0

    def smoothed(self, steps: int) -> Support:
        """The set of x_{k−steps} given all data so far, ``0 ≤ steps ≤ held_steps``; else ``ModelError``."""
        self._check_held(steps)
        return self.support

    def smoothed_bounds(self, steps: int) -> tuple[Vector, Vector]:
        """Bounds (n,), (n,) of x_{k−steps} given all data so far; ``ModelError`` as :meth:`smoothed`."""
        self._check_held(steps)
        return self.bounds()

    def _check_held(self, steps: int) -> None:
        if not 0 <= steps <= self.held_steps:
            raise ModelError(
                f"the set of {steps} steps ago is not held: the lag is {self.lag}, {self.held_steps} steps are there"
            )

    def volume(self) -> float:
        """Volume of :attr:`support`."""
        return self.support.volume()
