"""Boxes, parallelotopes and bundles: strip update, time update, enclosure, choice of edges."""
