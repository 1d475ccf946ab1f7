"""Continuous models over a stretch of time, and what a step of such a model is charged with."""
