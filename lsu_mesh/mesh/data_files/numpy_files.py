"""NumPy files: ``.npz`` with an array per column, ``.npy`` with named fields or columns 1, 2, …"""

from __future__ import annotations

import io
import warnings
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.mesh.data_files.problems import FileProblems
from lsu_mesh.mesh.data_files.typed_columns import TypedColumn

_TIME_UNIT_NS = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}


class NumpyFile:
    """The arrays of a file; headers are read first, so that nothing larger than ``max_bytes`` is unpacked.

    An array (T,) is a column of its name, an array (T, m) the columns ``name.1`` … ``name.m``.
    Raises :class:`DataFileError` for what is no such file.
    """

    def __init__(self, path: Path, max_bytes: int, problems: FileProblems, *, is_npz: bool) -> None:
        self._path, self._max, self._problems = path, max_bytes, problems
        self._source: dict[str, tuple[str, int | str | None]] = {}
        """Column: its array, and which column or field of it (None: all)."""
        self._names_of_files = self._members() if is_npz else {"": ""}
        for name in self._names_of_files:
            self._add(name)

    @property
    def names(self) -> tuple[str, ...]:
        """The columns."""
        return tuple(self._source)

    def read(self, wanted: Sequence[str]) -> list[TypedColumn]:
        """The wanted columns."""
        arrays: dict[str, NDArray[Any]] = {}
        columns = []
        for name in wanted:
            source, part = self._source[name]
            if source not in arrays:
                arrays[source] = self._array(source)
            array = arrays[source]
            taken = array if part is None else array[part] if isinstance(part, str) else array[:, part]
            columns.append(self._typed(name, taken))
        lengths = {len(column.data) for column in columns}
        if len(lengths) > 1:
            told = ", ".join(f"{column.name!r} {len(column.data)}" for column in columns)
            raise self._problems.fail(f"the columns have different numbers of rows: {told}")
        return columns

    def _members(self) -> dict[str, str]:
        members = self._guarded(lambda: zipfile.ZipFile(self._path).infolist())
        if any(member.filename == "[Content_Types].xml" for member in members):
            raise self._problems.fail("is an Excel workbook; export the sheet as CSV")
        if sum(member.file_size for member in members) > self._max:
            raise self._problems.fail(f"unpacks to more than {self._max / 2**20:.0f} MiB; split it, or keep fewer rows")
        found = {m.filename.removesuffix(".npy"): m.filename for m in members if m.filename.endswith(".npy")}
        if not found:
            raise self._problems.fail("is a zip archive without arrays of NumPy; unpack it, or write it by numpy.savez")
        return found

    def _open(self, name: str) -> io.BufferedIOBase:
        if not name and not self._names_of_files.get(name):
            return self._path.open("rb")
        with zipfile.ZipFile(self._path) as archive:
            return io.BytesIO(archive.read(self._names_of_files[name]))

    def _add(self, name: str) -> None:
        shape, dtype = self._guarded(lambda: self._header(name))
        size = int(np.prod([int(n) for n in shape], dtype=object)) * dtype.itemsize
        if size > self._max:
            raise self._problems.fail(f"declares an array of {size} bytes, at most {self._max} are read")
        fields = dtype.names
        if fields and len(shape) == 1:
            self._source |= {f"{name}.{field}" if name else field: (name, field) for field in fields}
        elif len(shape) == 1:
            self._source[name or "1"] = (name, None)
        elif len(shape) == 2:
            self._source |= {f"{name}.{i + 1}" if name else str(i + 1): (name, i) for i in range(min(shape[1], 4096))}

    def _header(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
        with self._open(name) as file:
            version = np.lib.format.read_magic(file)
            read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
            shape, _, dtype = read(file)
        return shape, dtype

    def _array(self, name: str) -> NDArray[Any]:
        def load() -> NDArray[Any]:
            with self._open(name) as file:
                return np.lib.format.read_array(file, allow_pickle=False)

        array: NDArray[Any] = self._guarded(load)
        return array

    def _typed(self, name: str, array: NDArray[Any]) -> TypedColumn:
        kind = array.dtype.kind
        if array.ndim == 1 and kind == "M" and np.datetime_data(array.dtype)[0] in _TIME_UNIT_NS:
            unit, count = np.datetime_data(array.dtype)
            return TypedColumn(name, array.astype(np.int64), np.isnat(array), _TIME_UNIT_NS[unit] * count)
        if array.ndim == 1 and kind in "iu":
            return TypedColumn(name, array.astype(np.int64), array > np.iinfo(np.int64).max)
        if array.ndim == 1 and kind == "f":
            dtype = np.dtype(np.float64) if array.dtype.itemsize > 8 else array.dtype.newbyteorder("=")
            with np.errstate(over="ignore"):  # what is too large becomes inf, which is refused by name
                narrow = array.astype(dtype)
            return TypedColumn(name, narrow, np.isnan(narrow))
        raise self._problems.fail(
            f"holds {array.dtype} of {array.ndim} dimensions; expected numbers", f"column {name!r}"
        )

    def _guarded(self, read: Any) -> Any:
        """NumPy and zipfile raise a dozen kinds of errors for damaged files, and some warnings: all mean the same."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                return read()
        except Exception as error:
            words = str(error).split("\n")[0][:120] or type(error).__name__
            raise self._problems.fail(f"is no NumPy file that can be read: {words}") from None
