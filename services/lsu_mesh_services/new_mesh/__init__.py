"""Configurations to start from: the texts that ``lsu-mesh new`` writes."""
