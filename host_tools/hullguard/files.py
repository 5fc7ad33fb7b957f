"""Questions about files whose names are a user's."""

from __future__ import annotations

from pathlib import Path


def is_file(path: Path) -> bool:
    """Is there such a file? No, too, for a name that the file system refuses, where Path.is_file() raises an error."""
    try:
        return path.is_file()
    except OSError:
        return False
