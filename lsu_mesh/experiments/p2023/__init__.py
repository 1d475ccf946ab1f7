"""Kuklišová Pavelková 2023: LSU-CZ on constrained zonotopes."""
