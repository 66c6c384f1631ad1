"""Errors: the exceptions of exit codes, with the sentences of the command."""

import neat3d
import numpy as np
import pytest
from conftest import neat

GRAY = np.zeros((48, 64, 3), np.uint8)
K = [[50.0, 0, 32], [0, 50, 24], [0, 0, 1]]
POSES = [np.eye(4)] * 3


@pytest.mark.parametrize(
    ("python", "command"),
    [
        (dict(settings={"distill.assembler.min_evidnce": 8}), ["--set", "distill.assembler.min_evidnce=8"]),
        (dict(settings={"train": {"steps": "many"}}), ["--set", "train.steps=many"]),
        (dict(backend="ndarray"), ["--backend", "ndarray"]),
        (dict(settings={"data.scene_sphere": "9,9,9,-1"}), ["--set", "data.scene_sphere=9,9,9,-1"]),
    ],
)
def test_what_cannot_be_used_is_said_as_the_command_says_it(scene, tmp_path, python, command):
    process = neat("reconstruct", scene.folder, "--out", tmp_path / "b", *command)
    if process.returncode == 0:
        pytest.skip("the command has been built with this backend")
    with pytest.raises(neat3d.InputError) as error:
        neat3d.reconstruct(scene, tmp_path / "a", **python)
    assert process.returncode == error.value.exit_code == 2
    assert f"error: {error.value}" in process.stderr


def test_a_scene_that_is_not_there(tmp_path):
    with pytest.raises(neat3d.InputError) as error:
        neat3d.reconstruct(tmp_path / "nowhere", tmp_path / "a")
    process = neat("reconstruct", tmp_path / "nowhere", "--out", tmp_path / "b")
    assert f"error: {error.value}" in process.stderr
    assert isinstance(error.value, ValueError) and isinstance(error.value, neat3d.NeatError)


def test_a_folder_that_holds_something(run, scene):
    with pytest.raises(neat3d.InputError, match="is not empty"):
        neat3d.reconstruct(scene, run.folder)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (dict(preset="fats"), "unknown preset `fats`"),
        (dict(preset="fast", config="x.toml"), "give one of them"),
        (dict(resume=True, overwrite=True, out="x"), "give one of them"),
        (dict(resume=True), "give its folder as out"),
        (dict(threads=0), "give at least 1"),
        (dict(time_budget=-1.0), "above 0"),
        (dict(backend="cuda"), "cuda"),
        (dict(settings="train.steps=5"), "give a dict"),
        (dict(train=True, settings={"distill.field": "none"}), "distill.field=none.*give one of them"),
    ],
)
def test_arguments_that_make_no_sense(scene, options, message):
    with pytest.raises(neat3d.InputError, match=message):
        neat3d.reconstruct(scene, **options)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (dict(images=[GRAY, GRAY, GRAY.astype(float)]), "image 2 is float64 .*give uint8"),
        (dict(images=[GRAY, GRAY, GRAY[..., 0]]), r"image 2 is uint8 of the shape \(48, 64\)"),
        (dict(images=[GRAY, GRAY, GRAY[:0]]), "image 2"),
        (dict(images=[GRAY, GRAY]), r"poses has the shape \[3, 4, 4\]: give \(2, 4, 4\)"),
        (dict(images=[], poses=np.zeros((0, 4, 4))), "no view|no image|has no"),
        (dict(K=np.eye(4)), "K has the shape"),
        (dict(K=[[0.0, 0, 3], [0, 1, 3], [0, 0, 1]]), "view `0000`: .*focal"),
        (dict(poses=[np.diag([-1.0, 1, 1, 1])] * 3), "view `0000`: .*mirror"),
        (dict(poses=[np.full((4, 4), np.nan)] * 3), "view `0000`"),
        (dict(names=["a", "b"]), "3 images and 2 names"),
        (dict(names=["a", "b", "b"]), "appears twice"),
        (dict(names=["a", "b", "../c"]), r"\.\./c"),
        (dict(segments=[[], []]), "3 images and 2 segments"),
        (dict(segments=[[], [], [[1, 2, 3]]]), "segments has the shape"),
        (dict(segments=[[], [], [[1, 2, 3, np.nan]]]), "`0002`.*not finite"),
        (dict(points=[[1, 2]]), r"points has the shape \[1, 2\]: give \(N, 3\)"),
        (dict(name="../a"), "give a plain name"),
        (dict(name="a", folder="a"), "give one of them"),
        (dict(pixel_center=0.25), "give 0.5 or 0"),
    ],
)
def test_arrays_that_are_no_scene(change, message):
    arrays = dict(images=[GRAY] * 3, K=K, poses=POSES) | change
    with pytest.raises(neat3d.InputError, match=message):
        neat3d.Scene.from_arrays(arrays.pop("images"), arrays.pop("K"), arrays.pop("poses"), **arrays)


def test_synthetic_scenes_know_their_settings(tmp_path):
    with pytest.raises(neat3d.InputError, match="unknown field `vews`, expected .*`views`"):
        neat3d.Scene.synth(tmp_path / "a", vews=3)
    with pytest.raises(neat3d.InputError, match="views is 0"):
        neat3d.Scene.synth(tmp_path / "a", views=0)


def test_untrained_runs_have_no_field(run):
    with pytest.raises(neat3d.InputError, match="no field|not trained|--train"):
        run.field()


def test_evaluations_need_what_they_measure_against(run, truth):
    for arguments, message in [
        ({}, "nothing to measure against"),
        (dict(protocols=["neat-abc"]), "needs truth"),
        (dict(protocols=["limap-tnt"]), "limap-tnt needs points"),
        (dict(truth=truth, protocols=["limap-tnt"]), "truth has no meaning for limap-tnt"),
        (dict(truth=truth, points=[[0, 0, 0]], protocols=["neat-abc"]), "points has no meaning for neat-abc"),
        (dict(truth=truth, protocols=["neat"]), "neat"),
        (dict(truth="nowhere.json"), "nowhere.json"),
    ]:
        with pytest.raises(neat3d.InputError, match=message):
            neat3d.evaluate(run.wireframe, **arguments)
