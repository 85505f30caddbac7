"""Programs for developers of SemGS and for making data. They are in the repository, not in the package."""
