"""A COLMAP text model with noise as a reconstruction has it."""

import numpy as np
from scipy.spatial.transform import Rotation

# Errors of poses in degrees and metres, of image points in pixels, and the share of false matches.
TURN, MOVE, PIXEL, FALSE = 0.01, 0.0005, 0.5, 0.01
POINTS = 4000


def write(folder, cameras, pictures, names, sight, scale, random):
    folder.mkdir(parents=True, exist_ok=True)
    poses = []
    for rotation, center, *_ in cameras:
        turn = Rotation.from_rotvec(random.normal(0, np.radians(TURN), 3)).as_matrix()
        poses.append((turn @ rotation, center + random.normal(0, MOVE * scale, 3)))
    tracks = observed(cameras, pictures, sight, scale, random)
    focal, width, height = cameras[0][2:]
    (folder / "cameras.txt").write_text(
        f"1 PINHOLE {width} {height} {focal} {focal} {width / 2} {height / 2}\n"
    )
    per_view, lines = [[] for _ in cameras], []
    for color, track in tracks:
        point, error = triangulated(poses, track, focal, width, height)
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
    for view, ((rotation, center), name) in enumerate(zip(poses, names)):
        x, y, z, w = Rotation.from_matrix(rotation).as_quat()
        t = -rotation @ center
        text.append(
            f"{view + 1} {w:.10f} {x:.10f} {y:.10f} {z:.10f} {t[0]:.8f} {t[1]:.8f} {t[2]:.8f} 1 {name}"
        )
        text.append(" ".join(per_view[view]))
    (folder / "images.txt").write_text("\n".join(text) + "\n")


def observed(cameras, pictures, sight, scale, random):
    """Points at strong gradients: colour, and where views see them."""
    tracks = []
    for camera, picture in zip(cameras, pictures):
        rotation, center, focal, width, height = camera
        grey = picture.mean(2)
        strength = np.hypot(*np.gradient(grey))
        strength[:4], strength[-4:], strength[:, :4], strength[:, -4:] = 0, 0, 0, 0
        weight = np.where(strength > 12, strength, 0).ravel()
        if not weight.any():
            continue
        chosen = random.choice(len(weight), POINTS // len(cameras), p=weight / weight.sum())
        at = np.column_stack([chosen % width, chosen // width]) + 0.5
        rays = (
            np.column_stack([(at - [width / 2, height / 2]) / focal, np.ones(len(at))]) @ rotation
        )
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        away, _ = sight.first(center, rays)
        hit = np.isfinite(away) & (away > 0)
        points = center + away[hit, None] * rays[hit]
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
    rotation, center, focal, width, height = camera
    local = (points - center) @ rotation.T
    depth = np.maximum(local[:, 2], 1e-9)
    at = local[:, :2] / depth[:, None] * focal + [width / 2, height / 2]
    away = np.linalg.norm(points - center, axis=1)
    first, _ = sight.first(center, (points - center) / away[:, None])
    inside = (local[:, 2] > 0) & (at > 1).all(1) & (at < [width - 1, height - 1]).all(1)
    return inside & (first > away - 2e-3 * scale), at


def triangulated(poses, track, focal, width, height):
    """Least squares over rays, then over the picture; the mean error in pixels."""
    rows = [(poses[view], (at - [width / 2, height / 2]) / focal) for view, at in track]
    system, right = np.zeros((3, 3)), np.zeros(3)
    for (rotation, center), at in rows:
        ray = np.array([*at, 1.0]) @ rotation
        ray /= np.linalg.norm(ray)
        across = np.eye(3) - np.outer(ray, ray)
        system += across
        right += across @ center
    point = np.linalg.solve(system, right)
    for _ in range(5):
        jacobian, error = [], []
        for (rotation, center), at in rows:
            x, y, z = rotation @ (point - center)
            if z <= 0:
                return None, None
            jacobian.append(
                focal * np.array([[1 / z, 0, -x / z**2], [0, 1 / z, -y / z**2]]) @ rotation
            )
            error.append(focal * (at - [x / z, y / z]))
        jacobian, error = np.concatenate(jacobian), np.concatenate(error)
        point = point + np.linalg.lstsq(jacobian, error, rcond=None)[0]
    return point, float(np.linalg.norm(error.reshape(-1, 2), axis=1).mean())
