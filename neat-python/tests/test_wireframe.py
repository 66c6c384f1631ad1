"""Arrays of a wireframe, its exports, and other packages."""

import json
import multiprocessing
import os
import subprocess
import sys
from pathlib import Path

import neat3d
import numpy as np
import pytest
from conftest import neat


def test_arrays_are_those_of_the_file(run):
    document = json.loads((run.folder / "wireframe.json").read_text())
    wireframe = run.wireframe
    assert np.array_equal(wireframe.junctions, document["junctions"])
    assert np.array_equal(wireframe.edges, document["edges"]) and wireframe.edges.dtype == np.int64
    assert np.array_equal(wireframe.segments, wireframe.junctions[wireframe.edges])
    assert np.array_equal(wireframe.probabilities, document["edge_fields"]["probability"])
    kinds = np.stack([document["edge_fields"][kind] for kind in neat3d.KINDS], axis=1)
    assert np.array_equal(wireframe.kinds, kinds) and np.allclose(kinds.sum(axis=1), 1)
    sizes = {name: len(values) for name, values in wireframe.edge_fields.items()}
    assert sizes == dict.fromkeys(document["edge_fields"], len(wireframe))
    for covariance, stored in zip(wireframe.covariances, document["junction_covariances"]):
        if stored is None:
            assert np.isnan(covariance).all()
        else:
            assert np.array_equal(covariance, covariance.T)
            assert np.array_equal(covariance[np.triu_indices(3)], stored)
    assert wireframe.shells == document["shells"] and any(shell["closed"] for shell in wireframe.shells)
    assert wireframe.views == document["views"] and wireframe.metadata == document["metadata"]
    (view, ends, residual), *_ = wireframe.support[0]
    stored = document["edge_support"][0][0]
    assert [view, list(ends), residual] == [stored["view"], stored["segment"], stored["residual"]]
    with pytest.raises(ValueError, match="read-only"):
        wireframe.junctions[0, 0] = 1


def test_arcs_are_those_of_the_file(tmp_path):
    upper = [1e-4, 0, 1e-5, 0, 2e-4, 0, 0, 3e-4, 0, 4e-4]
    arc = {"center": [0, 0, 1], "axes": [[1, 0, 0], [0, 1, 0]], "radius": 0.5, "angles": [0, 3.1]}
    document = {"junctions": [], "edges": [], "arcs": [arc, dict(arc, radius=2)],
                "arc_covariances": [upper, None]}
    path = tmp_path / "wireframe.json"
    path.write_text(json.dumps(document))
    arcs = neat3d.Wireframe.read(path).arcs
    assert arcs["radii"].tolist() == [0.5, 2] and arcs["angles"][0].tolist() == [0, 3.1]
    assert arcs["centers"].tolist() == [[0, 0, 1]] * 2 and arcs["axes"][1].tolist() == arc["axes"]
    known, unknown = arcs["covariances"]
    assert np.array_equal(known, known.T) and np.array_equal(known[np.triu_indices(4)], upper)
    assert np.isnan(unknown).all()
    none = neat3d.Wireframe([[0, 0, 0], [1, 0, 0]], [[0, 1]]).arcs
    assert {name: array.shape for name, array in none.items()} == {
        "centers": (0, 3), "axes": (0, 2, 3), "radii": (0,), "angles": (0, 2),
        "covariances": (0, 4, 4)}


def test_splines_are_those_of_the_file(tmp_path):
    points = [[0, 0, 0], [1, 0, 0.5], [1, 2, 0], [0, 2, 1], [-1, 1, 0]]
    splines = [{"controls": points, "closed": False}, {"controls": points[:3], "closed": True}]
    path = tmp_path / "wireframe.json"
    path.write_text(json.dumps({"junctions": [], "edges": [], "splines": splines}))
    found = neat3d.Wireframe.read(path).splines
    open_one, closed_one = np.split(found["controls"], np.cumsum(found["sizes"])[:-1])
    assert open_one.tolist() == points and closed_one.tolist() == points[:3]
    assert found["closed"].tolist() == [False, True] and found["sizes"].dtype == np.int64
    none = neat3d.Wireframe([[0, 0, 0], [1, 0, 0]], [[0, 1]]).splines
    assert {name: array.shape for name, array in none.items()} == {
        "controls": (0, 3), "sizes": (0,), "closed": (0,)}


