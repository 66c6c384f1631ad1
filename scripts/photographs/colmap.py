"""A COLMAP text model with noise as a reconstruction has it."""

import numpy as np
from scipy.spatial.transform import Rotation

from .cameras import HEIGHT, MIDDLE, WIDTH, Camera, within

# Errors of poses in degrees and metres, of image points in pixels, and the share of false matches.
TURN, MOVE, PIXEL, FALSE = 0.01, 0.0005, 0.5, 0.01
POINTS = 4000


def write(folder, cameras, pictures, names, sight, scale, random):
    folder.mkdir(parents=True, exist_ok=True)
    poses = []
    for camera in cameras:
        turn = Rotation.from_rotvec(random.normal(0, np.radians(TURN), 3)).as_matrix()
        center = camera.center + random.normal(0, MOVE * scale, 3)
        poses.append(Camera(turn @ camera.rotation, center, camera.focal))
    tracks = observed(cameras, pictures, sight, scale, random)
    focal, (x, y) = cameras[0].focal, MIDDLE
    (folder / "cameras.txt").write_text(f"1 PINHOLE {WIDTH} {HEIGHT} {focal} {focal} {x} {y}\n")
    per_view, lines = [[] for _ in cameras], []
    for color, track in tracks:
        point, error = triangulated(poses, track)
        if point is None:
            continue
        text = []
        for view, at in track:
            text.append(f"{view + 1} {len(per_view[view])}")
            per_view[view].append(f"{at[0]:.3f} {at[1]:.3f} {len(lines) + 1}")
        place = " ".join(f"{value:.6f}" for value in point)
        lines.append(
            f"{len(lines) + 1} {place} {' '.join(map(str, color))} {error:.4f} {' '.join(text)}"
        )
    (folder / "points3D.txt").write_text("\n".join(lines) + "\n")
    text = []
    for view, (pose, name) in enumerate(zip(poses, names)):
        x, y, z, w = Rotation.from_matrix(pose.rotation).as_quat()
        t = -pose.rotation @ pose.center
        text.append(
            f"{view + 1} {w:.10f} {x:.10f} {y:.10f} {z:.10f} {t[0]:.8f} {t[1]:.8f} {t[2]:.8f} 1 {name}"
        )
        text.append(" ".join(per_view[view]))
    (folder / "images.txt").write_text("\n".join(text) + "\n")


def observed(cameras, pictures, sight, scale, random):
    """Points at strong gradients: colour, and where views see them."""
    tracks = []
    for camera, picture in zip(cameras, pictures):
        grey = picture.mean(2)
        strength = np.hypot(*np.gradient(grey))
        strength[:4], strength[-4:], strength[:, :4], strength[:, -4:] = 0, 0, 0, 0
        weight = np.where(strength > 12, strength, 0).ravel()
        if not weight.any():
            continue
        chosen = random.choice(len(weight), POINTS // len(cameras), p=weight / weight.sum())
        rays = camera.rays(np.column_stack([chosen % WIDTH, chosen // WIDTH]) + 0.5)
        away, _ = sight.first(camera.center, rays)
        hit = np.isfinite(away) & (away > 0)
        points = camera.center + away[hit, None] * rays[hit]
        colors = picture.reshape(-1, 3)[chosen[hit]]
        seen = [views_of(points, other, sight, scale) for other in cameras]
        for index in range(len(points)):
            track = []
            for view, (visible, places) in enumerate(seen):
                if visible[index] and random.random() < 0.6:
                    wrong = random.random() < FALSE
                    noise = random.normal(0, 8 if wrong else PIXEL, 2)
                    track.append((view, places[index] + noise))
            if len(track) >= 3:
                tracks.append((colors[index].tolist(), track))
    return tracks


def views_of(points, camera, sight, scale):
    at, depth = camera.projected(points)
    away = np.linalg.norm(points - camera.center, axis=1)
    first, _ = sight.first(camera.center, (points - camera.center) / away[:, None])
    return (depth > 0) & within(at, 1) & (first > away - 2e-3 * scale), at


def triangulated(poses, track):
    """Least squares over rays, then over the picture; the mean error in pixels."""
    system, right = np.zeros((3, 3)), np.zeros(3)
    for view, at in track:
        ray = poses[view].rays(at[None])[0]
        across = np.eye(3) - np.outer(ray, ray)
        system += across
        right += across @ poses[view].center
    point = np.linalg.solve(system, right)
    for _ in range(5):
        jacobian, error = [], []
        for view, at in track:
            pose = poses[view]
            x, y, z = pose.rotation @ (point - pose.center)
            if z <= 0:
                return None, None
            by_local = np.array([[1 / z, 0, -x / z**2], [0, 1 / z, -y / z**2]])
            jacobian.append(pose.focal * by_local @ pose.rotation)
            error.append(at - MIDDLE - pose.focal * np.array([x / z, y / z]))
        jacobian, error = np.concatenate(jacobian), np.concatenate(error)
        point = point + np.linalg.lstsq(jacobian, error, rcond=None)[0]
    return point, float(np.linalg.norm(error.reshape(-1, 2), axis=1).mean())
