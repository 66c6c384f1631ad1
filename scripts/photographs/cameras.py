"""Pinholes, and where they see points."""

from dataclasses import dataclass

import numpy as np

WIDTH, HEIGHT = 1080, 720
MIDDLE = np.array([WIDTH / 2, HEIGHT / 2])


@dataclass
class Camera:
    rotation: np.ndarray
    """Axes right, down and forward in rows."""
    center: np.ndarray
    focal: float

    @classmethod
    def looking(cls, eye, at, focal):
        """Upright, from one point at another."""
        eye, at = np.asarray(eye, float), np.asarray(at, float)
        forward = (at - eye) / np.linalg.norm(at - eye)
        right = np.cross(forward, [0, 0, 1])
        right /= np.linalg.norm(right)
        return cls(np.stack([right, np.cross(forward, right), forward]), eye, focal)

    def projected(self, points):
        """Pixels and depths; pixels behind the camera mean nothing."""
        local = (points - self.center) @ self.rotation.T
        depth = np.where(local[:, 2] > 0, local[:, 2], 1.0)
        return local[:, :2] / depth[:, None] * self.focal + MIDDLE, local[:, 2]

    def rays(self, pixels):
        """Unit directions in space."""
        rays = np.column_stack([(pixels - MIDDLE) / self.focal, np.ones(len(pixels))])
        rays = rays @ self.rotation
        return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def within(pixels, border):
    """Which lie in the picture, so many pixels from its border."""
    return ((pixels > border) & (pixels < 2 * MIDDLE - border)).all(1)