def test_shells_are_those_of_the_file(tmp_path):
    # A disc: its rim is a circle.
    rim = {"center": [0, 0, 1], "axes": [[1, 0, 0], [0, 1, 0]], "radius": 0.5,
           "angles": [0, 2 * np.pi]}
    face = {"plane": {"normal": [0, 0, 1], "offset": 1},
            "loops": [[{"arc": 0, "reversed": False}]]}
    shells = [{"closed": False, "faces": [face]}]
    path = tmp_path / "wireframe.json"
    dome = {"center": [0, 0, 1], "axis": [0, 0, 1], "radius": 0.5, "reach": np.pi / 2}
    path.write_text(json.dumps(
        {"junctions": [], "edges": [], "arcs": [rim], "domes": [dome], "shells": shells}))
    read = neat3d.Wireframe.read(path)
    assert read.shells == shells and read.domes == [dome]
    none = neat3d.Wireframe([[0, 0, 0], [1, 0, 0]], [[0, 1]])
    assert none.shells == [] and none.domes == []


@pytest.mark.parametrize("format", neat3d.FORMATS)
def test_exports_are_those_of_the_command(run, tmp_path, format):
    ours, theirs = tmp_path / "ours" / format, tmp_path / "theirs" / format
    ours.parent.mkdir(), theirs.parent.mkdir()
    run.wireframe.export(ours, format)
    assert neat("export", run.folder, "--out", theirs, "--format", format).returncode == 0
    files = [Path(".")] if theirs.is_file() else [p.relative_to(theirs) for p in theirs.rglob("*.*")]
    assert files
    for name in files:
        assert without_time((ours / name).read_bytes()) == without_time((theirs / name).read_bytes())


def without_time(data):
    """STEP says in its header when it was written."""
    return b"\n".join(line for line in data.split(b"\n") if not line.startswith(b"FILE_NAME"))


def test_exports_have_options(run, tmp_path):
    files = run.wireframe.export(tmp_path / "top.svg", view="top", width=300)
    assert files == [tmp_path / "top.svg"] and 'width="300"' in files[0].read_text()
    for options, message in [
        (dict(view="top"), "view has no meaning for dxf"),
        (dict(unit="m"), "unit has no meaning for dxf"),
        (dict(up="y"), "up has no meaning for dxf"),
    ]:
        with pytest.raises(neat3d.InputError, match=message):
            run.wireframe.export(tmp_path / "a.dxf", **options)
    with pytest.raises(neat3d.InputError, match="names no format"):
        run.wireframe.export(tmp_path / "a.docx")
    with pytest.raises(neat3d.InputError, match="no unit `ft`"):
        run.wireframe.export(tmp_path / "a.step", unit="ft")
    with pytest.raises(neat3d.InputError, match="`north`: give x, y, z"):
        run.wireframe.export(tmp_path / "a.city.json", up="north")


def test_filters_leave_the_certain(run):
    probabilities = run.wireframe.probabilities
    middle = np.median(probabilities)
    certain = run.wireframe.filter(min_probability=middle)
    assert 0 < len(certain) == (probabilities >= middle).sum()
    structure = run.wireframe.kinds[:, :2].sum(axis=1) >= 0.5
    assert len(run.wireframe.filter(only_structure=True)) == structure.sum()
    with pytest.raises(neat3d.InputError, match="from 0 to 1"):
        run.wireframe.filter(min_probability=2)


def test_wireframes_are_made_of_arrays(tmp_path):
    wireframe = neat3d.Wireframe([[0, 0, 0], [1, 0, 0], [1, 2, 0]], [[0, 1], [1, 2]])
    assert repr(wireframe) == "<neat3d.Wireframe: 3 junctions, 2 edges>"
    assert wireframe.probabilities is None and wireframe.kinds is None
    assert np.isnan(wireframe.covariances).all()
    wireframe.export(tmp_path / "a.json")
    assert np.array_equal(neat3d.Wireframe.read(tmp_path / "a.json").segments, wireframe.segments)
    empty = neat3d.Wireframe([], [])
    assert empty.segments.shape == (0, 2, 3) and len(empty) == 0
    for edges in ([[0, 3]], [[0, -1]], [[0, 0.5]]):
        with pytest.raises(neat3d.InputError):
            neat3d.Wireframe([[0, 0, 0], [1, 0, 0]], edges)


class Foreign:
    """An array that speaks DLPack only."""

    def __init__(self, array):
        self.array = array

    def __dlpack__(self, **options):
        return self.array.__dlpack__(**options)

    def __dlpack_device__(self):
        return self.array.__dlpack_device__()


