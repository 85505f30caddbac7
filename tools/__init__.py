"""Programs for those who work on SemGS or make data for it. They are in the repository, not in the package."""
