"""One command for many scenes: which are done, which failed, and who works on the rest."""
