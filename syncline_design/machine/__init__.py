"""What the program asks of the machine: files read and written whole, streams, processes, time."""
