"""Grasshopper's Hops: our server takes what Hops sends, and McNeel's own Python server reads what ours answers."""

import http.client
import json
import subprocess
import sys
import threading
from contextlib import closing, contextmanager

import numpy as np
import pytest
import rhino3dm
from ghhops_server import base, params

from dsfab.app.cli import main
from dsfab.app.hops import components
from dsfab.app.hops.components import COMPONENTS, changes_from_toml, preset_of_request
from dsfab.app.hops.protocol import HopsComponent, HopsError, HopsParameter, read_request
from dsfab.app.hops.server import HopsServer, Solver, solve_request
from dsfab.export import mesh_json, polyline_json
from dsfab.surface.files.rhino_and_step import read_rhino_json
from dsfab.surface.shapes import barrel_vault

params._init_rhino3dm()

VAULT = barrel_vault(edge=1.0)
ECHO = (("mesh", "Mesh"), ("points", "Point"), ("number", "Number"), ("text", "Text"))


def sent(name, kind, *data):
    """A value as Hops sends it: branches of items, JSON in JSON."""
    return {"ParamName": name, "InnerTree": {"{0}": [{"type": kind, "data": one} for one in data]}}


def body(*values, unit="Meters", pointer="/preview"):
    """What Hops posts to /solve."""
    head = {"absolutetolerance": 0.001, "angletolerance": 1.0, "modelunits": unit, "algo": None, "pointer": pointer}
    return {**head, "cachesolve": False, "recursionlevel": 0, "values": list(values), "warnings": [], "errors": []}


def polyline_points(text):
    curve = rhino3dm.CommonObject.Decode(json.loads(text))
    return np.array([(p.X, p.Y, p.Z) for p in (curve.Point(i) for i in range(curve.PointCount))])


def vault(scale=1.0):
    return sent("mesh", "Rhino.Geometry.Mesh", mesh_json(VAULT.V * scale, VAULT.F))


def read(answer, name):
    """Our answer through the reader of McNeel's server."""
    (value,) = (one for one in answer["values"] if one["ParamName"] == name)
    kind = {"Mesh": params.HopsMesh, "Curve": params.HopsCurve, "Number": params.HopsNumber, "Text": params.HopsString}
    output = next(one for whole in COMPONENTS.values() for one in whole.outputs if one.name == name)
    access = params.HopsParamAccess.LIST if output.is_list else params.HopsParamAccess.ITEM
    reader = kind[output.kind](name, access=access)
    return reader.from_input({"ParamName": name, "InnerTree": {"{0}": value["InnerTree"]["0"]}})


@contextmanager
def serving(seconds=120.0):
    with Solver(seconds) as solver, HopsServer(solver) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05})
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


def asked(server, method, path, content=None, **headers):
    connection = http.client.HTTPConnection(*server.server_address[:2], timeout=120)
    given = {"Host": f"localhost:{server.server_address[1]}", **headers}
    with closing(connection):
        connection.request(method, path, json.dumps(content) if isinstance(content, dict) else content, given)
        response = connection.getresponse()
        return response.status, response.read()


def mesh_arrays(text):
    mesh = read_rhino_json(text)
    return mesh.V, mesh.F


def test_a_mesh_survives_the_round_trip_through_json():
    V, F = mesh_arrays(mesh_json(VAULT.V, VAULT.F))
    assert np.array_equal(F, VAULT.F)
    assert np.array_equal(V, VAULT.V)
    points = np.array([[0.0, 0, 0], [1, 2, 3], [4, 5, 7]])
    assert np.array_equal(polyline_points(polyline_json(points)), points)
    assert np.array_equal(polyline_points(polyline_json(points[:, :2]))[:, 2], [0, 0, 0])


def test_a_quad_becomes_two_triangles_along_its_shorter_diagonal():
    mesh = rhino3dm.Mesh()
    for point in [(0, 0, 0), (4, 0, 0), (5, 1, 0), (1, 1, 0)]:
        mesh.Vertices.Add(*map(float, point))
    mesh.Faces.AddFace(0, 1, 2, 3)
    V, F = mesh_arrays(json.dumps(mesh.Encode()))
    shared = set(F[0]) & set(F[1])
    assert shared == {1, 3}
    assert sorted(np.cross(V[f[1]] - V[f[0]], V[f[2]] - V[f[0]])[2] for f in F) == [4, 4]


