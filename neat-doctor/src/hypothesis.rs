//! What the cameras may really be, where they are not what they were read as.

use crate::quaternion_order::QuaternionOrder;
use nalgebra::{Matrix3, Matrix4};
use neat_core::Camera;
use neat_core::layout::{CameraAxes, PoseConvention, PoseDirection};

/// A change of all cameras that makes them what they may really be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Hypothesis {
    /// Another convention of poses than the one they were read with.
    Convention {
        read_as: PoseConvention,
        is: PoseConvention,
        /// Those of the files, out of which they were turned before.
        file_axes: CameraAxes,
    },
    /// Quaternions whose numbers were read in another order.
    Quaternions(QuaternionOrder),
    /// The centres of the cameras were read as world-to-camera translations.
    CentersAsTranslations,
    /// Focal lengths times a factor.
    FocalScale(f64),
    /// Pixels are square: fx and fy are both what the one or the other is.
    SquarePixels { by_fx: bool },
    /// A lens of this [strength](crate::lens): it moves what images show, not the cameras.
    Lens(f64),
    /// All intrinsics times a factor: the images were scaled.
    IntrinsicsScale(f64),
    /// The images were stretched to another shape: intrinsics of x and y times a factor each.
    StretchedImages([f64; 2]),
    /// The principal point in the middle of the image.
    CenteredPrincipalPoint,
    /// The images were cut: so many pixels are missing at their left and at their upper side.
    CutImages([f64; 2]),
    /// The images were turned clockwise by so many quarters.
    TurnedImages(u32),
    /// fx and fy, cx and cy change places.
    SwappedIntrinsics,
    /// Poses in another order.
    Order(PoseOrder),
}

/// Which pose belongs to which image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PoseOrder {
    /// View i has the pose of view i + n; those beyond the last begin anew.
    Shifted(isize),
    /// The first view has the last pose.
    Reversed,
    /// The poses are in the order of the numbers in names, images were sorted as
    /// text: 1, 10, 11, 2.
    ByNumber,
    /// The other way round.
    ByText,
}

impl Hypothesis {
    /// The cameras if it holds.
    pub fn cameras(&self, cameras: &[Camera], names: &[&str]) -> Vec<Camera> {
        match self {
            Self::Convention {
                read_as,
                is,
                file_axes,
            } => with_each(cameras, |camera| {
                let stored = stored_pose(camera, read_as, file_axes);
                let pose = is.world_from_camera(&stored, file_axes);
                *camera =
                    Camera::from_matrices(camera.intrinsics, &pose, camera.width, camera.height);
            }),
            Self::Quaternions(order) => with_each(cameras, |camera| order.restore(camera)),
            Self::CentersAsTranslations => with_each(cameras, |camera| {
                let back = camera.world_from_camera.transpose();
                camera.center_in_world = -(back * camera.center_in_world);
            }),
            Self::Lens(_) => cameras.to_vec(),
            Self::FocalScale(scale) => with_each(cameras, |camera| {
                camera.intrinsics.fx *= scale;
                camera.intrinsics.fy *= scale;
                camera.intrinsics.skew *= scale;
            }),
            Self::SquarePixels { by_fx } => with_each(cameras, |camera| {
                let k = &mut camera.intrinsics;
                (k.fx, k.fy) = if *by_fx { (k.fx, k.fx) } else { (k.fy, k.fy) };
            }),
            Self::IntrinsicsScale(scale) => {
                Self::StretchedImages([*scale; 2]).cameras(cameras, names)
            }
            Self::StretchedImages([along_x, along_y]) => with_each(cameras, |camera| {
                let k = &mut camera.intrinsics;
                for value in [&mut k.fx, &mut k.cx, &mut k.skew] {
                    *value *= along_x;
                }
                for value in [&mut k.fy, &mut k.cy] {
                    *value *= along_y;
                }
            }),
            Self::CutImages([left, above]) => with_each(cameras, |camera| {
                camera.intrinsics.cx -= left;
                camera.intrinsics.cy -= above;
            }),
            Self::TurnedImages(quarters) => with_each(cameras, |camera| {
                turn_clockwise(camera, *quarters);
            }),
            Self::CenteredPrincipalPoint => with_each(cameras, |camera| {
                camera.intrinsics.cx = f64::from(camera.width) / 2.0;
                camera.intrinsics.cy = f64::from(camera.height) / 2.0;
            }),
            Self::SwappedIntrinsics => with_each(cameras, |camera| {
                let k = &mut camera.intrinsics;
                (k.fx, k.fy, k.cx, k.cy) = (k.fy, k.fx, k.cy, k.cx);
            }),
            Self::Order(order) => order
                .sources(names)
                .into_iter()
                .zip(cameras)
                .map(|(source, camera)| Camera {
                    world_from_camera: cameras[source].world_from_camera,
                    center_in_world: cameras[source].center_in_world,
                    ..*camera
                })
                .collect(),
        }
    }

