"""Changes of `mutants_auto.py` that no test can tell from the original, each with the reason."""

from __future__ import annotations

EQUIVALENT: tuple[tuple[str, str, str, str], ...] = ()
"""File, the line before, the line after, why nothing that can be observed differs."""