def test_components_are_described_as_mcneels_server_describes_its_own():
    """The same fields, of the same types; Hops makes its sockets of them."""
    hops = base.HopsBase(None)
    kinds = {"Mesh": params.HopsMesh, "Point": params.HopsPoint, "Number": params.HopsNumber, "Text": params.HopsString}

    @hops.component(
        "/structure",
        name="structure",
        inputs=[kinds[one.kind](one.name, one.nickname, one.about) for one in components.INPUTS],
        outputs=[params.HopsMesh("solid", "So", "The watertight solid.")],
    )
    def reference(mesh, supports, snow, spacing, thickness, share, preset):
        """For its description alone."""

    theirs = json.loads(hops.query("/structure")[1])
    ours = COMPONENTS["structure"].description_json()
    assert set(ours) == set(theirs)
    for mine, other in zip(ours["Inputs"], theirs["Inputs"], strict=True):
        assert set(mine) == set(other) - {"Default"}
        assert {key: mine[key] for key in ("Name", "ParamType", "ResultType")} == {
            key: other[key] for key in ("Name", "ParamType", "ResultType")
        }
    assert ours["Outputs"][0]["ResultType"] == theirs["Outputs"][0]["ResultType"]


def test_mcneels_server_gives_the_same_answer_to_the_same_request():
    """A component that gives back what it gets, of ours and of theirs, asked in the same bytes."""
    given = [HopsParameter(name, name, name, kind, name == "points") for name, kind in ECHO]
    ours = HopsComponent("echo", "", tuple(given), tuple(given), lambda request: returned(**request.values))
    hops = base.HopsBase(None)
    kinds = {"Mesh": params.HopsMesh, "Point": params.HopsPoint, "Number": params.HopsNumber, "Text": params.HopsString}
    access = {True: params.HopsParamAccess.LIST, False: params.HopsParamAccess.ITEM}
    sockets = [kinds[one.kind](one.name, one.nickname, one.about, access=access[one.is_list]) for one in given]

    @hops.component("/echo", name="echo", inputs=sockets, outputs=sockets)
    def reference(mesh, points, number, text):
        return mesh, points, number, text

    corners = [json.dumps(dict(zip("XYZ", point, strict=True))) for point in VAULT.V[:2].tolist()]
    request = body(
        vault(),
        sent("points", "Rhino.Geometry.Point3d", *corners),
        sent("number", "System.Double", "0.5"),
        sent("text", "System.String", json.dumps("a = 'b'")),
        pointer="/echo",
    )
    done, text = hops.solve("/solve", json.dumps(request))
    assert done, text
    theirs, mine = json.loads(text)["values"], ours.answer(read_request(ours, request))["values"]
    for one, other in zip(mine, theirs, strict=True):
        assert one["ParamName"] == other["ParamName"]
        assert list(one["InnerTree"]) == list(other["InnerTree"])
        for item, reference_item in zip(one["InnerTree"]["0"], other["InnerTree"]["0"], strict=True):
            assert item["type"] == reference_item["type"]
            if one["ParamName"] == "mesh":
                assert all(map(np.array_equal, mesh_arrays(item["data"]), mesh_arrays(reference_item["data"])))
            else:
                assert json.loads(item["data"]) == json.loads(reference_item["data"])


def returned(mesh, points, number, text):
    return mesh_json(mesh.V, mesh.F), [dict(zip("XYZ", point, strict=True)) for point in points], number, text