    /// How unusual it is: of two that explain the same, the simpler one holds.
    pub fn complexity(&self) -> u32 {
        match self {
            Self::Convention { is: convention, .. } => {
                let axes = match convention.axes {
                    CameraAxes::OPENCV => 0,
                    CameraAxes::OPENGL => 1,
                    _ => 2,
                };
                let direction = match convention.direction {
                    PoseDirection::CameraToWorld => 0,
                    PoseDirection::WorldToCamera => 1,
                    _ => 2,
                };
                axes + direction + u32::from(convention.mirrored_world)
            }
            Self::Quaternions(_) | Self::CentersAsTranslations | Self::StretchedImages(_) => 2,
            _ => 1,
        }
    }
}

/// Makes the camera of an image that of the image turned clockwise by so many quarters, whose
/// width and height it already has.
fn turn_clockwise(camera: &mut Camera, quarters: u32) {
    let turned = [camera.width, camera.height].map(f64::from);
    let mut bottom = turned[usize::from(quarters.is_multiple_of(2))];
    for _ in 0..quarters {
        let k = &mut camera.intrinsics;
        // What was below is to the left now, what was to the left is above.
        (k.fx, k.fy, k.cx, k.cy, k.skew) = (k.fy, k.fx, bottom - k.cy, k.cx, 0.0);
        let r = camera.world_from_camera;
        let axes = [
            -r.column(1),
            r.column(0).into_owned(),
            r.column(2).into_owned(),
        ];
        camera.world_from_camera = Matrix3::from_columns(&axes);
        bottom = turned[0] + turned[1] - bottom;
    }
}

fn with_each(cameras: &[Camera], change: impl Fn(&mut Camera)) -> Vec<Camera> {
    let changed = |camera: &Camera| {
        let mut camera = *camera;
        change(&mut camera);
        camera
    };
    cameras.iter().map(changed).collect()
}

/// The matrix that `convention` makes the pose of `camera` of, in a file with these axes.
pub(crate) fn stored_pose(
    camera: &Camera,
    convention: &PoseConvention,
    file_axes: &CameraAxes,
) -> Matrix4<f64> {
    let mut pose = camera.matrix_world_from_camera();
    if convention.mirrored_world {
        let mirrored = -pose.fixed_view::<3, 4>(0, 0);
        pose.fixed_view_mut::<3, 4>(0, 0).copy_from(&mirrored);
    }
    let opencv_from_file = file_axes.opencv_from_camera();
    let turn = convention.axes.opencv_from_camera() * opencv_from_file;
    let rotation = pose.fixed_view::<3, 3>(0, 0) * turn;
    pose.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation);
    let stored = stored_in(&pose, convention.direction);
    stored * opencv_from_file.transpose().to_homogeneous()
}

