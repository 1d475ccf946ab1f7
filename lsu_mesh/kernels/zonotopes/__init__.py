"""Zonotopes and constrained zonotopes: arithmetic, time update, reduction, the zonotopic Kalman step."""
