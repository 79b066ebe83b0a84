"""What `dsfab build` prints and returns: the verdict first, reactions, words in order, files in the order of need."""

import json
import re
from dataclasses import replace

from dsfab.app.build_page import LINES, BuildPage, Output
from dsfab.app.terminal import ExitCode
from dsfab.report.design import save as saving
from dsfab.report.design.carrying import cure_line, figure_lines, reaction_lines, verdict_line
from dsfab.study.carrying import Carrying, MemberUse, Movement
from tests.app.command_line import refused, run
from tests.presets import DOME_MODES
from tests.source import ROOT

COARSE = ["--set", "surface.edge=1.2", "--set", "pattern.keep=0.6"]
STEEL = ["--set", "statics.material=S235"]


def judged(value=0.5, **changes):
    use = MemberUse("A07", value, (1.0, 2.0, 3.0), "snow", "tension, EN 1993-1-1")
    return Carrying(0.06, 1200.0, use, Movement(0.02, (0, 0, 4.0), "snow", 12.0, "across"), 6.5, "snow", **changes)


def test_the_first_line_tells_whether_and_why():
    assert verdict_line("roof", judged()) == "roof carries its loads"
    weak = judged(1.5, faults=("the load on A07 is 150% of its resistance",))
    assert verdict_line("roof", weak) == "roof DOES NOT CARRY its loads: the load on A07 is 150% of its resistance"
    assert "--set statics.thickness=0.075" in cure_line(weak)
    assert "no thickness of the available sheets suffices" in cure_line(weak, is_sized=True)
    assert cure_line(judged()) == ""
    assert verdict_line("bob", Carrying(1.0, 1.0, remarks=("no strength",))) == "bob is not judged: no strength"


def test_the_figures_name_member_place_span_and_mass():
    lines = [*figure_lines(judged())]
    assert lines[0].split()[2:6] == ["A07", "at", "(1,", "2,"]
    assert "50%" in lines[0]
    assert "20 mm at (0, 0, 4) m, 1/600 of the span 12 m" in lines[1]
    assert "6.5 times the load" in lines[2]
    assert "1.2 t, 60 mm thick" in lines[3]
    assert "at over 1000 times the load" in [*figure_lines(replace(judged(), buckling=2.3e6))][2]


def push(support, case, vertical, horizontal, direction=0.0, thrust=None):
    forces = {"vertical": vertical, "horizontal": horizontal, "thrust": horizontal if thrust is None else thrust}
    return {"support": support, "case": case, "direction": direction, **forces}


def test_reactions_are_a_table_of_components_with_a_direction():
    rows = [push("foot 1", "snow", 31.9e3, 33.8e3, -147.5), push("wall", "snow", 70e3, 1.0, 12.0, thrust=40e3)]
    rows += [push("post", "snow", 5e3, 0.1), push("foot 2", "snow", 30e3, 20e3, 90.0, thrust=80e3)]
    rows += [push("end", "snow", 251e3, 1.54e6, 1.0)]
    head, *lines = [line.split() for line in reaction_lines(rows)]
    assert " ".join(head) == "support pushes V up, kN H, kN H towards"
    assert lines[0] == ["foot", "1", "31.9", "33.8", "-148", "deg"]
    assert lines[1] == ["wall", "70", "40", "opposite", "ways"]
    assert lines[2] == ["post", "5", "0", "-"]
    assert lines[3] == ["foot", "2", "30", "20", "90", "deg"]
    assert lines[4] == ["end", "251", "1540", "1", "deg"]


def test_a_short_table_has_the_worst_case_of_the_largest_supports():
    rows = [push(f"post {k}", case, k * size, 0.0) for k in range(1, 10) for case, size in (("a", 1e3), ("b", 2e3))]
    lines = reaction_lines(rows)
    assert len(lines) == 8
    assert [line.split()[1:3] for line in lines[1:3]] == [["9", "b"], ["8", "b"]]
    assert lines[-1] == "and 3 more supports: see design.json"
    assert len(reaction_lines(rows, every=True)) == 19


def test_a_page_keeps_to_its_lines_and_says_how_many_are_left_out(capsys):
    page = BuildPage(Output())
    page.print_lines([*(f"{k}" for k in range(9)), "a table\nof three\nlines"])
    page._print_list("you should know", [f"note {k}" for k in range(30)], LINES - page._count)
    said = capsys.readouterr().out.splitlines()
    assert len(said) == LINES
    assert said[12] == "you should know:"
    assert said[-1] == f"  and {30 - (LINES - 14)} more lines: see them with --verbose, or in design.json"


def test_a_structure_that_does_not_carry_is_written_and_ends_with_5(capsys, tmp_path):
    folder = tmp_path / "o"
    thin = ["--set", "statics.thickness=0.004", "--set", "fabrication.accept=true", "--set", "statics.check=false"]
    files = ["-f", "stl,step", "--step", "faceted", "--max-faces", "100", "--no-picture", "-o", str(folder)]
    code, out, err = run(capsys, "build", DOME_MODES, *COARSE, *STEEL, *thin, *files)
    assert code == ExitCode.DOES_NOT_CARRY, "a refused STEP file does not hide it"
    assert "left out: " in out
    lines = out.splitlines()
    assert lines[0].startswith("dome_modes DOES NOT CARRY its loads: ")
    assert lines[1].startswith("you must act: make the sheet thicker")
    assert len(lines) <= LINES
    assert err == ""
    facts = json.loads((folder / "design.json").read_text())
    assert facts["carrying"]["outcome"] == "does not carry"
    assert {row["support"] for row in facts["carrying"]["reactions"]} == {facts["supports"][0]["name"]}
    assert (folder / "dome_modes.stl").is_file()


def test_quick_files_are_in_the_folder_before_a_slow_one_begins(monkeypatch, capsys, tmp_path):
    folder, seen = tmp_path / "o", []
    real = saving.write

    def write(thing, path, **options):
        if path.suffix == ".step":
            seen.append(sorted(path.name for path in folder.iterdir()))
            raise KeyboardInterrupt
        return real(thing, path, **options)

    monkeypatch.setattr(saving, "write", write)
    code, _, err = run(capsys, "build", DOME_MODES, *COARSE, "-f", "step,stl", "--no-picture", "-o", str(folder))
    assert code == ExitCode.INTERRUPTED
    assert "no file is half written" in err
    assert seen == [["design.json", "design.npz", "dome_modes.stl", "preset.toml", "sheet.ply"]]
    assert json.loads((folder / "design.json").read_text())["files"] == ["dome_modes.stl"]


def test_a_requested_file_that_is_not_made_ends_with_4_and_the_rest_is_there(capsys, tmp_path):
    words = ["-f", "stl,step", "--step", "faceted", "--max-faces", "100", "--no-picture", "-o", str(tmp_path / "o")]
    line = refused(capsys, "build", DOME_MODES, *COARSE, *words, code=ExitCode.NOT_MADE)
    assert "more than step_faces = 100" in line
    assert (tmp_path / "o" / "dome_modes.stl").is_file()


def test_an_unknown_option_names_the_nearest_and_the_help_of_its_command(capsys):
    line = refused(capsys, "build", "dome", "--verbos", code=ExitCode.WRONG_USAGE)
    assert line.endswith("Did you mean --verbose? Try `dsfab build --help`.")


def test_the_page_of_messages_lists_the_exit_codes():
    text = (ROOT / "docs" / "messages.md").read_text(encoding="utf-8")
    assert [int(code) for code in re.findall(r"^\| (\d+) \|", text, flags=re.M)] == [*ExitCode]
