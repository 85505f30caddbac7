"""`python -m semgs`, the same as the command `semgs`."""

from __future__ import annotations

import sys

from semgs.cli.main import main

if __name__ == "__main__":  # worker processes import this module under another name
    sys.exit(main())
