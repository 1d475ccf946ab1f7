"""Pavelková, Jirsa 2018: LSUO beside a window estimator and the zonotopic Kalman filter."""
