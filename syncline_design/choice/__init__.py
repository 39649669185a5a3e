"""The choice of a design: exact over the whole design space, by three roads that must agree."""
