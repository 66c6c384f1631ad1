//! The table of right scenes.

use super::Right;
use crate::corruption::textured::{bricks, repeated_twelve_times, veins};
use image::{Rgb, RgbImage, imageops};
use nalgebra::{Matrix4, Rotation3, Vector3};
use neat_core::Camera;
use neat_core::synthetic::{Solid, SyntheticScene};

pub fn all() -> Vec<Right> {
    let tables = [
        solids(),
        captures(),
        lenses(),
        frames(),
        images(),
        textures(),
    ];
    tables.into_iter().flatten().collect()
}

/// Small, so that all of them take little time.
fn scene(solid: Solid, views: usize) -> SyntheticScene {
    SyntheticScene {
        solid,
        views,
        image_size: 320,
        ..SyntheticScene::default()
    }
}

fn plain(name: &'static str) -> Right {
    Right::new(name, scene(Solid::StairPrism, 24))
}

fn solids() -> Vec<Right> {
    let of = |name, solid| Right::new(name, scene(solid, 24));
    vec![
        of("a box", Solid::Box),
        of("an L", Solid::LPrism),
        of("stairs", Solid::StairPrism),
        of(
            "a hexagonal prism, which looks alike from six sides",
            Solid::HexagonalPrism,
        ),
        of("a T", Solid::TPrism),
        of("a U, which hides itself", Solid::UPrism),
        of("a wedge", Solid::Wedge),
        of("a truncated pyramid", Solid::TruncatedPyramid),
        of("a house", Solid::GableHouse),
        of("a cylinder", Solid::Cylinder),
        of("a truncated cone", Solid::TruncatedCone),
        of("a shaft with a flat", Solid::DShaft),
        of("a vault", Solid::Arch),
        of("a link with round ends", Solid::Link),
        of("a plate with holes", Solid::DrilledPlate),
        // Hardly a corner of these is one.
        Right::new("a shaft from many sides", scene(Solid::DShaft, 60)),
        Right::new("a link from many sides", scene(Solid::Link, 60)),
    ]
}

fn captures() -> Vec<Right> {
    let of = |name, views| Right::new(name, scene(Solid::UPrism, views));
    vec![
        of("three views", 3).shows_little(),
        of("four views", 4).shows_little(),
        of("six views", 6),
        of("twelve views", 12),
        of("200 views", 200),
        of("one side only", 60).camera(|_, camera| {
            (camera.center_in_world.y > 0.3 * camera.center_in_world.norm()).then_some(camera)
        }),
        of("from above only", 60).camera(|_, camera| {
            (camera.center_in_world.z > 0.6 * camera.center_in_world.norm()).then_some(camera)
        }),
        of("two sides that share little", 80).camera(|_, camera| {
            let sideways = camera.center_in_world.x / camera.center_in_world.norm();
            (sideways.abs() > 0.6).then_some(camera)
        }),
        of("once around on a turntable", 24).camera(|index, camera| {
            let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), 0.2618 * index as f64);
            Some(placed(camera, turn * Vector3::new(1.8, 0.0, 1.0)))
        }),
        of("a short film", 30).camera(|index, camera| {
            let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), 0.03 * index as f64);
            Some(placed(camera, turn * Vector3::new(1.8, 0.0, 1.0)))
        }),
        of("near and far views in turns", 24).camera(|index, camera| {
            let center = camera.center_in_world * [1.0, 1.8][index % 2];
            Some(placed(camera, center))
        }),
        of("rolled cameras", 24).camera(|index, mut camera| {
            let roll = Rotation3::from_axis_angle(&Vector3::z_axis(), 2.4 * index as f64);
            camera.world_from_camera *= roll.matrix();
            Some(camera)
        }),
    ]
}

