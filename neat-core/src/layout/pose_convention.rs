//! What the numbers of a pose mean: its direction, its camera axes, and the hand
//! of its world.
//!
//! Programs disagree on all three, and files seldom say. A layout's reader
//! believes what its format's documentation says; where a file breaks that, the
//! user says so by [`LoadOptions::pose_convention`](super::LoadOptions).

use nalgebra::{Matrix3, Matrix4, Vector3};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// What the 4×4 matrices that a layout's reader returns really are. The default
/// is what all readers promise: camera-to-world, OpenCV axes, a right-handed
/// world.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PoseConvention {
    /// Where the matrices lead.
    pub direction: PoseDirection,
    /// Which way the camera's axes point.
    pub axes: CameraAxes,
    /// Whether the world is left-handed. If so all its axes are turned round while it is
    /// worked on; results are in the frame of the files.
    pub mirrored_world: bool,
}

/// Where the rotation R and the translation t of a 4×4 matrix lead.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PoseDirection {
    /// Both from the camera to the world: t is the camera's centre.
    #[default]
    CameraToWorld,
    /// Both from the world to the camera, as "extrinsics" often do.
    WorldToCamera,
    /// R from the world to the camera, but t is the camera's centre.
    TransposedRotation,
    /// R from the camera to the world, but t from the world to the camera.
    WorldToCameraTranslation,
}

/// Where a text does not name a direction or camera axes.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum PoseConventionError {
    /// No direction has this name.
    #[error(
        "`{0}` is no direction of poses: choose camera-to-world, world-to-camera, \
         transposed-rotation or world-to-camera-translation"
    )]
    Direction(String),
    /// Not three words, or not one for each line through the camera.
    #[error(
        "`{0}` does not say where the camera's x, y and z axes point: join one of right and left, \
         one of down and up, and one of forward and back, such as right-down-forward (OpenCV) \
         or right-up-back (OpenGL)"
    )]
    Axes(String),
}

impl PoseDirection {
    /// Every direction.
    pub const ALL: [Self; 4] = [
        Self::CameraToWorld,
        Self::WorldToCamera,
        Self::TransposedRotation,
        Self::WorldToCameraTranslation,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::CameraToWorld => "camera-to-world",
            Self::WorldToCamera => "world-to-camera",
            Self::TransposedRotation => "transposed-rotation",
            Self::WorldToCameraTranslation => "world-to-camera-translation",
        }
    }
}

impl fmt::Display for PoseDirection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for PoseDirection {
    type Err = PoseConventionError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let mut all = Self::ALL.into_iter();
        all.find(|direction| direction.name() == text)
            .ok_or_else(|| PoseConventionError::Direction(text.into()))
    }
}

/// A way out of the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    Right,
    Left,
    Down,
    Up,
    Forward,
    Back,
}

impl Way {
    const ALL: [Self; 6] = [
        Self::Right,
        Self::Left,
        Self::Down,
        Self::Up,
        Self::Forward,
        Self::Back,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::Left => "left",
            Self::Down => "down",
            Self::Up => "up",
            Self::Forward => "forward",
            Self::Back => "back",
        }
    }

    /// The unit vector in OpenCV axes.
    fn in_opencv(self) -> Vector3<f64> {
        match self {
            Self::Right => Vector3::x(),
            Self::Left => -Vector3::x(),
            Self::Down => Vector3::y(),
            Self::Up => -Vector3::y(),
            Self::Forward => Vector3::z(),
            Self::Back => -Vector3::z(),
        }
    }

    /// The line that it and its opposite share.
    fn line(self) -> usize {
        self.in_opencv().iamax()
    }
}

/// Which way a camera's x, y and z axes point, seen by who looks through it.
///
/// As text the three ways are joined by hyphens: `right-down-forward` is OpenCV
/// and COLMAP, `right-up-back` OpenGL, Blender and nerfstudio,
/// `left-up-forward` PyTorch3D. Left-handed ones such as `right-up-forward`
/// (DirectX, Unity) are allowed too.
///
/// ```
/// use neat_core::layout::CameraAxes;
/// let axes: CameraAxes = "right-up-back".parse()?;
/// assert_eq!(axes, CameraAxes::OPENGL);
/// assert!("right-left-forward".parse::<CameraAxes>().is_err());
/// # Ok::<(), neat_core::layout::PoseConventionError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct CameraAxes([Way; 3]);

impl Default for CameraAxes {
    fn default() -> Self {
        Self::OPENCV
    }
}

