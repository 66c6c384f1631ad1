#!/usr/bin/env python3
"""LIMAP 2 on 2D segments of ours, for comparison on the same input.

usage: scripts/limap_lines.py SCENE DETECTIONS OUT.json [--neighbours 10] [--points] [--min-views 4]

SCENE       a folder with a COLMAP model in sparse/0 (undistorted pinhole cameras)
DETECTIONS  a run's detections/ (HAWP JSON per view, pixel centres at integers: half a pixel is added)
OUT.json    {"junctions": [[x, y, z]...], "edges": [[i, j]...]}, two junctions per line, frame of the model

Its core only: exhaustive epipolar candidates among the nearest cameras, no vanishing points, with or
without the sparse points, no bundle adjustment. Needs PyPI pylimap 2.0.0 (BSD-3).
"""
import argparse, json, time
from pathlib import Path
import numpy as np, pycolmap, limap
from limap.geometry import Line2d
from limap.scene import StructureDatabase
import limap.scene.structure_database_utils as database_utils
import limap.sfm as sfm
from limap.sfm.pipelines import global_line_triangulation

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument('scene', type=Path); parser.add_argument('detections', type=Path); parser.add_argument('out', type=Path)
parser.add_argument('--neighbours', type=int, default=10); parser.add_argument('--points', action='store_true')
parser.add_argument('--min-views', type=int, default=4); parser.add_argument('--threads', type=int, default=2)
a = parser.parse_args()

model = pycolmap.Reconstruction(str(a.scene / 'sparse/0'))
lines, centres = {}, {}
for key, image in model.images.items():
    found = json.loads((a.detections / (Path(image.name).stem + '.json')).read_text())
    ends = np.array(found['vertices'], float) + 0.5
    lines[key] = [Line2d(ends[i], ends[j]) for (i, j), s in zip(found['edges'], found['edges-weights']) if s > 0.05]
    centres[key] = image.projection_center()
path = a.out.with_suffix('.db'); path.unlink(missing_ok=True)
database_utils.create_structure_db(path)
with StructureDatabase.open(path) as database:
    database_utils.initialize_structures_from_reconstruction(database, model)
    database_utils.import_line_detections(database, lines)
near = {i: sorted((j for j in centres if j != i), key=lambda j: np.linalg.norm(centres[i] - centres[j]))[:a.neighbours] for i in centres}
options = sfm.GlobalLineTriangulationOptions()
options.num_threads = a.threads
options.use_vp_assisted_triangulation = False
options.use_point_assisted_triangulation = a.points
options.min_visible_views = a.min_views
start = time.time()
result = global_line_triangulation(model, path, options, near)
seconds = time.time() - start
junctions, edges = [], []
for line in result.structure_recon.lines3D.values():
    if len({e.image_id for e in line.track.elements}) >= a.min_views:
        edges.append([len(junctions), len(junctions) + 1])
        junctions += [list(map(float, line.start)), list(map(float, line.end))]
a.out.write_text(json.dumps({'junctions': junctions, 'edges': edges}))
print(f'{sum(map(len, lines.values()))} 2D segments, {len(edges)} lines, {seconds:.1f} s')
