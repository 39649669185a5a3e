"""Built-in catalogs: platforms, sensors, timestamping methods, clocks, shared hardware."""