impl CameraAxes {
    /// x right, y down, z forward.
    pub const OPENCV: Self = Self([Way::Right, Way::Down, Way::Forward]);
    /// x right, y up, z backward.
    pub const OPENGL: Self = Self([Way::Right, Way::Up, Way::Back]);

    /// All 48, right-handed and left-handed, always in the same order.
    pub fn all() -> impl Iterator<Item = Self> {
        let ways = || Way::ALL.into_iter();
        ways()
            .flat_map(move |x| ways().flat_map(move |y| ways().map(move |z| Self([x, y, z]))))
            .filter(Self::is_complete)
    }

    fn is_complete(&self) -> bool {
        let [x, y, z] = self.0.map(Way::line);
        x != y && y != z && x != z
    }

    /// Whether x × y = z, as in OpenCV and OpenGL.
    pub fn is_right_handed(&self) -> bool {
        self.opencv_from_camera().determinant() > 0.0
    }

    /// The matrix from coordinates along these axes to OpenCV's.
    pub fn opencv_from_camera(&self) -> Matrix3<f64> {
        Matrix3::from_columns(&self.0.map(Way::in_opencv))
    }
}

impl fmt::Display for CameraAxes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.map(Way::name).join("-"))
    }
}

impl FromStr for CameraAxes {
    type Err = PoseConventionError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let way = |word| Way::ALL.into_iter().find(|way| way.name() == word);
        let ways: Option<Vec<Way>> = text.split('-').map(way).collect();
        ways.and_then(|ways| Some(Self(ways.try_into().ok()?)))
            .filter(Self::is_complete)
            .ok_or_else(|| PoseConventionError::Axes(text.into()))
    }
}

impl TryFrom<String> for CameraAxes {
    type Error = PoseConventionError;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        text.parse()
    }
}

impl From<CameraAxes> for String {
    fn from(axes: CameraAxes) -> Self {
        axes.to_string()
    }
}

