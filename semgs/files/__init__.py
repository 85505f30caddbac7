"""Files: atomic writes, folders that we own, images, JSON, archives, and errors that name the file. No torch."""
