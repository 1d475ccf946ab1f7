"""Recomputing what a mesh has published, from its provenance, and comparing bit by bit."""

from lsu_mesh.mesh.verification.findings import Difference, Missing
from lsu_mesh.mesh.verification.verify import Verification, verify

__all__ = ["Difference", "Missing", "Verification", "verify"]