fn lenses() -> Vec<Right> {
    let oblong = |name, width, height| {
        let scene = SyntheticScene {
            image_size: width,
            image_height: Some(height),
            camera_distance: 2.6,
            ..scene(Solid::StairPrism, 24)
        };
        Right::new(name, scene)
    };
    vec![
        plain("a wide lens, 105°").camera(|_, camera| {
            let center = 0.55 * camera.center_in_world;
            Some(placed(zoomed(camera, 0.35), center))
        }),
        plain("a lens of 80°").camera(|_, camera| {
            let center = 0.65 * camera.center_in_world;
            Some(placed(zoomed(camera, 0.54), center))
        }),
        plain("a long lens, 8°").camera(|_, camera| {
            let center = 6.5 * camera.center_in_world;
            Some(placed(zoomed(camera, 6.5), center))
        }),
        plain("a lens that zooms").camera(|index, camera| {
            let factor = 1.0 - 0.015 * index as f64;
            Some(zoomed(camera, factor))
        }),
        oblong("broad images", 400, 270),
        oblong("tall images", 270, 400),
        plain("pixels that are not square, told").camera(|_, mut camera| {
            camera.intrinsics.fy *= 0.7;
            Some(camera)
        }),
        plain("cut images, told").camera(|_, mut camera| {
            camera.intrinsics.cx -= 40.0;
            camera.width -= 60;
            Some(camera)
        }),
        plain("a principal point off the middle").camera(|_, mut camera| {
            camera.intrinsics.cx += 35.0;
            camera.intrinsics.cy -= 25.0;
            Some(camera)
        }),
        plain("images of two sizes").camera(|index, camera| {
            let factor = [1.0, 0.5][index % 2];
            Some(resized(camera, factor))
        }),
        plain("images of 128 pixels").camera(|_, camera| Some(resized(camera, 0.4))),
        plain("images of 64 pixels").camera(|_, camera| Some(resized(camera, 0.2))),
    ]
}

fn frames() -> Vec<Right> {
    vec![
        plain("units of 1e-4").draft(|draft| draft.each_pose(|pose| scaled(pose, 1e-4))),
        plain("units of 1e5").draft(|draft| draft.each_pose(|pose| scaled(pose, 1e5))),
        plain("a turned world").draft(|draft| {
            let turn = Rotation3::from_euler_angles(0.7, -1.1, 2.0).to_homogeneous();
            draft.each_pose(|pose| turn * pose);
        }),
        plain("a frame of a survey, far from its origin").draft(|draft| {
            draft.each_pose(|pose| moved(pose, Vector3::new(352_816.0, 5_812_345.0, 34.0)));
        }),
        plain("the origin in the first camera").draft(|draft| {
            let first = draft.views[0].pose.try_inverse().unwrap();
            // Not quite: a camera at the origin would be refused.
            let off = moved(&Matrix4::identity(), Vector3::new(0.01, 0.0, 0.0));
            draft.each_pose(|pose| off * first * pose);
        }),
        plain("views in random order with their poses").draft(|draft| {
            let count = draft.views.len();
            for (index, view) in draft.views.iter_mut().enumerate() {
                view.name = format!("{:02}", (7 * index + 3) % count);
            }
            draft.views.sort_by(|a, b| a.name.cmp(&b.name));
        }),
        plain("poses with three digits").draft(|draft| {
            draft.each_pose(|pose| pose.map(|value| (value * 2000.0).round() / 2000.0));
        }),
    ]
}

fn images() -> Vec<Right> {
    vec![
        plain("noise").image(|index, mut image| {
            noisy(&mut image, index, 4.0);
            image
        }),
        plain("much noise")
            .image(|index, mut image| {
                noisy(&mut image, index, 12.0);
                image
            })
            .shows_little(),
        plain("changing exposure").image(|index, image| {
            let gain = 0.6 + 0.05 * (index % 9) as f64;
            graded(&image, |value| gain * value)
        }),
        plain("faint contrast").image(|_, image| graded(&image, |value| 90.0 + 0.25 * value)),
        plain("before white")
            .image(|_, image| graded(&image, |v| if v == 0.0 { 255.0 } else { v })),
        plain("before grey").image(|_, image| graded(&image, |v| if v == 0.0 { 118.0 } else { v })),
        plain("negatives").image(|_, image| graded(&image, |value| 255.0 - value)),
        plain("shades of grey")
            .image(|_, image| image::DynamicImage::from(imageops::grayscale(&image)).into_rgb8()),
        plain("soft images").image(|_, image| imageops::fast_blur(&image, 1.5)),
        plain("dark corners").image(|_, image| {
            let (width, height) = image.dimensions();
            let mut image = image;
            for (x, y, pixel) in image.enumerate_pixels_mut() {
                let share = |at: u32, of: u32| f64::from(at) / f64::from(of) - 0.5;
                let off = share(x, width).hypot(share(y, height));
                pixel.0 = pixel
                    .0
                    .map(|value| (f64::from(value) * (1.0 - 0.8 * off)) as u8);
            }
            image
        }),
    ]
}

