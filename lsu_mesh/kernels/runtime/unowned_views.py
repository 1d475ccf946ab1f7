"""Views without reference counts, for inner loops over small arrays.

Every row or matrix that numba takes out of an array costs two atomic operations on the owner's reference count, and an
array that is passed on costs seven to eleven words; on a handful of entries both cost more than the arithmetic. So the
scratch memory of a step is one flat array, of which :func:`line` and :func:`block` are borrowed views. A borrowed view
has no owner: whoever borrows must keep the memory alive, which the caller of a kernel does by holding its arguments.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numba.core import cgutils, types
from numba.extending import intrinsic
from numba.np import arrayobj
from numpy.typing import NDArray

Array = TypeVar("Array", bound=NDArray[np.float64])
_arrays: Any = arrayobj
_builders: Any = cgutils


def _borrowed(_typing_context: Any, array: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        view = _arrays.make_array(signature.return_type)(context, builder, value=arguments[0])
        for owner in ("meminfo", "parent"):
            setattr(view, owner, _builders.get_null_value(getattr(view, owner).type))
        return view._getvalue()

    return array(array), codegen


def _line(_typing_context: Any, memory: Any, start: Any, size: Any) -> Any:
    return types.Array(memory.dtype, 1, "C")(memory, types.int64, types.int64), _view


def _block(_typing_context: Any, memory: Any, start: Any, rows: Any, columns: Any) -> Any:
    return types.Array(memory.dtype, 2, "C")(memory, types.int64, types.int64, types.int64), _view


def _view(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    memory, start, *shape = arguments
    owner = _arrays.make_array(signature.args[0])(context, builder, value=memory)
    view = _arrays.make_array(signature.return_type)(context, builder)
    size = context.get_abi_sizeof(context.get_data_type(signature.args[0].dtype))
    itemsize = context.get_constant(types.intp, size)
    _arrays.populate_array(
        view,
        data=builder.gep(owner.data, [start]),
        shape=shape,
        strides=[itemsize] if len(shape) == 1 else [builder.mul(itemsize, shape[1]), itemsize],
        itemsize=itemsize,
        meminfo=None,
    )
    return view._getvalue()


if TYPE_CHECKING:

    def borrowed(array: Array) -> Array:
        """The same array without an owner; for compiled code only."""

    def line(memory: NDArray[np.float64], start: int, size: int) -> NDArray[np.float64]:
        """``memory[start : start + size]``, (size,), without an owner; for compiled code only."""

    def block(memory: NDArray[np.float64], start: int, rows: int, columns: int) -> NDArray[np.float64]:
        """``memory[start :]`` as a matrix (rows, columns) without an owner; for compiled code only."""

else:
    borrowed, line, block = intrinsic(_borrowed), intrinsic(_line), intrinsic(_block)
