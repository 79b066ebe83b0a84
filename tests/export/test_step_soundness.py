"""Whether a STEP file with curved faces holds a solid: faces whose triangles cross are drawn finer, and they alone."""

from dataclasses import replace

import numpy as np
import pytest

from dsfab.core.units import MM_PER_M
from dsfab.export.cad.step import soundness
from dsfab.export.cad.step.soundness import REDRAWING_ROUNDS, curved_soundness, step_triangles
from dsfab.export.cad.step.worker.reports import StepMesh, drawn_anew, read_step

DEFLECTION, SIDES = 0.04, 12
"""Metres, and how many sides a ring of radius 1 m has when it is drawn to that."""


def ring(inner, outer, z, sides, turn=0.0):
    """Points, and triangles seen from outside, of a ring between two radii and two heights."""
    angle = 2 * np.pi * np.arange(sides) / sides + turn
    profile = [(inner, z[0]), (outer, z[0]), (outer, z[1]), (inner, z[1])]
    V = np.concatenate([np.stack([r * np.cos(angle), r * np.sin(angle), 0 * angle + at], axis=1) for r, at in profile])
    k, j = (x.ravel() for x in np.indices((4, sides)))
    a, b = k * sides + j, k * sides + (j + 1) % sides
    c, d = (k + 1) % 4 * sides + (j + 1) % sides, (k + 1) % 4 * sides + j
    return V, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def drawn(gap, asked=None, spoil=lambda mesh: mesh):
    """Stands in for OCCT: a pin in a tube, a collar 50 mm above both, and a ring far off; a face each."""

    def draw(shape, deflection, faces=None):
        if asked is not None:
            asked.append(None if faces is None else list(faces))
        sides = round(SIDES * (DEFLECTION * MM_PER_M / deflection) ** 0.5)
        parts = [
            ring(0.5, 1, (-0.2, 0.2), sides, np.pi / sides),
            ring(1 + gap, 2, (-0.3, 0.3), sides),
            ring(1.5, 2, (0.35, 0.5), sides),
            ring(0.5, 1, (5, 6), sides),
        ]
        V, F, of, count = [], [], [], 0
        for k in range(4) if faces is None else faces:
            V.append(parts[k][0] * MM_PER_M)
            F.append(parts[k][1] + count)
            of.append(np.full(len(F[-1]), k))
            count += len(V[-1])
        mesh = StepMesh(np.concatenate(V), np.concatenate(F), np.concatenate(of), 4, deflection, b"")
        return spoil(mesh) if faces is not None else mesh

    return draw


def judged(monkeypatch, gap, **how):
    """The verdict, the first triangles, and which faces were drawn anew."""
    asked: list = []
    monkeypatch.setattr(soundness, "drawn_anew", drawn(gap, asked, **how))
    first = step_triangles(drawn(gap)(b"", DEFLECTION * MM_PER_M))
    return curved_soundness(first, DEFLECTION, b""), first, asked


def test_only_crossing_faces_and_their_neighbours_are_triangulated_finer(monkeypatch):
    """Chords of the tube reach into the pin; the collar is as near as two deflections, and the last ring is not."""
    first = soundness.soundness(*step_triangles(drawn(0.01)(b"", DEFLECTION * MM_PER_M))[:2])
    assert [fault.kind for fault in first.faults] == ["crossing"]
    sound, _, asked = judged(monkeypatch, 0.01)
    assert sound.sound
    assert asked == [[0, 1, 2]]
    assert (sound.volume, sound.shells) == (first.volume, 4)
    assert not len(sound.crossings)


def test_faces_that_cross_at_any_fineness_are_a_fault(monkeypatch):
    """A pin wider than its tube; the count is of the finest triangles."""
    sound, first, asked = judged(monkeypatch, -0.01)
    assert asked == [[0, 1, 2]] * REDRAWING_ROUNDS
    (fault,) = sound.faults
    assert fault.kind == "crossing"
    assert fault.count == len(sound.crossings) > len(soundness.soundness(first.V, first.F).crossings)
    assert np.hypot(*fault.place[:2]) < 1.01


def test_faces_without_crossings_are_drawn_once(monkeypatch):
    sound, _, asked = judged(monkeypatch, 0.1)
    assert sound.sound
    assert not asked


@pytest.mark.parametrize("lost", [slice(1, None), slice(0, 0), slice(192, None)])
def test_all_faces_are_triangulated_again_if_single_faces_do_not_connect(monkeypatch, lost):
    """A triangle, all, or those of a face are missing: that they do not cross then says nothing."""
    sound, _, asked = judged(monkeypatch, 0.01, spoil=lambda mesh: replace(mesh, F=mesh.F[lost], face=mesh.face[lost]))
    assert asked == [[0, 1, 2], None]
    assert sound.sound


def test_a_face_keeps_its_triangles_when_it_is_triangulated_alone(tmp_path, inspected_pieces):
    """A tube beside a ball: each face alone where it was, and two that share an edge with the same points on it."""
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakeSphere
    from OCP.gp import gp_Pnt
    from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer

    writer = STEPControl_Writer()
    for solid in (BRepPrimAPI_MakeSphere(gp_Pnt(50, 0, 0), 10), BRepPrimAPI_MakeCylinder(10, 40)):
        writer.Transfer(solid.Shape(), STEPControl_StepModelType.STEPControl_AsIs)
    writer.Write(str(tmp_path / "two.step"))
    whole = read_step(tmp_path / "two.step", 0.1)
    assert whole.face.max() == 3
    for k in range(4):
        alone, used = drawn_anew(whole.shape, 0.1, np.array([k])), whole.V[np.unique(whole.F[whole.face == k])]
        assert set(alone.face) == {k}
        assert np.allclose([alone.V.min(axis=0), alone.V.max(axis=0)], [used.min(axis=0), used.max(axis=0)], atol=0.2)
    finer = step_triangles(drawn_anew(whole.shape, 0.01, np.array([1, 2, 3])))
    assert len(finer.F) > len(whole.F) - (whole.face == 0).sum()
    assert soundness.soundness(finer.V, finer.F).sound