fn textures() -> Vec<Right> {
    let of = |name, solid, views| Right::new(name, scene(solid, views)).texture(veins);
    let wall = |name, solid, views| Right::new(name, scene(solid, views)).texture(bricks);
    vec![
        of("texture, a box", Solid::Box, 30),
        of("texture, a U", Solid::UPrism, 30),
        of("texture, three views", Solid::Box, 3)
            .camera(beside)
            .shows_little(),
        of("texture, four views", Solid::Box, 4).camera(beside),
        of("texture, six views", Solid::Box, 6).camera(beside),
        of("texture, one side", Solid::LPrism, 14).camera(beside),
        of("texture, a wide lens", Solid::Box, 14).camera(|index, camera| {
            let camera = beside(index, camera)?;
            let center = 0.6 * camera.center_in_world;
            Some(placed(zoomed(camera, 0.4), center))
        }),
        of("texture, a long lens", Solid::Box, 14).camera(|index, camera| {
            let camera = beside(index, camera)?;
            let center = 6.5 * camera.center_in_world;
            Some(placed(zoomed(camera, 6.5), center))
        }),
        of("texture, units of 1e5", Solid::Box, 14)
            .camera(beside)
            .draft(|draft| draft.each_pose(|pose| scaled(pose, 1e5))),
        of("texture, changing exposure", Solid::Box, 14)
            .camera(beside)
            .image(|index, image| {
                let gain = 0.6 + 0.05 * (index % 9) as f64;
                graded(&image, |value| gain * value)
            }),
        of("texture, noise", Solid::Box, 14)
            .camera(beside)
            .image(|index, mut image| {
                noisy(&mut image, index, 8.0);
                image
            }),
        Right::new(
            "the same pattern twelve times around",
            scene(Solid::HexagonalPrism, 20),
        )
        .texture(repeated_twelve_times)
        // 40° apart, which look as 10° do.
        .camera(|index, camera| {
            let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), 0.6981 * index as f64);
            Some(placed(camera, turn * Vector3::new(1.7, 0.0, 0.2)))
        }),
        wall("bricks, all around", Solid::Box, 30).shows_little(),
        wall("bricks, one side", Solid::Box, 14).camera(beside),
        wall("bricks, stairs", Solid::StairPrism, 30).shows_little(),
    ]
}

/// The views of a walk by, 6° from each other.
#[expect(clippy::unnecessary_wraps, reason = "one of the changes of a camera")]
fn beside(index: usize, camera: Camera) -> Option<Camera> {
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), 0.105 * index as f64);
    let height = 0.9 + 0.1 * (index % 3) as f64;
    Some(placed(camera, turn * Vector3::new(1.8, 0.2, height)))
}

/// The camera elsewhere, looking at the origin.
fn placed(camera: Camera, center: Vector3<f64>) -> Camera {
    let forward = -center.normalize();
    let up = if forward.z.abs() < 0.99 {
        Vector3::z()
    } else {
        Vector3::y()
    };
    let right = forward.cross(&up).normalize();
    let axes = [right, forward.cross(&right), forward];
    Camera {
        world_from_camera: nalgebra::Matrix3::from_columns(&axes),
        center_in_world: center,
        ..camera
    }
}

fn zoomed(mut camera: Camera, factor: f64) -> Camera {
    camera.intrinsics = camera.intrinsics.with_focal_factor(factor);
    camera
}

fn resized(mut camera: Camera, factor: f64) -> Camera {
    let k = &mut camera.intrinsics;
    for value in [&mut k.fx, &mut k.fy, &mut k.cx, &mut k.cy] {
        *value *= factor;
    }
    let scaled = |pixels: u32| (f64::from(pixels) * factor) as u32;
    (camera.width, camera.height) = (scaled(camera.width), scaled(camera.height));
    camera
}

fn scaled(pose: &Matrix4<f64>, factor: f64) -> Matrix4<f64> {
    let mut pose = *pose;
    pose.fixed_view_mut::<3, 1>(0, 3).scale_mut(factor);
    pose
}

fn moved(pose: &Matrix4<f64>, by: Vector3<f64>) -> Matrix4<f64> {
    pose.append_translation(&by)
}

fn graded(image: &RgbImage, grade: impl Fn(f64) -> f64) -> RgbImage {
    let mut image = image.clone();
    for Rgb(colors) in image.pixels_mut() {
        *colors = colors.map(|value| grade(f64::from(value)) as u8);
    }
    image
}

/// Adds noise of about this many levels, the same each time.
fn noisy(image: &mut RgbImage, view: usize, levels: f64) {
    let mut state = view as u64 + 1;
    let mut uniform = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / f64::from(1 << 24) - 0.5
    };
    for Rgb(colors) in image.pixels_mut() {
        // Three uniform numbers are nearly normal; their deviation is a half.
        let by = 2.0 * levels * (uniform() + uniform() + uniform());
        *colors = colors.map(|value| (f64::from(value) + by) as u8);
    }
}
