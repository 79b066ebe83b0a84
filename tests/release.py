"""What a version brought, for its release: `python -m tests.release v1.0.0`.

Ends with exit code 1 and a sentence where the tag, the version that is installed and the changelog do not agree.
"""

import re
import sys
from pathlib import Path

import dsfab

CHANGELOG = Path(__file__).resolve().parent.parent / "CHANGELOG.md"


def notes(tag: str, version: str, changelog: str) -> str:
    """The part of the changelog about a version.

    Raises ValueError where the tag is not the version's, or the changelog does not know the version as released.
    """
    if tag != f"v{version}":
        raise ValueError(f"the tag is {tag}, but what is installed is {version}: install it from the tagged commit")
    parts = re.split(r"^## (.+)$", changelog, flags=re.MULTILINE)
    heads = dict(zip(parts[1::2], parts[2::2], strict=True))
    for head, text in heads.items():
        if re.fullmatch(rf"{re.escape(version)} \(\d{{4}}-\d\d-\d\d\)", head):
            return text.strip() + "\n"
    raise ValueError(f"CHANGELOG.md has no '## {version} (YEAR-MONTH-DAY)'; it has {', '.join(heads)}")


if __name__ == "__main__":
    try:
        sys.stdout.write(notes(sys.argv[1], dsfab.__version__, CHANGELOG.read_text(encoding="utf-8")))
    except ValueError as fault:
        sys.exit(str(fault))
