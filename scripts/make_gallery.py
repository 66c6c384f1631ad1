#!/usr/bin/env python3
"""Makes the pictures of docs/gallery.md, and prints what each wireframe scores.

    scripts/make_gallery.py NEAT DATA RUNS

NEAT is the program, DATA the folder with `photoreal`, RUNS a new folder for the synthetic solid
and the runs. Needs Pillow.
"""
import subprocess
import sys
from pathlib import Path

from PIL import Image

# The photographs, which may be passed on, and which of the overlays that a run writes is shown.
PHOTOGRAPHS = [("house_1", 1), ("facade_1", 2), ("objects_1", 0)]
SOLID = "stair-prism"
# In pixels: a picture is as wide as a page of the documentation.
HEIGHT = 460
JPEG_QUALITY = 82
IMAGES = Path(__file__).resolve().parent.parent / "docs/images"


def scaled(path: Path) -> Image.Image:
    image = Image.open(path).convert("RGB")
    return image.resize((image.width * HEIGHT // image.height, HEIGHT), Image.Resampling.LANCZOS)


def show(neat: str, scene: Path, truth: list[str | Path], run: Path, shown: int) -> None:
    subprocess.run([neat, "reconstruct", scene, "--out", run], check=True)
    subprocess.run([neat, "eval", "--pred", run / "wireframe.json", *truth], check=True)
    overlay = scaled(sorted((run / "overlays").iterdir())[shown])
    wireframe = scaled(run / "wireframe.png")
    picture = Image.new("RGB", (overlay.width + wireframe.width, HEIGHT))
    picture.paste(overlay, (0, 0))
    picture.paste(wireframe, (overlay.width, 0))
    picture.save(IMAGES / f"gallery-{run.name}.jpg", quality=JPEG_QUALITY, optimize=True)


def main() -> None:
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    neat, data, runs = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])
    solid = runs / "scene"
    subprocess.run([neat, "synth", "--solid", SOLID, "--out", solid], check=True)
    show(neat, solid, ["--gt", solid / "gt_wireframe.json"], runs / SOLID, 0)
    for name, shown in PHOTOGRAPHS:
        scene = data / "photoreal" / name
        show(neat, scene, ["--truth", scene], runs / name, shown)


if __name__ == "__main__":
    main()
