"""What a finished run looked like: read from its bag, summed up in a table, drawn as a picture."""
