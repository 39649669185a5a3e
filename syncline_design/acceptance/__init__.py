"""Does the built system have what its verdict rests on: assumptions against evidence."""
