"""`--step auto`: the best way within the budget, told in one line; a refusal with the costs only when there is none."""

import re
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import islice

import numpy as np
import pytest

from dsfab.core.derived import derived_results
from dsfab.core.errors import ExportError
from dsfab.core.limits import OFF_SURFACE
from dsfab.design.output.files import curved_sheet
from dsfab.export import STEP_FACES, StepOptions, readback, step_estimates, write
from dsfab.export.cad.step import file as step
from dsfab.export.cad.step import file_size, soundness, strategies
from dsfab.export.cad.step.by_members import build as network_build
from dsfab.export.cad.step.by_members.build import MemberFile, NotByMembersError
from dsfab.export.cad.step.by_members.draft import ManyFacesError, MemberDraft, require_few_faces
from dsfab.export.cad.step.file_size import BudgetError
from dsfab.export.cad.step.flat_sheets import NotFlatError
from dsfab.export.cad.step.smooth import build
from dsfab.export.cad.step.worker.reports import OcctFinding
from dsfab.export.part import part_of
from dsfab.surface.shapes.roofs import barrel_vault
from dsfab.surface.shapes.round_shapes import sphere
from tests.export.curved_solids import saddle_solid
from tests.smooth import THICKNESS, holed, thickened


@pytest.fixture
def slow_vault(monkeypatch):
    """A vault with a hole, whose walls take too long to be made unasked: its solid, and what is known of its sheet."""
    monkeypatch.setattr(build, "MOST_WALLS", 3)
    surface = barrel_vault(2.0, 1.6, 0.5, 0.15)
    sheet = holed(surface, [[0.5, 0, 0.5]], 0.25)
    return thickened(surface, sheet), partial(curved_sheet, surface, sheet, THICKNESS)


@pytest.fixture
def unread(monkeypatch):
    """No file may be read back."""

    def never(part, path):
        raise AssertionError(f"{part.step} was read back")

    monkeypatch.setattr(step, "inspection", never)


@pytest.fixture
def cut(monkeypatch):
    """OCCT's answer to the cut of a file, without OCCT."""
    said = {"halves": False, "off": 1.0, "box": [0.0] * 6}
    monkeypatch.setattr(soundness, "occt_report", lambda *_, seconds: said)
    return said


def faces(path):
    return path.read_bytes().count(b"=ADVANCED_FACE(")


def chosen(solid, **how):
    return next((one for one in step_estimates(solid, **how) if one.chosen), None)


@pytest.mark.slow
def test_a_slow_smooth_file_is_written_when_planar_faces_are_too_many(
    tmp_path, slow_vault, inspected_pieces, cut, unread
):
    said, (solid, curved) = [], slow_vault
    path = write(solid, tmp_path / "a.step", step=StepOptions(curved=curved, faces=60), note=said.append)
    assert faces(path) < 30
    assert said[0].startswith("STEP is smooth")
    assert re.search(
        r"; writing the file had no time limit, because .* faceted would have [\d,]+ planar faces, more than", said[0]
    )
    assert chosen(solid, step=StepOptions(curved=curved, faces=60)).way == "smooth"
    assert chosen(solid, step=StepOptions(curved=curved)).way == "faceted"


def test_members_are_tried_before_the_smooth_solid_and_facets(slow_vault):
    """By `auto`, and by `quick` for what is open: where the stripes are known."""
    solid, curved = slow_vault
    striped = replace(curved(), striped=lambda: pytest.fail("stripes were asked for"))
    part = strategies.prepare(part_of(solid, "a", STEP_FACES))

    def tried(step, sheet):
        return [(one.step, one.hurry) for one in islice(strategies.attempts(replace(part, step=step, curved=sheet)), 3)]

    assert tried("auto", lambda: striped) == [("members", 1), ("smooth", 1), ("faceted", 0)]
    assert tried("auto", lambda: replace(striped, striped=None))[:2] == [("smooth", 1), ("faceted", 0)]
    assert tried("quick", lambda: striped) == [("members", 1), ("smooth", strategies.QUICK_FACTOR), ("faceted", 0)]
    ball = sphere(1.0, 0.9)
    round_one = replace(striped, V=ball.V, F=ball.F)
    assert tried("quick", lambda: round_one)[:2] == [("smooth", strategies.QUICK_FACTOR), ("faceted", 0)]
    assert tried("auto", lambda: round_one)[0] == ("members", 1)


