"""Logs of clocks: sessions, what bounds their error, and a catalog entry that says so."""
