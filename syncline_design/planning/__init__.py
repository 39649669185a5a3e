"""The drive that would tell: legs that a platform can do, and what a log of them would show."""
