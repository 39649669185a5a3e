"""What the two times of every message say of its stamps: each fault by name, and what is left."""
