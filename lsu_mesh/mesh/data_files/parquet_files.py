"""Parquet files, by pyarrow, which is imported only for them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lsu_mesh.mesh.data_files.cells import MAX_CELL
from lsu_mesh.mesh.data_files.problems import FileProblems
from lsu_mesh.mesh.data_files.typed_columns import TypedColumn

_TIME_UNIT_NS = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}


class ParquetFile:
    """The columns of a Parquet file. Raises :class:`DataFileError`, also where pyarrow is not installed."""

    def __init__(self, path: Path, max_bytes: int, problems: FileProblems) -> None:
        self._problems = problems
        try:
            import pyarrow.parquet as parquet
        except ImportError:
            raise problems.fail('is Parquet, which needs pyarrow: pip install "lsu-mesh[record]"') from None
        self._file = self._guarded(lambda: parquet.ParquetFile(path))
        self.names = tuple(str(name) for name in self._guarded(lambda: self._file.schema_arrow.names))
        size = self._guarded(lambda: self._file.metadata.num_rows * 8 * max(1, len(self.names)))
        if size > 8 * max_bytes:
            raise problems.fail(f"holds {size // 8} values, more than are read at once; split it, or keep fewer rows")

    def read(self, wanted: Sequence[str]) -> list[TypedColumn]:
        """The wanted columns."""
        table = self._guarded(lambda: self._file.read(columns=list(wanted)))
        return [self._guarded(lambda name=name: self._typed(name, table.column(name))) for name in wanted]

    def _typed(self, name: str, column: Any) -> TypedColumn:
        import pyarrow as pa

        kind, missing = column.type, np.asarray(column.is_null().to_numpy(), dtype=bool)
        if pa.types.is_dictionary(kind):
            column, kind = column.cast(kind.value_type), kind.value_type
        if pa.types.is_timestamp(kind):
            whole = column.cast(pa.int64()).fill_null(0).to_numpy()
            return TypedColumn(name, whole, missing, _TIME_UNIT_NS[kind.unit])
        if pa.types.is_integer(kind):
            return TypedColumn(name, column.cast(pa.int64()).fill_null(0).to_numpy(), missing)
        if pa.types.is_floating(kind):
            values = column.to_numpy(zero_copy_only=False) if not missing.any() else column.fill_null(np.nan).to_numpy()
            return TypedColumn(name, values, missing | np.isnan(values))
        if pa.types.is_null(kind):
            return TypedColumn(name, np.full(len(missing), np.nan), missing)
        if pa.types.is_decimal(kind) or pa.types.is_string(kind) or pa.types.is_large_string(kind):
            texts = column.cast(pa.string()).to_pylist()
            cells = [(text or "").strip().encode()[: MAX_CELL + 1] for text in texts]
            return TypedColumn(name, np.array(cells, dtype=np.bytes_).reshape(len(cells)), missing)
        raise self._problems.fail(f"holds values of type {kind}; expected numbers or times", f"column {name!r}")

    def _guarded(self, read: Any) -> Any:
        """pyarrow raises errors of many kinds for damaged files; all mean the same."""
        try:
            return read()
        except Exception as error:
            if self._problems.lines():
                raise
            words = str(error).split("\n")[0][:120] or type(error).__name__
            raise self._problems.fail(f"is no Parquet file that can be read: {words}") from None