impl PoseConvention {
    /// The camera-to-world matrix in OpenCV axes of a pose in this convention. A
    /// matrix that has to be inverted and cannot be comes back as it is: the
    /// check of cameras says what is wrong with it.
    ///
    /// `file_axes` are those out of which a reader has turned the camera already: the direction
    /// is that of the matrix in the file, in whose world the result is.
    pub fn world_from_camera(&self, pose: &Matrix4<f64>, file_axes: &CameraAxes) -> Matrix4<f64> {
        let turn = |pose: &Matrix4<f64>, by: &Matrix3<f64>| {
            let mut pose = *pose;
            let rotation = pose.fixed_view::<3, 3>(0, 0) * by;
            pose.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation);
            pose
        };
        let opencv_from_file = file_axes.opencv_from_camera();
        let pose = &turn(pose, &opencv_from_file);
        let matrix = match self.direction {
            PoseDirection::CameraToWorld => *pose,
            PoseDirection::WorldToCamera => pose.try_inverse().unwrap_or(*pose),
            PoseDirection::TransposedRotation => {
                let mut matrix = *pose;
                let rotation = pose.fixed_view::<3, 3>(0, 0).transpose();
                matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation);
                matrix
            }
            PoseDirection::WorldToCameraTranslation => {
                // x_camera = Rᵀ x_world + t, so that the centre is −R t.
                let rotation = pose.fixed_view::<3, 3>(0, 0);
                let center = -(rotation * pose.fixed_view::<3, 1>(0, 3));
                let mut matrix = *pose;
                matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&center);
                matrix
            }
        };
        let opencv_from_camera = self.axes.opencv_from_camera() * opencv_from_file;
        let mut matrix = turn(&matrix, &opencv_from_camera.transpose());
        if self.mirrored_world {
            for row in 0..3 {
                for column in 0..4 {
                    matrix[(row, column)] *= -1.0;
                }
            }
        }
        matrix
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Rotation3, Translation3};
    use proptest::prelude::*;

    fn pose() -> Matrix4<f64> {
        let rotation = Rotation3::from_euler_angles(0.3, -0.8, 1.9);
        Translation3::new(1.0, -2.0, 3.0).to_homogeneous() * rotation.to_homogeneous()
    }

    #[test]
    fn nothing_said_changes_nothing() {
        let convention = PoseConvention::default();
        assert_eq!(
            convention.world_from_camera(&pose(), &CameraAxes::OPENCV),
            pose()
        );
    }

    #[test]
    fn every_direction_leads_back_to_camera_to_world() {
        let (right, inverse) = (pose(), pose().try_inverse().unwrap());
        let mixed = |rotation: &Matrix4<f64>, translation: &Matrix4<f64>| {
            let mut matrix = *rotation;
            matrix.set_column(3, &translation.column(3));
            matrix
        };
        let stored = [
            right,
            inverse,
            mixed(&inverse, &right),
            mixed(&right, &inverse),
        ];
        for (direction, stored) in PoseDirection::ALL.into_iter().zip(stored) {
            let convention = PoseConvention {
                direction,
                ..PoseConvention::default()
            };
            let repaired = convention.world_from_camera(&stored, &CameraAxes::OPENCV);
            assert!((repaired - right).amax() < 1e-12, "{direction}: {repaired}");
            assert_eq!(direction.to_string().parse(), Ok(direction));
        }
    }

    #[test]
    fn opengl_axes_turn_y_and_z() {
        let convention = PoseConvention {
            axes: CameraAxes::OPENGL,
            ..PoseConvention::default()
        };
        let repaired = convention.world_from_camera(&pose(), &CameraAxes::OPENCV);
        for (column, sign) in [(0, 1.0), (1, -1.0), (2, -1.0), (3, 1.0)] {
            assert_eq!(repaired.column(column), pose().column(column) * sign);
        }
    }

    #[test]
    fn a_point_ahead_stays_ahead_in_axes_that_are_turned_in_a_circle() {
        // x forward, y right, z down, as in aviation.
        let axes: CameraAxes = "forward-right-down".parse().unwrap();
        let convention = PoseConvention {
            axes,
            ..PoseConvention::default()
        };
        let ahead = pose() * nalgebra::Vector4::new(5.0, 0.0, 0.0, 1.0);
        let repaired = convention.world_from_camera(&pose(), &CameraAxes::OPENCV);
        let in_camera = repaired.try_inverse().unwrap() * ahead;
        assert!((in_camera.xyz() - Vector3::new(0.0, 0.0, 5.0)).amax() < 1e-12);
    }

    #[test]
    fn half_of_all_axes_are_right_handed_and_all_are_texts() {
        let all: Vec<_> = CameraAxes::all().collect();
        assert_eq!(all.len(), 48);
        assert_eq!(all.iter().filter(|axes| axes.is_right_handed()).count(), 24);
        for axes in all {
            assert_eq!(axes.to_string().parse(), Ok(axes));
            let json = serde_json::to_string(&axes).unwrap();
            assert_eq!(json, format!("\"{axes}\""));
            assert_eq!(serde_json::from_str::<CameraAxes>(&json).unwrap(), axes);
        }
    }

    #[test]
    fn a_direction_is_that_of_the_matrix_in_the_file() {
        let file_axes = CameraAxes::OPENGL;
        let turned_by_reader = |matrix: &Matrix4<f64>| {
            matrix * file_axes.opencv_from_camera().transpose().to_homogeneous()
        };
        let right = turned_by_reader(&pose());
        let inverse = turned_by_reader(&pose().try_inverse().unwrap());
        let as_it_says = PoseConvention::default();
        assert_eq!(as_it_says.world_from_camera(&right, &file_axes), right);
        let inverted = PoseConvention {
            direction: PoseDirection::WorldToCamera,
            ..as_it_says
        };
        let found = inverted.world_from_camera(&inverse, &file_axes);
        assert!((found - right).amax() < 1e-12);
        // What axes say comes after what the layout says.
        let other = PoseConvention {
            axes: CameraAxes::OPENGL,
            ..as_it_says
        };
        let found = other.world_from_camera(&right, &file_axes);
        assert_eq!(found, other.world_from_camera(&right, &CameraAxes::OPENCV));
    }

    #[test]
    fn a_left_handed_world_is_turned_into_a_rigid_pose() {
        let convention = PoseConvention {
            mirrored_world: true,
            ..PoseConvention::default()
        };
        let mirrored = convention.world_from_camera(&pose(), &CameraAxes::OPENCV);
        let rotation = mirrored.fixed_view::<3, 3>(0, 0).into_owned();
        assert!((rotation.determinant() + 1.0).abs() < 1e-12);
        assert_eq!(
            convention.world_from_camera(&mirrored, &CameraAxes::OPENCV),
            pose()
        );
    }

    proptest! {
        #[test]
        fn texts_and_matrices_of_any_kind_do_not_panic(
            text in "[a-z-]{0,24}", cells in prop::collection::vec(any::<f64>(), 16),
        ) {
            let _ = text.parse::<PoseDirection>();
            let axes = text.parse().unwrap_or(CameraAxes::OPENGL);
            for direction in PoseDirection::ALL {
                let convention = PoseConvention { direction, axes, mirrored_world: true };
                let _ = convention.world_from_camera(&Matrix4::from_row_slice(&cells), &CameraAxes::OPENCV);
            }
        }
    }
}
