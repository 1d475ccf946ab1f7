"""Views without reference counts, for inner loops over small arrays.

Every row or matrix that numba takes out of an array costs two atomic operations on the owner's reference count, and an
array that is passed on costs seven to eleven words; on a handful of entries both cost more than the arithmetic. So the
scratch memory of a step is one flat array, of which :func:`line` and :func:`block` are borrowed views. A borrowed view
has no owner: whoever borrows must keep the memory alive, which the caller of a kernel does by holding its arguments.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = TypeVar("Array", bound=NDArray[np.float64])


class Intrinsic:
    """A numba intrinsic that is made when the first kernel that uses it is compiled."""

    def __init__(self, define: Callable[..., Any]) -> None:
        self._define = define

    @functools.cached_property
    def _numba_type_(self) -> Any:
        from numba.core.registry import cpu_target
        from numba.extending import intrinsic

        made: Any = intrinsic(self._define)
        cpu_target.typing_context.refresh()
        return cpu_target.typing_context.resolve_value_type(made)


def _borrowed(_typing_context: Any, array: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        from numba.core import cgutils

        builders: Any = cgutils
        view = _arrays().make_array(signature.return_type)(context, builder, value=arguments[0])
        for owner in ("meminfo", "parent"):
            setattr(view, owner, builders.get_null_value(getattr(view, owner).type))
        return view._getvalue()

    return array(array), codegen


def _line(_typing_context: Any, memory: Any, start: Any, size: Any) -> Any:
    from numba.core import types

    return types.Array(memory.dtype, 1, "C")(memory, types.int64, types.int64), _view


def _block(_typing_context: Any, memory: Any, start: Any, rows: Any, columns: Any) -> Any:
    from numba.core import types

    return types.Array(memory.dtype, 2, "C")(memory, types.int64, types.int64, types.int64), _view


def _view(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    from numba.core import types

    memory, start, *shape = arguments
    owner = _arrays().make_array(signature.args[0])(context, builder, value=memory)
    view = _arrays().make_array(signature.return_type)(context, builder)
    size = context.get_abi_sizeof(context.get_data_type(signature.args[0].dtype))
    itemsize = context.get_constant(types.intp, size)
    _arrays().populate_array(
        view,
        data=builder.gep(owner.data, [start]),
        shape=shape,
        strides=[itemsize] if len(shape) == 1 else [builder.mul(itemsize, shape[1]), itemsize],
        itemsize=itemsize,
        meminfo=None,
    )
    return view._getvalue()


def _arrays() -> Any:
    from numba.np import arrayobj

    return arrayobj


if TYPE_CHECKING:

    def borrowed(array: Array) -> Array:
        """The same array without an owner; for compiled code only."""

    def line(memory: NDArray[np.float64], start: int, size: int) -> NDArray[np.float64]:
        """``memory[start : start + size]``, (size,), without an owner; for compiled code only."""

    def block(memory: NDArray[np.float64], start: int, rows: int, columns: int) -> NDArray[np.float64]:
        """``memory[start :]`` as a matrix (rows, columns) without an owner; for compiled code only."""

else:
    borrowed, line, block = Intrinsic(_borrowed), Intrinsic(_line), Intrinsic(_block)
