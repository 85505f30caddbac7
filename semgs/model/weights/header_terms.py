"""Terms of the training data in the header of a weights file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from semgs.data.origin.terms import Terms, terms_from
from semgs.files.errors import InputError

DATA_TERMS = "data_terms"
"""Key of a header: terms of the data that the weights were trained on."""


def terms_in(metadata: Mapping[str, str], path: str | Path) -> tuple[Terms, ...]:
    """The terms of data that a header states; none if it states none.

    Raises:
        InputError: they cannot be read.
    """
    try:
        return terms_from(metadata.get(DATA_TERMS, "[]"))
    except (ValueError, TypeError, KeyError) as error:
        raise InputError(path, "terms of data as JSON", f"{type(error).__name__}: {error}", key=DATA_TERMS) from error
