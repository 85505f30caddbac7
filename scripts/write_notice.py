"""Write the root's NOTICE from the ATTRIBUTION.md of the rooms that weights are trained in.

    python scripts/write_notice.py ROOMS/ATTRIBUTION.md [...]

`semgs rooms --assets` writes ATTRIBUTION.md beside its scenes. Trained live, rooms of the same seed and assets have the same works.
"""

from __future__ import annotations

import sys
from pathlib import Path

from semgs.files.atomic import write_text
from semgs.rooms.assets.notice import notice

if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit("usage: python scripts/write_notice.py ATTRIBUTION.md [...]")
    try:
        text = notice([Path(one).read_text(encoding="utf-8") for one in sys.argv[1:]])
    except (OSError, ValueError) as error:
        sys.exit(f"{' '.join(sys.argv[1:])}: {error}")
    write_text(Path(__file__).resolve().parent.parent / "NOTICE", text)
