"""Recordings run again: recomputed and compared, through other filters, or live over Zenoh."""
