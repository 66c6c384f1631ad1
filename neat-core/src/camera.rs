//! Pinhole cameras with pose.

use nalgebra::{Matrix3, Matrix4, RowVector4, Vector2, Vector3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Pinhole intrinsics: the matrix `[[fx, skew, cx], [0, fy, cy], [0, 0, 1]]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Intrinsics {
    /// Focal length along x, in pixels.
    pub fx: f64,
    /// Focal length along y, in pixels.
    pub fy: f64,
    /// Principal point, x.
    pub cx: f64,
    /// Principal point, y.
    pub cy: f64,
    /// Skew, in pixels.
    pub skew: f64,
}

impl Intrinsics {
    /// From an intrinsic matrix of any scale, checked.
    ///
    /// # Errors
    /// If the matrix is not upper triangular with positive focal lengths.
    pub fn try_from_matrix(k: &Matrix3<f64>) -> Result<Self, CameraError> {
        if k.iter().any(|x| !x.is_finite()) {
            return Err(CameraError::NotFinite);
        }
        let tolerance = 1e-6 * k[(2, 2)].abs();
        let lower = [k[(1, 0)], k[(2, 0)], k[(2, 1)]];
        if k[(2, 2)] == 0.0 || lower.iter().any(|x| x.abs() > tolerance) {
            return Err(CameraError::Intrinsics);
        }
        let intrinsics = Self::from_matrix(k);
        intrinsics.validate().map(|()| intrinsics)
    }

    /// Checks that all numbers are finite and the focal lengths positive.
    ///
    /// # Errors
    /// If they are not.
    pub fn validate(&self) -> Result<(), CameraError> {
        let Self {
            fx,
            fy,
            cx,
            cy,
            skew,
        } = *self;
        if [fx, fy, cx, cy, skew].iter().any(|x| !x.is_finite()) {
            return Err(CameraError::NotFinite);
        }
        if fx <= 0.0 || fy <= 0.0 {
            return Err(CameraError::FocalLength { fx, fy });
        }
        Ok(())
    }

    /// From the upper left 3×3 of an intrinsic matrix.
    pub fn from_matrix(k: &Matrix3<f64>) -> Self {
        let scale = k[(2, 2)];
        Self {
            fx: k[(0, 0)] / scale,
            fy: k[(1, 1)] / scale,
            cx: k[(0, 2)] / scale,
            cy: k[(1, 2)] / scale,
            skew: k[(0, 1)] / scale,
        }
    }

    /// Rectangular pixels: focal lengths and principal point, in pixels.
    pub fn new(fx: f64, fy: f64, cx: f64, cy: f64) -> Self {
        let skew = 0.0;
        Self {
            fx,
            fy,
            cx,
            cy,
            skew,
        }
    }

    /// Square pixels, and the principal point in the middle of an image of
    /// `size` = (width, height) whose corner is the origin.
    pub fn centered(focal_length: f64, (width, height): (u32, u32)) -> Self {
        let (cx, cy) = (f64::from(width) / 2.0, f64::from(height) / 2.0);
        Self::new(focal_length, focal_length, cx, cy)
    }

    /// With focal lengths that are `factor` times as long.
    pub fn with_focal_factor(self, factor: f64) -> Self {
        Self {
            fx: self.fx * factor,
            fy: self.fy * factor,
            skew: self.skew * factor,
            ..self
        }
    }

    /// As a matrix.
    pub fn matrix(&self) -> Matrix3<f64> {
        Matrix3::new(
            self.fx, self.skew, self.cx, 0.0, self.fy, self.cy, 0.0, 0.0, 1.0,
        )
    }

    /// Image coordinates → calibrated coordinates (on z = 1).
    pub fn calibrate(&self, point_in_image: &Vector2<f64>) -> Vector2<f64> {
        let y = (point_in_image.y - self.cy) / self.fy;
        Vector2::new((point_in_image.x - self.cx - self.skew * y) / self.fx, y)
    }

    /// Calibrated coordinates → image coordinates.
    #[inline]
    pub fn decalibrate(&self, calibrated: &Vector2<f64>) -> Vector2<f64> {
        Vector2::new(
            self.fx * calibrated.x + self.skew * calibrated.y + self.cx,
            self.fy * calibrated.y + self.cy,
        )
    }
}

/// A half-line in space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where the ray starts.
    pub origin: Vector3<f64>,
    /// Unit direction.
    pub direction: Vector3<f64>,
}

impl Ray {
    /// Distances at which it enters and leaves the ball of radius `radius` around the origin,
    /// from its own origin on; `None` where it misses the ball.
    pub fn interval_in_ball(&self, radius: f64) -> Option<[f64; 2]> {
        let middle = -self.origin.dot(&self.direction);
        let nearest = self.origin + middle * self.direction;
        let squared_half = radius * radius - nearest.norm_squared();
        let half = (squared_half > 0.0).then(|| squared_half.sqrt())?;
        let far = middle + half;
        (far > 0.0).then(|| [(middle - half).max(0.0), far])
    }

    /// The point halfway between the nearest points of both rays; `None` where one of these lies
    /// behind its ray, or the rays are parallel.
    pub fn meeting(&self, other: &Self) -> Option<Vector3<f64>> {
        let cosine = self.direction.dot(&other.direction);
        let squared_sine = 1.0 - cosine * cosine;
        let between = other.origin - self.origin;
        let [own, others] = [self, other].map(|ray| between.dot(&ray.direction));
        let near = (own - cosine * others) / squared_sine;
        let far = (cosine * own - others) / squared_sine;
        (near > 0.0 && far > 0.0 && near.is_finite() && far.is_finite()).then(|| {
            0.5 * (self.origin + self.direction * near + other.origin + other.direction * far)
        })
    }
}

/// Where a world point appears in a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection {
    /// Image coordinates in pixels.
    pub pixel: Vector2<f64>,
    /// Coordinates on the plane z = 1.
    pub calibrated: Vector2<f64>,
    /// z in the camera frame: positive in front of the camera.
    pub depth: f64,
}

/// A posed pinhole camera of a `width × height` image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Focal lengths, principal point and skew.
    pub intrinsics: Intrinsics,
    /// Rotation part of the camera-to-world pose.
    pub world_from_camera: Matrix3<f64>,
    /// Centre of projection in the world.
    pub center_in_world: Vector3<f64>,
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
}

/// Why a camera cannot be used.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum CameraError {
    /// NaN or an infinite number.
    #[error("its intrinsics or pose hold a number that is not finite: estimate the pose again")]
    NotFinite,
    /// An image without pixels.
    #[error("its image has no pixels")]
    NoPixels,
    /// A focal length that is zero or negative.
    #[error("its focal lengths {fx} and {fy} are not both positive")]
    FocalLength {
        /// Focal length along x, in pixels.
        fx: f64,
        /// Focal length along y, in pixels.
        fy: f64,
    },
    /// An intrinsic matrix that is not upper triangular or not of scale ≠ 0.
    #[error("its intrinsic matrix is not [[fx, skew, cx], [0, fy, cy], [0, 0, 1]] up to scale")]
    Intrinsics,
    /// A pose without inverse.
    #[error("its pose is singular: the rotation has determinant {determinant:.1e}")]
    Singular {
        /// Determinant of the rotation part.
        determinant: f64,
    },
    /// A pose that turns a right hand into a left hand.
    #[error(
        "its pose is mirrored (determinant {determinant:.3}): convert it to OpenCV axes, \
         x right, y down, z forward"
    )]
    Mirrored {
        /// Determinant of the rotation part.
        determinant: f64,
    },
    /// A 3×3 part that also scales or shears, or a last row other than 0 0 0 1.
    #[error(
        "its pose is not a rigid camera-to-world matrix: the rotation is off by {deviation:.1e}"
    )]
    NotRigid {
        /// Largest element of |RᵀR − 1|, or of the error of the last row.
        deviation: f64,
    },
}

/// How far RᵀR may be from the identity: poses are often stored as `f32`, or
/// with few digits as text.
const RIGIDITY_TOLERANCE: f64 = 1e-3;

/// Depths nearer to the camera plane than this are pushed away from zero before
/// the perspective division, as the published code does.
const DEPTH_GUARD: f64 = 1e-8;

impl Camera {
    /// From intrinsics and a 4×4 camera-to-world matrix.
    pub fn from_matrices(
        intrinsics: Intrinsics,
        world_from_camera: &Matrix4<f64>,
        width: u32,
        height: u32,
    ) -> Self {
        Self {
            intrinsics,
            world_from_camera: world_from_camera.fixed_view::<3, 3>(0, 0).into_owned(),
            center_in_world: world_from_camera.fixed_view::<3, 1>(0, 3).into_owned(),
            width,
            height,
        }
    }

    /// From intrinsics and a 4×4 camera-to-world matrix, checked.
    ///
    /// # Errors
    /// If the last row is not 0 0 0 1, or as [`Self::validate`].
    pub fn try_from_matrices(
        intrinsics: Intrinsics,
        world_from_camera: &Matrix4<f64>,
        width: u32,
        height: u32,
    ) -> Result<Self, CameraError> {
        if world_from_camera.iter().any(|x| !x.is_finite()) {
            return Err(CameraError::NotFinite);
        }
        let camera = Self::from_matrices(intrinsics, world_from_camera, width, height);
        camera.validate()?;
        let deviation = (world_from_camera.row(3) - RowVector4::new(0.0, 0.0, 0.0, 1.0)).amax();
        if deviation > RIGIDITY_TOLERANCE {
            return Err(CameraError::NotRigid { deviation });
        }
        Ok(camera)
    }

    /// Checks that the camera has pixels, positive focal lengths and a rigid,
    /// right-handed pose of finite numbers.
    ///
    /// # Errors
    /// If it has not.
    pub fn validate(&self) -> Result<(), CameraError> {
        self.intrinsics.validate()?;
        if self.width == 0 || self.height == 0 {
            return Err(CameraError::NoPixels);
        }
        let rotation = &self.world_from_camera;
        let mut numbers = rotation.iter().chain(self.center_in_world.iter());
        if numbers.any(|x| !x.is_finite()) {
            return Err(CameraError::NotFinite);
        }
        let determinant = rotation.determinant();
        if determinant.abs() < RIGIDITY_TOLERANCE {
            return Err(CameraError::Singular { determinant });
        }
        if determinant < 0.0 {
            return Err(CameraError::Mirrored { determinant });
        }
        let deviation = (rotation.tr_mul(rotation) - Matrix3::identity()).amax();
        if deviation > RIGIDITY_TOLERANCE {
            return Err(CameraError::NotRigid { deviation });
        }
        Ok(())
    }

    /// The 4×4 camera-to-world matrix.
    pub fn matrix_world_from_camera(&self) -> Matrix4<f64> {
        let mut m = Matrix4::identity();
        m.fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&self.world_from_camera);
        m.fixed_view_mut::<3, 1>(0, 3)
            .copy_from(&self.center_in_world);
        m
    }

    /// World point → camera frame.
    #[inline]
    pub fn to_camera(&self, point_in_world: &Vector3<f64>) -> Vector3<f64> {
        self.world_from_camera
            .tr_mul(&(point_in_world - self.center_in_world))
    }

    /// World point → image. Points behind the camera project too; look at
    /// [`Projection::depth`].
    #[inline]
    pub fn project(&self, point_in_world: &Vector3<f64>) -> Projection {
        let p = self.to_camera(point_in_world);
        let z = if p.z.abs() < DEPTH_GUARD {
            p.z + if p.z < 0.0 { -DEPTH_GUARD } else { DEPTH_GUARD }
        } else {
            p.z
        };
        let calibrated = Vector2::new(p.x / z, p.y / z);
        Projection {
            pixel: self.intrinsics.decalibrate(&calibrated),
            calibrated,
            depth: p.z,
        }
    }

    /// Whether a world point lies in front of the camera and within the image.
    pub fn sees(&self, point_in_world: &Vector3<f64>) -> bool {
        let Projection { pixel, depth, .. } = self.project(point_in_world);
        let within = |x: f64, size: u32| (0.0..f64::from(size)).contains(&x);
        depth > 0.0 && within(pixel.x, self.width) && within(pixel.y, self.height)
    }

    /// The ray through a point given in image coordinates.
    pub fn ray_through(&self, point_in_image: &Vector2<f64>) -> Ray {
        let calibrated = self.intrinsics.calibrate(point_in_image);
        let direction = self.world_from_camera * Vector3::new(calibrated.x, calibrated.y, 1.0);
        Ray {
            origin: self.center_in_world,
            direction: direction.normalize(),
        }
    }

    /// Viewing direction (+Z of the camera) in the world.
    pub fn forward(&self) -> Vector3<f64> {
        self.world_from_camera.column(2).into_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_meet_halfway_between_their_nearest_points_in_front_of_both() {
        let ray = |origin: [f64; 3], direction: [f64; 3]| Ray {
            origin: origin.into(),
            direction: Vector3::from(direction).normalize(),
        };
        let one = ray([0.0; 3], [1.0, 0.0, 0.0]);
        let met = one
            .meeting(&ray([2.0, -1.0, 0.1], [0.0, 1.0, 0.0]))
            .unwrap();
        assert!((met - Vector3::new(2.0, 0.0, 0.05)).norm() < 1e-12);
        assert_eq!(one.meeting(&ray([-2.0, -1.0, 0.1], [0.0, 1.0, 0.0])), None);
        assert_eq!(one.meeting(&ray([2.0, 1.0, 0.1], [0.0, 1.0, 0.0])), None);
        assert_eq!(one.meeting(&ray([2.0, 1.0, 0.1], [1.0, 0.0, 0.0])), None);
    }

    #[test]
    fn rays_cross_the_ball_where_they_should() {
        let interval = |origin, direction| Ray { origin, direction }.interval_in_ball(1.0);
        let origin = Vector3::new(-3.0, 0.0, 0.0);
        assert_eq!(interval(origin, Vector3::x()), Some([2.0, 4.0]));
        assert_eq!(interval(origin, -Vector3::x()), None);
        assert_eq!(interval(origin, Vector3::y()), None);
        assert_eq!(interval(Vector3::zeros(), Vector3::y()), Some([0.0, 1.0]));
    }
}
