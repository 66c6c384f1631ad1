"""The same truth and the same bytes as the command; Ctrl-C, progress, resumption."""

import json
import os
import signal
import threading
import time
from pathlib import Path

import neat3d
import numpy as np
import pytest
from conftest import SCENE, neat
from PIL import Image

WIREFRAME = "wireframe.json"


def test_the_object_is_reconstructed(run, truth):
    (report,) = neat3d.evaluate(run.wireframe, truth)
    assert report["protocol"] == "neat-abc"
    shares = [
        value
        for scores in find(report["scores"], dict)
        for name, value in scores.items()
        if name in ("precision", "recall")
    ]
    assert shares and min(shares) >= 0.95


def find(value, kind):
    """Everything of a kind in nested JSON."""
    if isinstance(value, kind):
        yield value
    parts = value.values() if isinstance(value, dict) else value if isinstance(value, list) else []
    for part in parts:
        yield from find(part, kind)


def test_folders_give_the_bytes_of_the_command(scene, run, tmp_path):
    assert neat("reconstruct", scene.folder, "--out", tmp_path / "run").returncode == 0
    assert read(run) == (tmp_path / "run" / WIREFRAME).read_bytes()


def test_synthetic_scenes_are_those_of_the_command(scene, tmp_path):
    options = ["--solid", "box", "--views", SCENE["views"], "--image-size", SCENE["image_size"]]
    assert neat("synth", "--out", tmp_path / "box", *options).returncode == 0
    files = sorted(path.relative_to(tmp_path / "box") for path in (tmp_path / "box").rglob("*.*"))
    assert len(files) > 30
    for name in files:
        assert (tmp_path / "box" / name).read_bytes() == (scene.folder / name).read_bytes()


def test_arrays_give_the_bytes_of_the_command(scene, tmp_path):
    folder = tmp_path / "nerf"
    assert neat("convert", scene.folder, "--to", "transforms-json", "--out", folder).returncode == 0
    assert neat("reconstruct", folder, "--out", tmp_path / "run").returncode == 0

    frames = json.loads((folder / "transforms.json").read_text())["frames"]
    poses = np.array([frame["transform_matrix"] for frame in frames])
    poses[:, :3, 1:3] *= -1  # from OpenGL's axes
    names = [Path(frame["file_path"]).stem for frame in frames]
    k = np.array([[[f["fl_x"], 0, f["cx"]], [0, f["fl_y"], f["cy"]], [0, 0, 1]] for f in frames])
    images = [np.asarray(Image.open(folder / frame["file_path"])) for frame in frames]
    segments = [hawp(folder / "hawp" / f"{name}.json") for name in names]
    arrays = neat3d.Scene.from_arrays(images, k, poses, names=names, segments=segments, name="nerf")
    ours, theirs = (neat3d.Scene(scene) for scene in (arrays.folder, folder))
    assert np.array_equal(ours.poses, theirs.poses) and np.array_equal(ours.K, theirs.K)
    assert all(np.array_equal(ours.image(i), theirs.image(i)) for i in range(len(ours)))

    # Segments do not share vertices here; without them, both detect.
    bare = neat3d.Scene.from_arrays(images, k, poses, names=names, name="bare")
    for path in (folder / "hawp").iterdir():
        path.unlink()
    (folder / "hawp").rmdir()
    assert neat("reconstruct", folder.rename(tmp_path / "bare"), "--out", tmp_path / "again").returncode == 0
    assert read(neat3d.reconstruct(bare)) == (tmp_path / "again" / WIREFRAME).read_bytes()


def hawp(path):
    wireframe = json.loads(path.read_text())
    vertices = np.array(wireframe["vertices"]) + 0.5
    ends = vertices[np.array(wireframe["edges"])].reshape(-1, 4)
    return np.column_stack([ends, wireframe["edges-weights"]])


def read(run):
    return (run.folder / WIREFRAME).read_bytes()


def test_settings_seed_and_threads_are_those_of_the_command(scene, tmp_path):
    settings = {"distill": {"assembler": {"min_evidence": 8}}, "data.max_views": 12}
    run = neat3d.reconstruct(scene, tmp_path / "a", settings=settings, seed=3, threads=1)
    options = ["--set", "distill.assembler.min_evidence=8", "--set", "data.max_views=12", "--seed", 3]
    assert neat("reconstruct", scene.folder, "--out", tmp_path / "b", *options).returncode == 0
    assert read(run) == (tmp_path / "b" / WIREFRAME).read_bytes()
    assert run.manifest["seed"] == 3 and run.manifest["threads"] == 1


