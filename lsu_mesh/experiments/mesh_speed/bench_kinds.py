"""Which measurements a file of results may hold, what tells their cases apart, and which numbers are compared."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple


class Kind(NamedTuple):
    """One command of ``lsu-mesh bench``."""

    keys: tuple[str, ...]
    """Fields that tell a case from the others."""
    lower_is_better: Mapping[str, bool]
    """Fields that are compared, in the order of the table."""

    def case_words(self, case: Mapping[str, Any]) -> str:
        """A case for people."""
        words = []
        for name in self.keys:
            value = case[name]
            if isinstance(value, bool):
                words += [name] if value else []
            else:
                words.append(value if isinstance(value, str) else f"{name} {value:g}")
        return ", ".join(words)


KINDS = {
    "mesh": Kind(
        ("rate", "filters", "recorder"),
        {"p50_ratio": True, "p99_ratio": True, "p999_ratio": True, "cpu_ratio": True, "cpu_ms_per_step": True},
    ),
    "throughput": Kind(("what",), {"per_second": False}),
    "scale": Kind(("what", "count"), {"cost": True}),
    "start": Kind(("what",), {"rss_mib": True, "seconds": True, "processor_s": True}),
}
