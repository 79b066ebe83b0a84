"""`--show members`: every member is named once, where it is seen, and no name is on another."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from dsfab.app.cli import main
from dsfab.preset.file import load_preset
from dsfab.render.lettering import PAPER, Nameplate, place_names, with_names
from dsfab.render.members import members_picture, nameplates
from tests.designs import sliced

SIZE = (480, 360)


@pytest.fixture(scope="module")
def vault():
    return sliced(load_preset("barrel_vault", {"surface.edge": 0.4}))


def boxes(placed, letter):
    return [
        (*(one.middle - half), *(one.middle + half))
        for one in placed
        for half in [np.array([0.31 * letter * len(one.plate.text) + 2, 0.5 * letter + 1])]
    ]


@settings(deadline=None, max_examples=30)
@given(st.lists(st.tuples(st.floats(60, 580), st.floats(40, 440)), min_size=1, max_size=40))
def test_no_name_stands_on_another_and_all_are_on_the_page(places):
    plates = [
        Nameplate(f"B{k:02d}", (0, 0, 0), np.array([place]), np.ones(1, dtype=bool)) for k, place in enumerate(places)
    ]
    placed = place_names(plates, (640, 480), 12.0)
    assert sorted(one.plate.text for one in placed) == [plate.text for plate in plates]
    found = np.array(boxes(placed, 12.0))
    assert found.min() >= 0
    assert (found[:, 2] <= 640).all()
    assert (found[:, 3] <= 480).all()
    low, high = found[:, None, :2], found[None, :, 2:]
    over = (np.minimum(high, found[:, None, 2:]) - np.maximum(low, found[None, :, :2])).min(axis=2)
    np.fill_diagonal(over, -1)
    assert over.max() <= 0


def test_a_nameplate_prefers_a_visible_place():
    plate = Nameplate("A01", (0, 0, 0), np.array([[100.0, 100.0], [300.0, 200.0]]), np.array([False, True]))
    (placed,) = place_names([plate], (400, 300), 12.0)
    assert placed.anchor.tolist() == placed.middle.tolist() == [300, 200]


def test_a_nameplate_beside_its_member_has_a_leader_line():
    white = Image.new("RGB", (200, 200), (255, 255, 255))
    plates = [
        Nameplate(text, (200, 0, 0), np.array([[100.0, 100.0]]), np.ones(1, dtype=bool)) for text in ("A01", "A02")
    ]
    placed = place_names(plates, (200, 200), 12.0)
    assert [bool((one.anchor == one.middle).all()) for one in placed] == [True, False]
    bare = np.asarray(with_names(white.copy(), placed[:1], 12.0, (255, 255, 255)))
    both = np.asarray(with_names(white, placed, 12.0, (255, 255, 255)))
    assert (bare != both).any()


def test_families_have_their_colours_and_the_caption_counts(vault):
    picture = members_picture(vault, size=SIZE).astype(int)
    assert picture.shape == (360, 480, 3)
    red, _, blue = np.moveaxis(picture, 2, 0)
    assert (red - blue > 60).sum() > 300  # purlins
    assert (blue - red > 40).sum() > 2000  # arches


def test_each_member_has_a_nameplate_with_visible_places(vault):
    from dsfab.render.drawing import Annotations, set_stage
    from dsfab.render.scene import Body
    from dsfab.render.view import named_side

    graph = vault.members
    surface, up = graph.sheet.surface, np.array([0.0, 0.0, 1.0])
    body = Body(surface.V, surface.F, np.zeros(3, dtype=np.uint8))
    stage = set_stage(body, named_side(surface.V, up, "iso"), up, 0.0, Annotations(layers=()), PAPER, SIZE)
    nothing = np.full((2 * SIZE[1], 2 * SIZE[0]), np.inf)
    ink = dict.fromkeys(graph.by_id, PAPER.text)
    plates = list(nameplates(graph, stage, nothing, (SIZE, ink, PAPER)))
    assert [plate.text for plate in plates] == [member.id for member in graph.members]
    for plate in plates:
        assert plate.visible.all()
        assert ((plate.places > 0) & (plate.places < SIZE)).all()


def test_preview_writes_the_picture_of_members_without_a_second_picture(tmp_path, capsys):
    words = ["--show", "members", "--size", "320x240", "-o"]
    assert main(["preview", "barrel_vault", "--set", "surface.edge=0.5", *words, str(tmp_path / "a.png")]) == 0
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.size == (320, 240)
    assert main(["preview", "barrel_vault", "--show", "members,stress", "-o", str(tmp_path / "b.png")]) == 1
    assert "without other pictures" in capsys.readouterr().err
    assert not (tmp_path / "b.png").exists()
