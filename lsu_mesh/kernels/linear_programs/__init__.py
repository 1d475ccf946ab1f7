"""Linear programs of the hulls: bounded simplex, dual bounds that are proved, vertices, the window program."""