def test_tensors_of_others_are_taken():
    points = np.array([[0, 0, 0], [1, 0, 0.5]], np.float32)
    wireframe = neat3d.Wireframe(Foreign(points), Foreign(np.array([[0, 1]])))
    assert np.array_equal(wireframe.segments[0], points)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the system does not fork")
def test_forked_processes_detect():
    image = np.full((64, 64, 3), 200, np.uint8)
    image[:, :30] = 20
    expected = len(neat3d.detect(image))
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert pool.apply_async(count, (image,)).get(60) == expected


def count(image):
    return len(neat3d.detect(image))


def test_lines_for_trimesh(run):
    pytest.importorskip("trimesh")
    path = run.wireframe.to_trimesh()
    lengths = np.linalg.norm(np.diff(run.wireframe.segments, axis=1), axis=2)
    assert path.length == pytest.approx(lengths.sum())
    assert len(path.entities) == len(run.wireframe)


def test_lines_for_open3d(run):
    pytest.importorskip("open3d")
    lines = run.wireframe.to_open3d()
    assert np.array_equal(np.asarray(lines.lines), run.wireframe.edges)
    assert np.array_equal(np.asarray(lines.points), run.wireframe.junctions)


def test_reconstructions_of_pycolmap(scene, run, tmp_path):
    pycolmap = pytest.importorskip("pycolmap")
    colmap = tmp_path / "colmap"
    assert neat("convert", scene.folder, "--to", "colmap", "--out", colmap).returncode == 0
    model = pycolmap.Reconstruction(str(colmap / "sparse" / "0"))
    ours = neat3d.Scene.from_pycolmap(model, colmap / "images")
    assert ours.names == scene.names
    assert np.allclose(ours.poses, scene.poses, atol=1e-9) and np.allclose(ours.K, scene.K)
    wireframe = neat3d.reconstruct(ours).wireframe
    (report,) = neat3d.evaluate(wireframe, scene.folder / "gt_wireframe.json")
    assert report["scores"]
    with pytest.raises(neat3d.InputError, match="does not exist"):
        neat3d.Scene.from_pycolmap(model, tmp_path / "nowhere")


def test_detection_finds_the_segments_of_an_image():
    image = np.full((64, 64, 3), 200, np.uint8)
    image[:, :30] = 20
    segments = neat3d.detect(image)
    longest = segments.ends[np.argmax(np.abs(segments.ends[:, 3] - segments.ends[:, 1]))]
    # Between the columns 29 and 30, whose border is 30 from the image's.
    assert longest[[0, 2]] == pytest.approx([30, 30], abs=0.05)
    assert segments.scores.shape == (len(segments),)
    assert np.array_equal(segments.vertices[segments.edges].reshape(-1, 4), segments.ends)
    rough = neat3d.detect(image, segments=[[30.4, 5, 29.7, 58]])
    assert rough.ends[0][[0, 2]] == pytest.approx([30, 30], abs=0.05)
    assert len(neat3d.detect(image, {"min_length": 400.0})) == 0
    with pytest.raises(neat3d.InputError, match="min_length"):
        neat3d.detect(image, {"min_length": -1.0})


def test_detections_are_those_of_a_scene_and_of_the_command(scene, tmp_path):
    assert neat("detect", scene.folder / "images", "--out", tmp_path, "--no-overlays").returncode == 0
    ours = neat3d.detect(scene.image(0))
    theirs = json.loads((tmp_path / f"{scene.names[0]}.json").read_text())
    assert np.allclose(ours.vertices - 0.5, theirs["vertices"], atol=1e-12)
    assert np.array_equal(ours.edges, theirs["edges"])


def test_stubs_say_what_there_is():
    stubtest = pytest.importorskip("mypy.stubtest")
    del stubtest
    command = [sys.executable, "-m", "mypy.stubtest", "neat3d", "--ignore-disjoint-bases"]
    command += ["--mypy-config-file", str(Path(__file__).parent.parent / "pyproject.toml")]
    process = subprocess.run(command, capture_output=True, text=True)
    assert process.returncode == 0, process.stdout + process.stderr


def test_the_import_is_light():
    program = "import neat3d, sys; assert 'numpy' not in sys.modules"
    subprocess.run([sys.executable, "-c", program], check=True)


def test_everything_is_documented():
    for name in neat3d.__all__:
        thing = getattr(neat3d, name)
        if not callable(thing):
            continue
        assert thing.__doc__, name
        for member, value in vars(thing).items() if isinstance(thing, type) else ():
            if not member.startswith("_") and member != "exit_code":
                assert value.__doc__, f"{name}.{member}"