def test_members_too_many_to_be_tried_at_first_are_made_before_smooth_however_long(slow_vault, monkeypatch):
    """Where facets are over the budget, and members were refused for their number alone."""
    solid, curved = slow_vault
    part = replace(strategies.prepare(part_of(solid, "a", 60)), step="auto")
    striped = replace(curved(), striped=lambda: pytest.fail("stripes were asked for"))

    def last():
        asked = list[tuple[str, int]]()
        for one in strategies.attempts(replace(part, curved=lambda: striped)):
            if not isinstance(one, BudgetError) and one.step != "faceted":
                asked.append((one.step, one.hurry))
            if asked == [("members", 1)] and many:
                with pytest.raises(ManyFacesError, match=r"more than 7000 faces only on request"):
                    require_few_faces(one, 7001)
        return asked[2:]

    many = False
    assert last() == [("smooth", 0)]
    many = True
    assert last() == [("members", strategies.MEMBER_FACES_FACTOR), ("smooth", 0)]
    require_few_faces(replace(part, hurry=strategies.MEMBER_FACES_FACTOR), 7001)


def test_quick_refuses_ways_that_take_long(tmp_path, slow_vault, inspected_pieces, unread, monkeypatch):
    """The same solid: what `auto` makes in the end, `quick` leaves, and says what each way would cost."""
    monkeypatch.setattr(build, "findings", lambda *_: pytest.fail("OCCT was asked"))
    monkeypatch.setattr(build, "MOST_WALLS", 1)
    solid, curved = slow_vault
    with pytest.raises(ExportError, match=r"more than step_faces = 60"):
        write(solid, tmp_path / "a.step", step=StepOptions("quick", curved=curved, faces=60))
    assert not any(tmp_path.iterdir())
    assert chosen(solid, step=StepOptions("quick", curved=curved)).way == "faceted"


def test_a_smooth_file_over_the_budget_is_not_shown_to_occt(tmp_path, slow_vault, monkeypatch):
    monkeypatch.setattr(build, "findings", lambda *_: pytest.fail("OCCT was asked"))
    solid, curved = slow_vault
    with pytest.raises(ExportError, match=r"the STEP file of 'a' would have 0\.0\d+ MB, more than step_mb = 0.01 MB"):
        write(solid, tmp_path / "a.step", step=StepOptions("smooth", curved=curved, megabytes=0.01))


@pytest.mark.slow
@pytest.mark.parametrize(("budget", "way"), [(1200, "faceted"), (1000, "simplified"), (650, "simplified")])
def test_the_written_way_is_the_estimated_way(tmp_path, inspected, budget, way):
    said, solid = [], saddle_solid()
    path = write(solid, tmp_path / "a.step", step=StepOptions(faces=budget), note=said.append)
    found = chosen(solid, step=StepOptions(faces=budget))
    assert (found.way, found.faces) == (way, faces(path))
    assert faces(path) <= budget
    assert found.size == pytest.approx(path.stat().st_size, rel=0.1)
    assert ("simplified from" in said[0]) == (way == "simplified")
    if budget == 650:  # the usual tolerance, a twentieth of the thickness, was not enough
        assert "simplified within 4.2 mm would have about" in said[0]
        moved = float(said[0].split(" mm off at most")[0].split()[-1])
        assert 4.2 < moved <= 1000 * strategies.SIMPLIFIED_OFF_SURFACE * OFF_SURFACE * 0.1


def test_a_refusal_lists_the_cost_of_each_way_without_reading_a_file_back(tmp_path, unread):
    solid = saddle_solid()
    with pytest.raises(ExportError) as caught:
        write(solid, tmp_path / "a.step", step=StepOptions(faces=10))
    said = str(caught.value)
    assert said.startswith("every STEP file of 'a' would be more than step_faces = 10: ")
    assert re.search(r"faceted 1,152 faces \(0\.\d+ MB, about 2\.7 s to write and check\)", said)
    assert re.search(r"simplified within 8\.3 mm \d+ faces \(0\.\d+ MB, about", said)
    for words in ("STL or 3MF", "coarsen the mesh", "step_tolerance", "or raise step_faces"):
        assert words in said
    assert not any(tmp_path.iterdir())
    assert chosen(solid, step=StepOptions(faces=10)) is None


def test_quick_does_not_simplify_solids_far_over_the_budget(tmp_path, unread, monkeypatch):
    tried, true = [], strategies.simplified_part
    monkeypatch.setattr(strategies, "simplified_part", lambda part, by: tried.append(by) or true(part, by))
    for faces, times in ((10, 1), (500, 2)):
        tried.clear()
        with suppress(ExportError):
            write(saddle_solid(), tmp_path / "a.step", step=StepOptions("quick", faces=faces))
        assert len(tried) == times


def test_a_requested_tolerance_is_kept_even_over_the_budget(tmp_path, unread):
    part = strategies.prepare(part_of(saddle_solid(), "a", 100))
    asked = [
        one for one in strategies.attempts(strategies.replace(part, step="auto", tolerance=1.0)) if one.step != "planar"
    ]
    assert [one.part.tolerance if isinstance(one, BudgetError) else one.tolerance for one in asked] == [1.0]


