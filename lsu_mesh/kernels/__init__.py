"""Compiled arithmetic on plain arrays; no classes, no policy."""
