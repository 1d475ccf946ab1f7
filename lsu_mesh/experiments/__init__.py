"""Experiments: one file per paper or claim, its tables, checks and figures. They stand on the library alone."""
