"""What a finished run looked like, summed up in a table."""
