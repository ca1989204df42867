"""Sequences of frames on disk."""
