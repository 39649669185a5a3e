"""The paper: its printed tables, its figures, and their reproduction cell by cell."""
