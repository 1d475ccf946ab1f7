"""Pavelková, Kárný 2014: joint estimation of states and parameters."""