/// The matrix of a camera-to-world pose, in a file whose matrices lead in this direction.
fn stored_in(pose: &Matrix4<f64>, direction: PoseDirection) -> Matrix4<f64> {
    if direction == PoseDirection::WorldToCameraTranslation {
        let translation =
            -(pose.fixed_view::<3, 3>(0, 0).transpose() * pose.fixed_view::<3, 1>(0, 3));
        let mut pose = *pose;
        pose.fixed_view_mut::<3, 1>(0, 3).copy_from(&translation);
        return pose;
    }
    // The other directions are their own inverses.
    let direction = PoseConvention {
        direction,
        ..PoseConvention::default()
    };
    direction.world_from_camera(pose, &CameraAxes::OPENCV)
}

/// All conventions but `read_as`, with the hand of the world that makes rigid
/// poses of what is stored.
pub(crate) fn conventions(camera: &Camera, read_as: PoseConvention) -> Vec<PoseConvention> {
    // Axes of files are right-handed: they do not matter here.
    let stored = stored_pose(camera, &read_as, &CameraAxes::OPENCV);
    let right_handed = stored.fixed_view::<3, 3>(0, 0).determinant() > 0.0;
    let mut conventions = Vec::new();
    for direction in PoseDirection::ALL {
        for axes in CameraAxes::all() {
            let convention = PoseConvention {
                direction,
                axes,
                mirrored_world: axes.is_right_handed() != right_handed,
            };
            if convention != read_as {
                conventions.push(convention);
            }
        }
    }
    conventions
}

/// Hypotheses about intrinsics that do not suit the size of their images.
pub(crate) fn of_intrinsics(cameras: &[Camera]) -> Vec<Hypothesis> {
    let camera = &cameras[0];
    let k = &camera.intrinsics;
    let scale_x = f64::from(camera.width) / (2.0 * k.cx);
    let scale_y = f64::from(camera.height) / (2.0 * k.cy);
    let mut hypotheses = Vec::new();
    if (k.fx / k.fy - 1.0).abs() > 0.02 {
        hypotheses.extend([true, false].map(|by_fx| Hypothesis::SquarePixels { by_fx }));
    }
    if (k.fx / k.fy - 1.0).abs() > 0.02 || (k.cx - k.cy).abs() > 0.02 * k.fx {
        hypotheses.push(Hypothesis::SwappedIntrinsics);
    }
    let off = |scale: f64| (scale - 1.0).abs() > 0.1;
    if off(scale_x) || off(scale_y) {
        hypotheses.push(Hypothesis::CenteredPrincipalPoint);
        hypotheses.extend(cuts(camera));
        if scale_x > 0.0 && scale_y > 0.0 {
            hypotheses.push(Hypothesis::StretchedImages([scale_x, scale_y]));
        }
        if scale_x > 0.0 && (scale_x / scale_y - 1.0).abs() < 0.15 {
            // Images are scaled by simple factors, principal points are not
            // quite in the middle.
            let scale = 0.5 * (scale_x + scale_y);
            let simple = [
                0.125,
                0.25,
                1.0 / 3.0,
                0.5,
                2.0 / 3.0,
                0.75,
                1.5,
                2.0,
                3.0,
                4.0,
                8.0,
            ];
            let near = simple
                .into_iter()
                .find(|simple| (scale / simple - 1.0).abs() < 0.08);
            let rounded = (near.unwrap_or(scale) * 1e4).round() / 1e4;
            hypotheses.push(Hypothesis::IntrinsicsScale(rounded));
        }
    }
    hypotheses
}

/// Cuts that leave an image of the size it has, of one whose principal point was its middle:
/// on one side, on the other, or as much on both.
fn cuts(camera: &Camera) -> Vec<Hypothesis> {
    let k = &camera.intrinsics;
    let missing = [
        2.0 * k.cx - f64::from(camera.width),
        2.0 * k.cy - f64::from(camera.height),
    ];
    let shares = || [0.0, 0.5, 1.0].into_iter();
    let cuts = shares().flat_map(|x| shares().map(move |y| [x, y]));
    cuts.filter(|cut| *cut != [0.0; 2])
        .map(|[x, y]| Hypothesis::CutImages([x * missing[0], y * missing[1]]))
        .collect()
}

