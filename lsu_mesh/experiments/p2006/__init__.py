"""Pavelková, Kárný 2006: off-line and sliding-window MAP estimates."""
