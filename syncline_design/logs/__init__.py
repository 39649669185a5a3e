"""Measured logs: reading, merging and arranging rows, until stages stand in one local level."""
