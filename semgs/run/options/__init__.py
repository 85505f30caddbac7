"""Options of what is run, with their words for the command line."""
