"""Between sets of the library and their messages; both ways bit by bit."""

from __future__ import annotations

import numpy as np

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.mesh.messages import (
    ConstrainedZonotopeMessage,
    IntersectionMessage,
    OrthotopeMessage,
    ParallelotopeMessage,
    SupportMessage,
    ZonotopeMessage,
)
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from lsu_mesh.supports.intersection import Intersection
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.parallelotope import Parallelotope
from lsu_mesh.supports.support import Support
from lsu_mesh.supports.zonotope import Zonotope


def to_support(message: SupportMessage) -> Support:
    """The set that a message describes; the message has checked its numbers."""
    if isinstance(message, OrthotopeMessage):
        return Orthotope.trusted(_vector(message.lower), _vector(message.upper))
    if isinstance(message, IntersectionMessage):
        return Intersection([to_support(part) for part in message.parts])
    center, generators = _vector(message.center), _matrix(message.generators, len(message.center))
    if isinstance(message, ParallelotopeMessage):
        return Parallelotope.trusted(center, generators)
    if isinstance(message, ZonotopeMessage):
        return Zonotope(center, generators)
    A = np.array(message.A, dtype=np.float64).reshape(len(message.b), generators.shape[1])
    return ConstrainedZonotope.of_arrays(center, generators, A, _vector(message.b))


def to_message(support: Support) -> SupportMessage:
    """The message that describes a set; raises ``TypeError`` for a set that the protocol does not know."""
    if isinstance(support, Orthotope):
        return OrthotopeMessage(lower=support.lower.tolist(), upper=support.upper.tolist())
    if isinstance(support, Intersection):
        parts = [to_message(part) for part in support.parts]
        return IntersectionMessage(parts=[part for part in parts if not isinstance(part, IntersectionMessage)])
    if isinstance(support, Parallelotope):
        return ParallelotopeMessage(center=support.center.tolist(), generators=support.generators.tolist())
    if isinstance(support, Zonotope):
        return ZonotopeMessage(center=support.center.tolist(), generators=support.generators.tolist())
    if isinstance(support, ConstrainedZonotope):
        return ConstrainedZonotopeMessage(
            center=support.center.tolist(),
            generators=support.generators.tolist(),
            A=support.A.tolist(),
            b=support.b.tolist(),
        )
    raise TypeError(f"the protocol has no message for {type(support).__name__}")


def _vector(values: list[float]) -> Vector:
    return np.array(values, dtype=np.float64)


def _matrix(rows: list[list[float]], height: int) -> Matrix:
    return np.array(rows, dtype=np.float64).reshape(height, -1)
