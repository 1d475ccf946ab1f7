"""The four steps that every filter has."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support

Vector = NDArray[np.float64]
Guarantee = Literal["declared", "learned", "none"]


class OutputPrediction(NamedTuple):
    """Interval (lower, upper) that surely holds y_k before it is measured, and its point estimate; each (m,)."""

    lower: Vector
    upper: Vector
    point: Vector


class Filter(ABC):
    """A recursive estimator of x_k for ``x⁺ = A x + B u + N w``, ``y = C x + v``, ``|w| ≤ rho``, ``|v| ≤ r``.

    Between steps the filter holds one set: before :meth:`update` the prior or prediction of x_k, after it the
    posterior.
    """

    kind: ClassVar[str]
    algorithm: ClassVar[int] = 1
    """Number of the arithmetic of this kind, raised whenever the bits of its sets change; published with each set."""
    guarantee: ClassVar[Guarantee] = "declared"
    """``"declared"``: the sets hold the state as long as the declared bounds do. ``"none"``: they are estimates."""

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
        """Point estimate (n,) of the state now."""

    @abstractmethod
    def predict_output(self) -> OutputPrediction:
        """Interval of y_k before the data, ``C X ⊕ [−r, r]``."""

    @abstractmethod
    def update(self, y: ArrayLike, r: ArrayLike | None = None) -> Support:
        """Data update with y (m,); NaN is a missing output; r (m,) holds for this step only.

        Raises
        ------
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
    def condition(self, support: Support) -> float:
        """Bayesian transfer: keep ``self ∩ support`` (or a set of this class that holds it).

        Returns the gain ``ln vol(before) − ln vol(after)`` in nats, never negative. ``InconsistentData`` on a proved
        empty intersection; the filter then keeps the state that it had.
        """

    @abstractmethod
    def reset(self, support: Support) -> None:
        """Start again from a set that is known to hold the state now."""

    def resume(self, support: Support, lower: Vector, upper: Vector) -> None:
        """Go on from what a filter of this class said: its :attr:`support` and its :meth:`bounds` (n,), (n,).

        The later sets are those of that filter, bit by bit, if :attr:`is_resumable`.
        """
        self.reset(support)

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

    def volume(self) -> float:
        """Volume of :attr:`support`."""
        return self.support.volume()
