"""What the measuring scripts share: to run the program once and read what it left."""

import json
import pathlib
import subprocess


def call(*command):
    """Runs a program; returns its standard output."""
    command = [str(part) for part in command]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def reconstruct(neat, scene, run, seed, *arguments):
    """Runs neat unless that has been done; returns the run's manifest."""
    manifest = pathlib.Path(run) / "manifest.json"
    done = manifest.is_file() and json.loads(manifest.read_text())["status"] == "finished"
    if not done:
        call(neat, "reconstruct", scene, "--out", run, "--overwrite", "--quiet",
             "--backend", "flex", "--seed", seed, *arguments)
    return json.loads(manifest.read_text())


def settings(pairs):
    """The arguments for what `--set` was given."""
    return [part for pair in pairs for part in ("--set", pair)]


def f_score(precision, recall):
    """Their harmonic mean; 0 where both are."""
    return 2 * precision * recall / (precision + recall) if precision + recall > 0 else 0.0
