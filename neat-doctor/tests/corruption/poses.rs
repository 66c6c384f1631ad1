//! Poses and intrinsics that do not belong to the images.

use super::draft::Draft;
use super::{Corruption, Needs};
use nalgebra::{Matrix3, Matrix4, Quaternion, Rotation3, UnitQuaternion, Vector3, Vector4};
use neat_core::SphereChoice;
use neat_core::layout::CameraAxes;
use neat_doctor::Cause;

pub fn table() -> Vec<Corruption> {
    let tables = [
        conventions(),
        single_poses(),
        intrinsics(),
        order(),
        spheres(),
    ];
    tables.into_iter().flatten().collect()
}

fn conventions() -> Vec<Corruption> {
    let problem = Corruption::problem;
    vec![
        problem("inverted poses", Cause::InvertedPoses, |draft| {
            draft.each_pose(|pose| pose.try_inverse().unwrap());
        })
        .repaired_by("--poses world-to-camera"),
        problem("OpenGL axes read as OpenCV", Cause::CameraAxes, |draft| {
            draft.each_pose(|pose| in_axes(pose, "right-up-back"));
        })
        .repaired_by("--camera-axes right-up-back"),
        problem("camera axes y and z swapped", Cause::CameraAxes, |draft| {
            draft.each_pose(|pose| in_axes(pose, "right-forward-up"));
        })
        .repaired_by("--camera-axes right-forward-up"),
        problem(
            "rotations transposed, centres right",
            Cause::TransposedRotations,
            |draft| {
                draft.each_pose(|pose| with_rotation(pose, rotation(pose).transpose()));
            },
        )
        .repaired_by("--poses transposed-rotation"),
        problem(
            "world-to-camera translations, rotations right",
            Cause::TransposedRotations,
            |draft| {
                draft.each_pose(|pose| {
                    let translation = -(rotation(pose).transpose() * center(pose));
                    with_center(pose, translation)
                });
            },
        )
        .repaired_by("--poses world-to-camera-translation"),
        problem(
            "centres where world-to-camera translations are read",
            Cause::TransposedRotations,
            |draft| draft.each_pose(|pose| with_center(pose, -(rotation(pose) * center(pose)))),
        ),
        problem("mirrored world", Cause::MirroredPoses, |draft| {
            let mirror = Matrix4::from_diagonal(&Vector4::new(1.0, 1.0, -1.0, 1.0));
            draft.each_pose(|pose| mirror * pose);
        })
        .repaired_by("--mirrored-world"),
        problem(
            "quaternions w x y z read as x y z w",
            Cause::QuaternionOrder,
            |draft| {
                draft.each_pose(|pose| requaternioned(pose, |[w, x, y, z]| [z, w, x, y]));
            },
        ),
        problem(
            "quaternions x y z w read as w x y z",
            Cause::QuaternionOrder,
            |draft| {
                draft.each_pose(|pose| requaternioned(pose, |[w, x, y, z]| [x, y, z, w]));
            },
        ),
        problem(
            "COLMAP's quaternions read as x y z w",
            Cause::QuaternionOrder,
            |draft| {
                draft.each_pose(|pose| {
                    let stored = pose.try_inverse().unwrap();
                    let misread = requaternioned(&stored, |[w, x, y, z]| [z, w, x, y]);
                    misread.try_inverse().unwrap()
                });
            },
        ),
    ]
}