def test_simplification_stops_if_it_does_not_help(monkeypatch):
    """One try, beyond the tolerance, that leaves twice the faces."""
    tries, true = [], file_size.simplification
    monkeypatch.setattr(file_size, "simplification", lambda part, by: tries.append(by) or (true(part, by)[0], 1e9))
    part = strategies.prepare(part_of(saddle_solid(), "a", 400))
    with pytest.raises(BudgetError, match=r"about \d+ planar faces, more than step_faces = 400"):
        file_size.simplified_part(part, 4.0)
    assert len(tries) == 1
    with pytest.raises(ExportError, match="does not become simpler"):
        file_size.simplified_part(strategies.replace(part, step_faces=STEP_FACES), 4.0)
    assert len(tries) == 1 + file_size.TRIES


def test_a_refusal_over_the_budget_lists_the_failed_ways():
    part = strategies.prepare(part_of(saddle_solid(), "a", 10))
    said = str(strategies.refusal([NotFlatError("not flat"), ExportError("a gap; try this"), BudgetError(part, 1152)]))
    assert said.startswith("the STEP file of 'a' would have 1,152 planar faces")
    assert said.endswith("or raise step_faces (tried too: a gap)")
    far = [NotByMembersError(why) for why in ("the 'members' solid is 9 mm off", "a region bends too much; see")]
    told = [str(strategies.refusal([one, ExportError("a gap"), BudgetError(part, 1152)])) for one in far]
    assert [one.partition("(")[2] for one in told] == [
        "tried too: the 'members' solid is 9 mm off; a gap)",
        "tried too: by members, a region bends too much; a gap)",
    ]
    many = NotByMembersError("by members, the file would have too many; ask", if_asked=True)
    told = str(strategies.refusal([many, ExportError("a gap"), BudgetError(part, 1152)]))
    assert told.endswith("(tried too: by members, the file would have too many: write step = 'members'; a gap)")
    assert str(strategies.refusal([ExportError("a gap; try this")])) == "a gap; try this"


def test_a_smooth_brep_is_compared_with_its_pieces(tmp_path, slow_vault, inspected_pieces, monkeypatch):
    """And not with the mesh, which is smaller."""
    found = {"solids": 1, "valid": True, "tessellates": True, "faces": 1}
    monkeypatch.setattr(
        step, "inspection", lambda part, path: found | {"volume": share * build.smooth_file(part).volume}
    )
    monkeypatch.setattr(readback, "READ_BACK", 1e-12)
    (solid, curved), share = slow_vault, 1.0
    assert write(solid, tmp_path / "a.brep", step=StepOptions("smooth", curved=curved)).stat().st_size > 1000
    share = 1.01
    with pytest.raises(ExportError, match="reads back with another volume"):
        write(solid, tmp_path / "a.brep", step=StepOptions("smooth", curved=curved))


def test_facets_replace_a_smooth_solid_that_occt_cannot_cut(slow_vault, inspected_pieces, cut, monkeypatch):
    solid, curved = slow_vault
    part = strategies.prepare(replace(part_of(solid, "a", STEP_FACES), step="auto", curved=curved))
    smooth = next(one for one in strategies.attempts(part) if one.step == "smooth")
    monkeypatch.setattr(build, "MOST_WALLS", 100)
    with pytest.raises(ExportError, match="smooth a trial cut in OCCT makes a half that is not valid"):
        step.encode(smooth)
    monkeypatch.setattr(step, "LIGHT", 0.01)
    assert b"B_SPLINE" in b"".join(step.encode(smooth))
    fails = (
        "; cutting the part in CAD fails (a trial cut in OCCT makes a half that is not valid): write step = 'faceted'"
    )
    assert fails in strategies.route_sentence(smooth, [])
    cut.update(halves=True, off=0.0, box=part.box.ravel().tolist())
    derived_results(smooth).clear()
    assert strategies.route_sentence(smooth, []).endswith("; a half-space cut valid")


def test_a_smooth_file_that_check_would_fail_gives_way_to_facets_and_says_why(
    tmp_path, slow_vault, inspected_pieces, cut, monkeypatch
):
    """A triangle is missing where OCCT draws it."""
    whole, faceted = soundness.read_step, {"solids": 1, "valid": True, "tessellates": True}
    monkeypatch.setattr(build, "MOST_WALLS", 100)
    monkeypatch.setattr(step, "LIGHT", 0.0)
    monkeypatch.setattr(
        soundness, "read_step", lambda *how: replace(mesh := whole(*how), F=mesh.F[1:], face=mesh.face[1:])
    )
    monkeypatch.setattr(step, "inspection", lambda part, path: faceted | {"faces": faces(path), "volume": part.volume})
    (solid, curved), said = slow_vault, list[str]()
    path = write(solid, tmp_path / "a.step", step=StepOptions(curved=curved), note=said.append)
    assert said[0].startswith("STEP is faceted: smooth, 3 edges have only one triangle when OCCT divides the solid")
    assert b"B_SPLINE" not in path.read_bytes()
    monkeypatch.setattr(soundness, "read_step", lambda *_: pytest.fail("the smallest file was drawn"))
    assert b"B_SPLINE" in write(solid, path, step=StepOptions("compact", curved=curved)).read_bytes()


