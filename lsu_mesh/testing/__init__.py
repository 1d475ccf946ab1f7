"""Contracts as code: what every filter, every set and every fusion policy promises, for this library's and for yours.

Each check raises ``AssertionError`` with a sentence that names the case, its seed and step, what was found and what was
expected; it needs no test framework. The truth is exact: rational numbers, no tolerance.
"""

from __future__ import annotations

from lsu_mesh.testing.filter_contract import check_filter
from lsu_mesh.testing.policy_contract import check_policy
from lsu_mesh.testing.support_contract import check_support
from lsu_mesh.testing.support_samples import Sample

__all__ = ["Sample", "check_filter", "check_policy", "check_support"]
