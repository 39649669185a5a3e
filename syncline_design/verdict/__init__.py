"""The verdict: choose where something is open, verify, recheck apart from the solvers, judge."""
