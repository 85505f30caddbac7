"""Files: atomic writes, the mark of our own folders, pictures in and out, errors that name a file. No torch."""
