"""Interval arithmetic with outward rounding: elementary functions without libm, and tapes of operations."""