def test_connected_inputs_override_the_proposed_preset():
    more = [
        sent("snow", "System.Double", "1200"),
        sent("spacing", "System.Double", "900.0"),
        sent("thickness", "System.Double", "150.0"),
        sent("share", "System.Double", "0.5"),
        sent("preset", "System.String", json.dumps("pattern.rotate = 45"), json.dumps("statics.material = 'S235'")),
    ]
    request = read_request(COMPONENTS["preview"], body(vault(1000), *more, unit="Millimeters"))
    preset = preset_of_request(request)
    assert [load.kind for load in preset.surface.load] == ["self_weight", "snow"]
    assert preset.surface.load[1].pressure == 1200
    assert preset.pattern.major.spacing == preset.pattern.minor.spacing == pytest.approx(0.9)
    assert preset.statics.thickness == pytest.approx(0.15)
    assert preset.pattern.width.solid_fraction == 0.5
    assert (preset.pattern.rotate, preset.statics.material) == (45, "S235")


def test_points_are_feet_in_the_unit_of_the_model():
    low = VAULT.V[:, 2] < VAULT.V[:, 2].min() + 1e-6
    chosen = (1000 * VAULT.V[low][[0, 5, -1]]).tolist()
    corners = [json.dumps(dict(zip("XYZ", point, strict=True))) for point in chosen]
    request = read_request(
        COMPONENTS["preview"],
        body(vault(1000), sent("supports", "Rhino.Geometry.Point3d", *corners), unit="Millimeters"),
    )
    feet = preset_of_request(request).surface.support
    assert [foot.name for foot in feet] == ["foot 1", "foot 2", "foot 3"]
    assert np.allclose(feet[0].at.center, VAULT.V[low][0])


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ([], "mesh: nothing is connected"),
        ([sent("mesh", "Rhino.Geometry.Mesh", "{}")], "mesh: the text is not Rhino's JSON of a geometry"),
        ([sent("mesh", "Rhino.Geometry.Curve", polyline_json(np.eye(3)))], "mesh: the geometry is a"),
        ([vault(), sent("snow", "System.Double", '"much"')], "snow: '\"much\"' is not a number"),
        ([vault(), sent("snow", "System.Double", "NaN")], "snow: 'NaN' is not a number"),
        ([vault(), sent("snow", "System.Double", "1", "2")], "snow: 2 values are connected; connect a single value"),
        ([vault(), sent("preset", "System.String", '"pattern.rotate ="')], "preset: "),
        ([vault(), sent("preset", "System.String", '"pattern.rotat = 4"')], "did you mean rotate?"),
        ([vault(), sent("share", "System.Double", "7")], "pattern.width.solid_fraction = 7"),
    ],
)
def test_an_invalid_input_gives_one_sentence_on_the_component(values, told):
    done, text = solve_request("preview", body(*values))
    assert not done
    assert told in text
    assert "Traceback" not in text


def test_a_malformed_request_is_refused():
    with pytest.raises(HopsError, match="not a request of Hops"):
        read_request(COMPONENTS["preview"], {"values": [1]})
    with pytest.raises(HopsError, match="the unit of the model is parsecs"):
        read_request(COMPONENTS["preview"], body(vault(), unit="Parsecs"))
    assert changes_from_toml("[pattern]\nrotate = 4\nmajor = { spacing = 1 }") == {
        "pattern.rotate": 4,
        "pattern.major.spacing": 1,
    }


WIDE = sent(
    "preset",
    "System.String",
    json.dumps("surface.edge = 0.5\npattern.major.spacing = 1.6\npattern.minor.spacing = 1.6"),
)
"""Wide members, on larger triangles."""


@pytest.mark.slow
def test_a_preview_is_the_sheet_in_the_unit_of_the_model(monkeypatch):
    done, text = solve_request("preview", body(vault(1000), WIDE, unit="Millimeters"))
    assert done, text
    answer = json.loads(text)
    sheet = read(answer, "sheet")
    box = sheet.GetBoundingBox()
    long = box.Max.X - box.Min.X
    assert long == pytest.approx(1000 * np.ptp(VAULT.V[:, 0]), rel=0.02)
    lines = read(answer, "lines")
    assert len(lines) > 5
    assert all(line.IsValid for line in lines)
    assert all(isinstance(one, str) for one in read(answer, "notes"))
    monkeypatch.setattr(components.Design, "from_preset", lambda *_: pytest.fail("fed alike, it was made again"))
    done, text = solve_request("members", body(vault(1000), WIDE, unit="Millimeters"))
    assert done, text
    told = json.loads(text)
    axes, lengths, names = read(told, "axes"), read(told, "lengths"), read(told, "names")
    assert len(set(names)) == len(axes) == len(lengths)
    assert max(lengths) == pytest.approx(max(axis.PointAtStart.DistanceTo(axis.PointAtEnd) for axis in axes), rel=1.0)


