"""The semantic branch."""