def test_progress_hears_the_events_of_the_command(scene, tmp_path):
    events = []
    neat3d.reconstruct(scene, tmp_path / "a", progress=events.append)
    process = neat("reconstruct", scene.folder, "--out", tmp_path / "b", "--progress", "json")
    told = [json.loads(line) for line in process.stderr.splitlines()]
    names = [[e["event"] for e in all if e["event"] not in ("stage_progress", "step")] for all in (events, told)]
    assert names[0] == names[1] and "stage_finished" in names[0]


def test_other_threads_go_on(scene):
    ticks = []
    done = threading.Event()

    def tick():
        while not done.wait(0.005):
            ticks.append(time.monotonic())

    thread = threading.Thread(target=tick)
    thread.start()
    start = time.monotonic()
    neat3d.reconstruct(scene)
    seconds = time.monotonic() - start
    done.set()
    thread.join()
    assert len(ticks) > 10 * seconds


TRAINING = {"train": True, "settings": ["train.steps=60", "train.rays=64"], "threads": 2}


def test_ctrl_c_ends_a_run_that_goes_on_to_the_same_bytes(scene, tmp_path):
    whole = neat3d.reconstruct(scene, tmp_path / "whole", **TRAINING)

    def interrupt(event):
        if event["event"] == "step":
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(neat3d.Interrupted, match="interrupted after step .*resume") as error:
        neat3d.reconstruct(scene, tmp_path / "run", progress=interrupt, **TRAINING)
    assert error.value.exit_code == 130 and isinstance(error.value, KeyboardInterrupt)
    assert json.loads((tmp_path / "run/manifest.json").read_text())["status"] == "interrupted"
    assert read(neat3d.reconstruct(scene, tmp_path / "run", resume=True, train=True)) == read(whole)


def test_an_exception_of_progress_ends_the_run(scene, tmp_path):
    def refuse(event):
        if event["event"] == "step":
            raise ZeroDivisionError(event["event"])

    with pytest.raises(ZeroDivisionError, match="step"):
        neat3d.reconstruct(scene, tmp_path / "run", progress=refuse, **TRAINING)
    assert json.loads((tmp_path / "run/manifest.json").read_text())["status"] == "interrupted"
    # Nothing holds the folder any more.
    neat3d.reconstruct(scene, tmp_path / "run", overwrite=True)


def test_a_time_budget_ends_the_training(scene, tmp_path):
    start = time.monotonic()
    run = neat3d.reconstruct(scene, tmp_path / "run", train=True, time_budget=2.0)
    assert run.manifest["steps"] < 1000 and time.monotonic() - start < 120
    with pytest.warns(neat3d.NeatWarning, match="no effect"):
        neat3d.reconstruct(scene, time_budget=1.0)


def test_temporary_folders_go_with_the_result(scene):
    run = neat3d.reconstruct(scene)
    folder = run.folder
    assert run.report.is_file()
    del run
    assert not folder.exists() and scene.folder.exists()


def test_a_field_answers_for_points(scene, tmp_path):
    run = neat3d.reconstruct(scene, tmp_path / "run", train=True, settings=["train.steps=200"])
    field = neat3d.Run(tmp_path / "run").field()
    points = np.random.default_rng(0).uniform(-0.4, 0.4, (50, 3))
    distance, gradient = field(points), field.gradient(points)
    assert distance.shape == (50,) and gradient.shape == (50, 3)
    # A box of half sizes 0.45, 0.35, 0.25 around the origin.
    assert field([[0, 0, 0]])[0] < 0 < field([[0.9, 0, 0]])[0]
    step = 1e-3
    for axis in np.eye(3):
        slope = (field(points + step * axis) - field(points - step * axis)) / (2 * step)
        assert np.median(np.abs(slope - gradient @ axis)) < 0.05
    segments = field.segments(points)
    assert segments.shape == (50, 2, 3) and np.isfinite(segments).all()
    toward = field.segments(points, -gradient)
    assert np.allclose(toward, segments, atol=1e-4)
    with pytest.raises(neat3d.InputError, match="one per point"):
        field.segments(points, gradient[:3])
    assert field(points.astype("float32").tolist()) == pytest.approx(distance, abs=1e-5)
    assert run.wireframe.metadata["steps"] == 200
