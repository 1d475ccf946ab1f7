"""Nonlinear models: expressions, their derivatives, and linear steps that enclose them."""
