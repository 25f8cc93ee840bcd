"""Compiled functions, and their cache on disk."""
