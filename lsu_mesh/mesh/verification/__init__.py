"""Recomputing what a mesh has published, from its provenance, and comparing bit by bit."""

from lsu_mesh.mesh.verification.verify import Difference, Verification, verify

__all__ = ["Difference", "Verification", "verify"]