fn single_poses() -> Vec<Corruption> {
    let problem = Corruption::problem;
    vec![
        problem("one bad pose", Cause::BadPose, |draft| {
            draft.one().pose *= Rotation3::from_euler_angles(0.1, -0.2, 0.15).to_homogeneous();
        }),
        problem("one pose left at the identity", Cause::BadPose, |draft| {
            draft.one().pose = Matrix4::identity();
        }),
        problem("NaN in a pose", Cause::NotFinite, |draft| {
            draft.one().pose[(1, 2)] = f64::NAN;
        }),
        problem("a pose of zeros", Cause::NotRigid, |draft| {
            draft.one().pose.fill(0.0);
        }),
        problem("rotations with a scale", Cause::NotRigid, |draft| {
            draft.each_pose(|pose| with_rotation(pose, rotation(pose) * 0.4));
        }),
        problem(
            "rotations alone, all centres at the origin",
            Cause::Other,
            |draft| {
                draft.each_pose(|pose| with_center(pose, Vector3::zeros()));
            },
        ),
        Corruption::told(
            "half of the centres in another unit",
            Cause::PosesDisagree,
            |draft| {
                let half = draft.views.len() / 2;
                for view in &mut draft.views[half..] {
                    view.pose = with_center(&view.pose, 0.01 * center(&view.pose));
                }
            },
        ),
        problem("all poses off by some 3°", Cause::PosesDisagree, |draft| {
            for (index, view) in draft.views.iter_mut().enumerate() {
                let angle = 0.05 * Vector3::from([1.0, 2.0, 3.0].map(|k| (k * index as f64).sin()));
                view.pose *= Rotation3::new(angle).to_homogeneous();
            }
        }),
    ]
}

fn intrinsics() -> Vec<Corruption> {
    let problem = Corruption::problem;
    vec![
        problem("focal length × 1.3", Cause::FocalLength, |draft| {
            scale_focal(draft, 1.3)
        }),
        problem("focal length × 0.5", Cause::FocalLength, |draft| {
            scale_focal(draft, 0.5)
        }),
        problem(
            "focal lengths in millimetres",
            Cause::FocalLength,
            |draft| {
                let sensor_width = 36.0;
                let per_pixel = sensor_width / draft.views[0].size()[0];
                scale_focal(draft, per_pixel);
            },
        ),
        problem("one camera's focal length", Cause::FocalLength, |draft| {
            let view = draft.one();
            view.k[(0, 0)] *= 1.4;
            view.k[(1, 1)] *= 1.4;
        }),
        problem(
            "pixels taken for square that are not",
            Cause::PixelAspect,
            |draft| {
                for view in &mut draft.views {
                    view.k[(1, 1)] *= 1.25;
                }
            },
        ),
        problem(
            "x and y of the intrinsics exchanged",
            Cause::SwappedIntrinsics,
            |draft| {
                for view in &mut draft.views {
                    let k = &mut view.k;
                    (k[(0, 2)], k[(1, 2)]) = (k[(1, 2)], k[(0, 2)]);
                    (k[(0, 0)], k[(1, 1)]) = (k[(1, 1)], k[(0, 0)]);
                }
            },
        )
        .needs(Needs::Oblong),
        problem(
            "principal point at the corner",
            Cause::PrincipalPoint,
            |draft| {
                for view in &mut draft.views {
                    (view.k[(0, 2)], view.k[(1, 2)]) = (0.0, 0.0);
                }
            },
        ),
    ]
}

fn order() -> Vec<Corruption> {
    let order = |name, spoil| Corruption::problem(name, Cause::ImageOrder, spoil);
    vec![
        order("images in random order", |draft| {
            draft.reorder(&shuffled(draft.views.len()))
        }),
        order("poses shifted by one", |draft| {
            let count = draft.views.len();
            draft.reorder(&Vec::from_iter((0..count).map(|view| (view + 1) % count)));
        }),
        order("poses reversed", |draft| {
            draft.reorder(&Vec::from_iter((0..draft.views.len()).rev()));
        }),
        order("images sorted as text, poses by number", |draft| {
            for (index, view) in draft.views.iter_mut().enumerate() {
                view.name = format!("photo{}", index + 1);
            }
        })
        .needs(Needs::TenViews),
        order("half of the images renamed", |draft| {
            // Capitals are sorted before small letters.
            let half = draft.views.len() / 2;
            for view in &mut draft.views[half..] {
                view.name = format!("IMG_{}", view.name);
            }
            for view in &mut draft.views[..half] {
                view.name = format!("img_{}", view.name);
            }
        }),
        order(
            "images of two cameras in turns, poses one after the other",
            |draft| {
                for (index, view) in draft.views.iter_mut().enumerate() {
                    view.name = format!("{}_{}", ["left", "right"][index % 2], view.name);
                }
            },
        ),
        order("blocks of images exchanged", |draft| {
            let count = draft.views.len();
            let quarter = |k: usize| k * count / 4..(k + 1) * count / 4;
            draft.reorder(&Vec::from_iter([1, 3, 0, 2].into_iter().flat_map(quarter)));
        }),
        order("two images exchanged", |draft| {
            let count = draft.views.len();
            let mut order: Vec<usize> = (0..count).collect();
            order.swap(count / 4, count / 2);
            draft.reorder(&order);
        }),
        order("poses of another scene", |draft| {
            let (_, cameras) = draft.other_scene(draft.views.len());
            for (view, camera) in draft.views.iter_mut().zip(cameras) {
                view.pose = camera.matrix_world_from_camera();
            }
            // Photographed in an order of its own.
            draft.reorder(&shuffled(draft.views.len()));
        }),
    ]
}

