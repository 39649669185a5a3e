"""Many logs of one system: what they tell together, and since when something is another."""
