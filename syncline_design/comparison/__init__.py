"""What changed between two specs or verdicts, and what a diagnosis means for a design."""