impl PoseOrder {
    /// Orders that happen, for scenes of these views.
    pub fn all(names: &[&str]) -> Vec<Self> {
        let mut orders = vec![Self::Reversed];
        // Small ones first: of two that explain the same, as on a turntable, they are meant.
        let half = names.len() as isize / 2;
        orders.extend((1..=half).flat_map(|by| [Self::Shifted(by), Self::Shifted(-by)]));
        if by_number(names).iter().enumerate().any(|(i, &j)| i != j) {
            orders.extend([Self::ByNumber, Self::ByText]);
        }
        orders
    }

    /// For each view the index of the view whose pose it gets.
    pub fn sources(self, names: &[&str]) -> Vec<usize> {
        let count = names.len();
        match self {
            Self::Shifted(by) => (0..count as isize)
                .map(|i| (i + by).rem_euclid(count as isize) as usize)
                .collect(),
            Self::Reversed => (0..count).rev().collect(),
            Self::ByText => by_number(names),
            Self::ByNumber => {
                let mut sources = vec![0; count];
                for (rank, view) in by_number(names).into_iter().enumerate() {
                    sources[view] = rank;
                }
                sources
            }
        }
    }
}

/// The views in the order of the numbers in their names.
fn by_number(names: &[&str]) -> Vec<usize> {
    let mut views: Vec<usize> = (0..names.len()).collect();
    views.sort_by_cached_key(|&view| number_key(names[view]));
    views
}

/// A name cut into texts and numbers, as people sort them.
fn number_key(name: &str) -> Vec<(String, u128)> {
    let mut key = Vec::new();
    let mut rest = name;
    while !rest.is_empty() {
        let digits = rest
            .find(|c: char| c.is_ascii_digit())
            .unwrap_or(rest.len());
        let (text, after) = rest.split_at(digits);
        let end = after
            .find(|c: char| !c.is_ascii_digit())
            .unwrap_or(after.len());
        let (number, after) = after.split_at(end);
        // Numbers beyond 38 digits are equal: names are no place for them.
        key.push((text.to_owned(), number.parse().unwrap_or(u128::MAX)));
        rest = after;
    }
    key
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stored_pose_is_what_the_convention_was_applied_to() {
        let rotation = nalgebra::Rotation3::from_euler_angles(0.4, -1.2, 2.0);
        let mut pose = rotation.to_homogeneous();
        pose[(0, 3)] = 2.0;
        pose[(2, 3)] = -1.0;
        let intrinsics = neat_core::Intrinsics {
            fx: 1.0,
            fy: 1.0,
            cx: 0.0,
            cy: 0.0,
            skew: 0.0,
        };
        let camera = Camera::from_matrices(intrinsics, &pose, 4, 3);
        for read_as in conventions(&camera, PoseConvention::default()) {
            for file_axes in [CameraAxes::OPENCV, CameraAxes::OPENGL] {
                let stored = stored_pose(&camera, &read_as, &file_axes);
                let again = read_as.world_from_camera(&stored, &file_axes);
                assert!((again - pose).amax() < 1e-12, "{read_as:?}");
            }
            assert_eq!(conventions(&camera, read_as).len(), 191);
        }
    }

    #[test]
    fn names_sorted_as_text_get_the_poses_of_their_numbers() {
        let names = ["im1", "im10", "im11", "im2"];
        assert_eq!(by_number(&names), [0, 3, 1, 2]);
        // Poses in the order 1, 2, 10, 11; image im10 needs the third.
        assert_eq!(PoseOrder::ByNumber.sources(&names), [0, 2, 3, 1]);
        assert_eq!(PoseOrder::ByText.sources(&names), [0, 3, 1, 2]);
        assert_eq!(PoseOrder::Shifted(-1).sources(&names), [3, 0, 1, 2]);
        assert!(!PoseOrder::all(&["a1", "a2"]).contains(&PoseOrder::ByNumber));
    }
}
