"""A release is made of a version that tag, code and changelog agree on."""

import pytest

from tests.release import notes

CHANGELOG = """# Changelog

## 1.1.0 (unreleased)

* Not yet.

## 1.0.0 (2026-11-25)

* Domes.

## 0.9.0 (2026-10-01)

* Vaults.
"""


def test_the_notes_of_a_release_are_its_part_of_the_changelog():
    assert notes("v1.0.0", "1.0.0", CHANGELOG) == "* Domes.\n"
    assert notes("v0.9.0", "0.9.0", CHANGELOG) == "* Vaults.\n"


@pytest.mark.parametrize(
    ("tag", "version", "told"),
    [
        ("v1.0.1", "1.0.0", "the tag is v1.0.1, the code says 1.0.0"),
        ("1.0.0", "1.0.0", "the tag is 1.0.0"),
        ("v1.1.0", "1.1.0", "no '## 1.1.0"),
        ("v1x0.0", "1x0.0", "no '## 1x0.0"),
    ],
)
def test_nothing_is_released_where_they_disagree(tag, version, told):
    with pytest.raises(ValueError, match=told):
        notes(tag, version, CHANGELOG)
