"""Which of many right scenes the doctor refuses: none should be.

    python3 scripts/measure_refusals.py FOLDER... [--neat target/release/neat]

Each FOLDER holds scenes, as make_parts.py, make_photographs.py and the sets of dev scenes leave
them. Prints a line for each FOLDER and one for each refused scene, as Markdown.
"""

import argparse
import json
import pathlib
import subprocess


def refusal(neat, scene):
    """What the doctor refuses a scene for; None where it does not."""
    command = [str(neat), "doctor", str(scene), "--json"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    if not run.stdout:
        return run.stderr.strip()
    examination = json.loads(run.stdout)
    problems = [one["message"] for one in examination["findings"] if one["level"] == "problem"]
    return "; ".join(problems) or None


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="+", type=pathlib.Path, metavar="FOLDER")
    parser.add_argument("--neat", default="target/release/neat", type=pathlib.Path)
    options = parser.parse_args()
    print("| scenes | refused | why |\n|---|---|---|")
    for folder in options.folders:
        scenes = sorted(path for path in folder.iterdir() if path.is_dir())
        reasons = {scene.name: refusal(options.neat, scene) for scene in scenes}
        refused = {name: reason for name, reason in reasons.items() if reason is not None}
        print(f"| {folder.name} | {len(refused)} of {len(scenes)} | |", flush=True)
        for name, reason in refused.items():
            print(f"| | {name} | {reason} |", flush=True)


if __name__ == "__main__":
    main()
