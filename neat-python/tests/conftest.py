"""A synthetic scene, what the command `neat` makes of it, and what Python makes of it."""

import os
import subprocess
from pathlib import Path

import neat3d
import pytest

# Of the detections of 16 views of 128 pixels, the box is found whole.
SCENE = {"solid": "box", "views": 16, "image_size": 128}


def neat(*arguments):
    """Runs the command; NEAT says where it is."""
    command = os.environ.get("NEAT")
    if command is None:
        pytest.skip("NEAT does not name the command to compare with")
    return subprocess.run([command, *map(str, arguments)], capture_output=True, text=True)


@pytest.fixture(scope="session", autouse=True)
def cache(tmp_path_factory):
    """No results of other sessions, and none left behind."""
    os.environ["NEAT_CACHE"] = str(tmp_path_factory.mktemp("cache"))


@pytest.fixture(scope="session")
def scene(tmp_path_factory):
    return neat3d.Scene.synth(tmp_path_factory.mktemp("synth") / "box", **SCENE)


@pytest.fixture(scope="session")
def run(scene):
    return neat3d.reconstruct(scene)


@pytest.fixture(scope="session")
def truth(scene):
    return Path(scene.folder) / "gt_wireframe.json"