def test_the_server_lists_describes_and_turns_pages_away():
    with serving() as server:
        status, text = asked(server, "GET", "/")
        assert status == 200
        assert [one["Name"] for one in json.loads(text)] == list(COMPONENTS)
        assert json.loads(asked(server, "GET", "/members")[1]) == COMPONENTS["members"].description_json()
        assert asked(server, "GET", "/nothing")[0] == 404
        assert asked(server, "HEAD", "/")[0] == 200
        assert asked(server, "GET", "/", Host="evil.example")[0] == 403
        assert asked(server, "POST", "/solve", body(vault()), Origin="http://evil.example")[0] == 403
        assert asked(server, "POST", "/solve", "[]")[0] == 400
        assert asked(server, "POST", "/solve", body(pointer="/nothing"))[0] == 404
        with closing(http.client.HTTPConnection(*server.server_address[:2], timeout=120)) as connection:
            connection.putrequest("POST", "/solve", skip_host=True)
            for name, value in (("Host", f"localhost:{server.server_address[1]}"), ("Content-Length", str(10**10))):
                connection.putheader(name, value)
            connection.endheaders()
            with connection.getresponse() as response:
                assert response.status == 413


@pytest.mark.slow
def test_the_hops_server_solves_requests_and_ends_slow_ones():
    with serving() as server:
        wide = "surface.edge = 0.7\npattern.major.spacing = 2\npattern.minor.spacing = 2"
        lines = f"statics.material = 'S235'\nworkshop.thickness = 0.002\n{wide}"
        more = sent("preset", "System.String", json.dumps(lines))
        status, text = asked(server, "POST", "/solve", body(vault(), more, pointer="/structure"))
        assert status == 200, text
        answer = json.loads(text)
        solid = read(answer, "solid")
        assert solid.IsClosed
        assert solid.IsManifold(True)[0] if isinstance(solid.IsManifold(True), tuple) else solid.IsManifold(True)
        assert read(answer, "mass") > 100
        assert read(answer, "compliance") > 0
        assert len(read(answer, "names")) == len(read(answer, "lines"))
        status, text = asked(server, "POST", "/parts", body(vault(), more))
        assert status == 200, text
        drawn = json.loads(text)
        assert len(read(drawn, "cut")) >= len(read(drawn, "stock")) > 0
        assert all(curve.IsClosed for curve in read(drawn, "holes"))
        status, text = asked(server, "POST", "/preview", body())
        assert status == 500
        assert json.loads(text)["errors"][0].startswith("mesh: nothing is connected")
        server.solver.seconds = 0.01
        status, text = asked(server, "POST", "/structure", body(vault(), more, sent("snow", "System.Double", "3000")))
        assert status == 500
        assert "was stopped" in json.loads(text)["errors"][0]
        server.solver.seconds = 120
        assert asked(server, "POST", "/preview", body(vault(), more))[0] == 200  # and it lives on


def test_without_rhino3dm_the_command_names_the_package_to_install(monkeypatch, capsys):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert main(["hops"]) == 1
    assert 'geometry of Grasshopper needs the library rhino3dm; install it with: pip install "dsfab[rhino]"' in (
        capsys.readouterr().err
    )


def test_the_command_prints_addresses_and_ends_with_ctrl_c(capsys):
    assert main(["hops", "--port", "70000"]) == 1
    assert "port 70000 cannot be used" in capsys.readouterr().err
    assert main(["hops", "--seconds", "0"]) == 1
    program = [sys.executable, "-c", "from dsfab.app.cli import main; raise SystemExit(main(['hops', '--port', '0']))"]
    with subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        first = process.stdout.readline()
        assert first.startswith("http://localhost:")
        process.send_signal(2)
        assert process.wait(60) == 0
        assert process.stderr.read() == ""
