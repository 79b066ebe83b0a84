"""Members and nodes as files: read by what is not dsfab, and the same from a folder as from the design."""

import csv
import json

import numpy as np
import pytest

from dsfab.app.cli import main
from dsfab.core.errors import ExportError
from dsfab.design.output import write
from dsfab.export.formats import FORMATS, suffix_of
from dsfab.preset.file import load_preset
from tests.designs import sliced

SMALL = {"surface.edge": 0.4}


@pytest.fixture(scope="module")
def design():
    return sliced(load_preset("barrel_vault", SMALL))


def rows(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_the_graph_as_json_is_the_graph_in_millimetres(design, tmp_path):
    path = design.write(tmp_path / "members.json")
    found, graph = json.loads(path.read_text()), design.members
    assert (found["unit"], found["curvature"], found["notes"]) == ("millimetre", "1/m", list(graph.notes))
    assert [entry["id"] for entry in found["members"]] == [member.id for member in graph.members]
    for entry, member in zip(found["members"], graph.members, strict=True):
        assert entry["length"] == pytest.approx(1000 * member.length, abs=1e-3)
        assert entry["width"]["median"] == pytest.approx(1000 * member.mean_width, abs=1e-3)
        assert entry["area"] == pytest.approx(1e6 * member.area, abs=0.1)
        assert entry["ends"] == list(member.ends)
        points = np.array(entry["axis"]["points"])
        assert points == pytest.approx(1000 * member.axis.P, abs=1e-3)
        assert np.linalg.norm(np.diff(points, axis=0), axis=1).sum() == pytest.approx(entry["length"], rel=1e-3)
        assert np.add(entry["axis"]["left"], entry["axis"]["right"]) == pytest.approx(1000 * member.width, abs=1e-3)
        assert entry["axis"]["kn"] == pytest.approx(member.axis.kn, abs=1e-8)
        assert np.sum(entry["bays"]) <= entry["length"] + 1e-3
    at = {node["id"]: node for node in found["nodes"]}
    assert list(at) == [node.id for node in graph.nodes]
    for node in graph.nodes:
        assert at[node.id]["point"] == pytest.approx(1000 * node.point, abs=1e-3)
        assert at[node.id]["members"] == list(node.members)
        assert at[node.id]["at"] == pytest.approx([1000 * s for s in node.at], abs=1e-3)


def test_tables_have_a_row_for_each_member_and_each_node(design, tmp_path):
    graph = design.members
    members, nodes = (rows(design.write(tmp_path / f"vault.{name}.csv")) for name in ("members", "nodes"))
    assert [row["id"] for row in members] == [member.id for member in graph.members]
    assert [row["id"] for row in nodes] == [node.id for node in graph.nodes]
    for row, member in zip(members, graph.members, strict=True):
        assert float(row["length_mm"]) == pytest.approx(1000 * member.length, abs=1e-3)
        assert int(row["nodes"]) == len(graph.nodes_along[member.id])
        ends = [[float(row[f"{end}_{axis}_mm"]) for axis in "xyz"] for end in ("start", "end")]
        assert ends == pytest.approx(1000 * member.axis.P[[0, -1]], abs=1e-3)
        assert (row["start"], row["end"]) == member.ends
        assert float(row["largest_kn_1_per_m"]) == pytest.approx(np.abs(member.axis.kn).max(), abs=1e-8)
    for row, node in zip(nodes, graph.nodes, strict=True):
        assert (row["member_a"], row["member_b"]) == node.members
        assert float(row["angle_deg"]) == pytest.approx(node.angle, abs=1e-3)
        assert [float(row[f"{axis}_mm"]) for axis in "xyz"] == pytest.approx(1000 * node.point, abs=1e-3)


@pytest.mark.parametrize(
    ("name", "suffix"),
    [("members.json", ".members.json"), ("a.MEMBERS.csv", ".members.csv"), ("nodes.csv", ".nodes.csv"),
     ("members.csv", ".members.csv"), ("a.json", ".json"), ("my.nodes.txt", ".txt"), ("stl", "")],
)  # fmt: skip
def test_files_of_members_are_known_by_their_whole_name(tmp_path, name, suffix):
    assert suffix_of(tmp_path / name) == suffix


def test_an_object_without_a_design_has_no_members(design, tmp_path):
    with pytest.raises(ExportError, match="only a design has members"):
        write(design.surface, tmp_path / "members.json")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", [".members.json", ".members.csv", ".nodes.csv"])
def test_a_file_that_lost_a_row_is_refused(design, tmp_path, monkeypatch, suffix):
    from dataclasses import replace

    form = FORMATS[suffix]

    def fewer(part):
        graph = part.details.members
        fewer = replace(graph, nodes=graph.nodes[1:] if "nodes" in suffix else ())
        fewer = fewer if "nodes" in suffix else replace(fewer, members=graph.members[1:])
        return form.encode(replace(part, details=replace(part.details, members=fewer)))

    monkeypatch.setitem(FORMATS, suffix, replace(form, encode=fewer))
    with pytest.raises(ExportError, match="reads back with"):
        design.write(tmp_path / f"a{suffix}")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_folder_gives_the_same_bytes_as_the_design(tmp_path, capsys):
    folder, words = tmp_path / "vault", [f"--set={key}={value}" for key, value in SMALL.items()]
    assert (
        main(["build", "barrel_vault", *words, "--format", "ply,members.csv", "--no-picture", "-q", "-o", str(folder)])
        == 0
    )
    assert main(["export", str(folder), "--to", "members.csv", "-q", "-o", str(tmp_path / "again.members.csv")]) == 0
    assert (tmp_path / "again.members.csv").read_bytes() == (folder / "barrel_vault.members.csv").read_bytes()
    assert main(["export", str(folder), "--to", "nodes.csv"]) == 0
    assert "nodes.csv" in capsys.readouterr().out
    assert (folder / "barrel_vault.nodes.csv").stat().st_size > 1000