fn spheres() -> Vec<Corruption> {
    let sphere = |name, spoil| Corruption::problem(name, Cause::Other, spoil);
    vec![
        sphere("scene sphere in millimetres, poses in metres", |draft| {
            let (_, distance) = place(draft);
            let center = Vector3::repeat(1000.0 * distance);
            draft.load.sphere = SphereChoice::Given {
                center,
                radius: distance,
            };
        }),
        sphere("scene sphere without room for an edge", |draft| {
            let (center, distance) = place(draft);
            let radius = 1e-4 * distance;
            draft.load.sphere = SphereChoice::Given { center, radius };
        }),
    ]
}

/// A point before the first camera and how far away it is.
fn place(draft: &Draft) -> (Vector3<f64>, f64) {
    let centers = draft.views.iter().map(|view| center(&view.pose));
    let middle = centers.clone().sum::<Vector3<f64>>() / draft.views.len() as f64;
    let extent = centers
        .map(|center| (center - middle).norm())
        .fold(0.0, f64::max);
    let first = &draft.views[0].pose;
    (
        center(first) + rotation(first) * Vector3::z() * extent,
        extent,
    )
}

fn in_axes(pose: &Matrix4<f64>, axes: &str) -> Matrix4<f64> {
    let axes: CameraAxes = axes.parse().unwrap();
    pose * axes.opencv_from_camera().to_homogeneous()
}

fn rotation(pose: &Matrix4<f64>) -> Matrix3<f64> {
    pose.fixed_view::<3, 3>(0, 0).into_owned()
}

fn center(pose: &Matrix4<f64>) -> Vector3<f64> {
    pose.fixed_view::<3, 1>(0, 3).into_owned()
}

fn with_rotation(pose: &Matrix4<f64>, rotation: Matrix3<f64>) -> Matrix4<f64> {
    let mut pose = *pose;
    pose.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation);
    pose
}

fn with_center(pose: &Matrix4<f64>, center: Vector3<f64>) -> Matrix4<f64> {
    let mut pose = *pose;
    pose.fixed_view_mut::<3, 1>(0, 3).copy_from(&center);
    pose
}

/// The pose whose quaternion has the four numbers w, x, y, z changed as given.
fn requaternioned(pose: &Matrix4<f64>, misread: fn([f64; 4]) -> [f64; 4]) -> Matrix4<f64> {
    let q = UnitQuaternion::from_matrix(&rotation(pose));
    let [w, x, y, z] = misread([q.w, q.i, q.j, q.k]);
    let q = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
    with_rotation(pose, q.to_rotation_matrix().into_inner())
}

fn scale_focal(draft: &mut Draft, factor: f64) {
    for view in &mut draft.views {
        view.k[(0, 0)] *= factor;
        view.k[(1, 1)] *= factor;
    }
}

/// A fixed permutation that is no shift: views trade places at random.
fn shuffled(count: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    let mut state = 12345u64;
    for i in (1..count).rev() {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        order.swap(i, (state >> 33) as usize % (i + 1));
    }
    order
}
