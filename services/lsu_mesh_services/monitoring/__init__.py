"""Listening to a mesh and summing up what was heard."""