def test_a_file_by_members_must_be_the_one_that_was_checked(tmp_path, slow_vault, monkeypatch):
    part = replace(part_of(slow_vault[0], "a"), step="members")
    limits, path = build.SmoothPlan(replace(part, curved=slow_vault[1])).limits, tmp_path / "a.step"
    path.write_text("text")
    file = MemberFile("text", 1, 6, 0, 0.0, 0.0, 0.0, 1.1 * part.volume, "", limits)
    monkeypatch.setattr(step, "member_file", lambda _: file)
    assert step.check(part, path).count == 6
    path.write_text("test")
    with pytest.raises(ExportError, match="differs from the text that OCCT checked"):
        step.check(part, path)


def test_a_trial_cut_is_judged_by_halves_and_box_and_skipped_for_large_files(slow_vault, cut, monkeypatch):
    solid, curved = slow_vault
    part = strategies.prepare(part_of(solid, "a", STEP_FACES))
    limits = build.SmoothPlan(replace(part, curved=curved)).limits
    box = part.box.ravel().tolist()
    for answer, fault in (
        ({"halves": True, "off": 1e-6, "box": box}, ""),
        ({"off": 2e-5}, "a trial cut in OCCT changes the total volume by 2.0e-05 (relative)"),
        (
            {"off": 0.0, "box": [box[0] - 400.0, *box[1:]]},
            "the bounding box that OCCT computes for the solid is wrong by 400 mm",
        ),
    ):
        cut.update(answer)
        assert soundness.sampled_use(part, b"", 5, limits) == soundness.SampledUse(True, fault)
    assert soundness.sampled_use(part, b"", soundness.MOST_FACES + 1, limits) == soundness.SampledUse(False)


def test_by_members_the_box_of_a_file_of_any_size_decides(slow_vault):
    """Two solids together have the box of the part, but for one side of one of them."""
    solid, curved = slow_vault
    part = replace(strategies.prepare(part_of(solid, "a", STEP_FACES)), curved=curved)
    low, high = part.box.tolist()
    nothing = np.zeros((0, 3))
    draft = MemberDraft("", 2, 9000, 0, 0.0)
    two = [[*low, low[0], *high[1:]], [high[0], *low[1:], *high[:2], high[2] + 300.0]]
    found = [OcctFinding(True, True, True, 4500, 1e6, 0.0, box, nothing, nothing, nothing) for box in two]
    with pytest.raises(
        ExportError, match="by members, the bounding box that OCCT computes for the solid is wrong by 300 mm"
    ):
        network_build.require_solid(part, build.SmoothPlan(part), draft, found, None)


def test_compact_is_smooth_and_names_the_way_that_cad_can_cut(tmp_path, slow_vault, inspected_pieces):
    solid, curved = slow_vault
    said = list[str]()
    write(solid, tmp_path / "a.step", step=StepOptions("compact", curved=curved), note=said.append)
    assert said[0].startswith("STEP is smooth")
    assert said[0].endswith("; cutting the part in CAD may fail: write step = 'faceted' to cut it there")


def test_a_file_that_cad_cannot_cut_gives_a_note_with_the_way_to_use(slow_vault):
    """Members refused for their number of faces alone are made where they are asked for by name."""
    solid, curved = slow_vault
    part = replace(part_of(solid, "a", 10), step="members")
    striped = replace(part, curved=lambda: replace(curved(), striped=lambda: None))
    few, vain = NotByMembersError("too many faces", if_asked=True), NotByMembersError("invalid")
    assert strategies.way_to_cut(striped, []) == strategies.way_to_cut(striped, [few]) == "write step = 'members'"
    assert strategies.way_to_cut(striped, [few, vain]) == "write step = 'faceted'"
    assert strategies.way_to_cut(part, []) == "write step = 'faceted'"
    assert strategies.reasons([few, vain]) == ["too many faces: write step = 'members'", "invalid"]
    assert strategies.members_clause([NotByMembersError("by members, it fails")]) == "; not by members, since it fails"
    assert strategies.way_to_cut(striped, [BudgetError(part, 11)]) == "raise step_faces and write step = 'members'"
    assert strategies.way_to_cut(striped, [BudgetError(part, 9)]) == "raise step_mb and write step = 'members'"
