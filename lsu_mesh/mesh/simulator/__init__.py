"""A whole mesh in one process under a seeded scheduler of faults, with invariants that are checked at every step."""
