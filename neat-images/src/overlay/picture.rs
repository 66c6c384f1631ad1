//! The wireframe alone, on white, from a viewpoint that shows its shape.

use super::line_drawing::{Pen, draw_disc, draw_segment};
use super::{segments_of, thinness, visible_part};
use image::{Rgb, RgbImage};
use nalgebra::{Matrix3, Vector2, Vector3};
use neat_core::{Camera, Intrinsics, Scene, Wireframe3d, extent_of_most};

/// Width and height of the picture.
const SIZE: u32 = 1200;
/// The camera stands so many radii of the object away: near enough for a little
/// perspective.
const DISTANCE: f64 = 4.0;
/// The object, but for strays, fills so much of the picture's longer side.
const FILLED: f64 = 0.88;
const NEAR: Pen = Pen {
    color: [18.0, 44.0, 92.0],
    radius: 2.5,
};
const FAR: Pen = Pen {
    color: [172.0, 188.0, 212.0],
    radius: 1.5,
};
const JUNCTION: Pen = Pen {
    color: [224.0, 72.0, 32.0],
    radius: 6.0,
};

/// Draws the wireframe, and curves by points along each; far lines are paler than near ones. Without junctions
/// the picture is white.
///
/// The viewing direction is that of the scene's camera from which the edges
/// appear least foreshortened.
pub fn draw_wireframe(
    wireframe: &Wireframe3d,
    curves: &[Vec<Vector3<f64>>],
    scene: &Scene,
) -> RgbImage {
    let mut picture = RgbImage::from_pixel(SIZE, SIZE, Rgb([255; 3]));
    let mut points = wireframe.junctions.clone();
    points.extend(curves.iter().flatten());
    let Some((center, radius)) = ball_around(&points) else {
        return picture;
    };
    let orientations = scene.views.iter().map(|view| view.camera.world_from_camera);
    let orientation = orientations
        .max_by(|a, b| openness(wireframe, a).total_cmp(&openness(wireframe, b)))
        .unwrap_or_else(Matrix3::identity);
    let camera = camera_at(&orientation, &center, radius, &points);

    let depth = |point: &Vector3<f64>| camera.to_camera(point).z;
    let thinness = thinness(wireframe);
    let pen = |point: &Vector3<f64>| {
        let nearness = (DISTANCE + 1.0 - depth(point) / radius) / 2.0;
        FAR.mix(&NEAR, nearness.clamp(0.0, 1.0)).scaled(thinness)
    };
    let mut segments = segments_of(wireframe, curves);
    // Near lines go over far ones.
    segments.sort_by(|a, b| depth(&b.point_at(0.5)).total_cmp(&depth(&a.point_at(0.5))));
    for segment in &segments {
        if let Some(visible) = visible_part(segment, &camera, 0.0) {
            draw_segment(&mut picture, &visible, &segment.ends().map(|end| pen(&end)));
        }
    }
    for junction in &wireframe.junctions {
        let seen = camera.project(junction);
        if seen.depth > 0.0 {
            draw_disc(&mut picture, &seen.pixel, &JUNCTION.scaled(thinness));
        }
    }
    picture
}

/// Centre and radius of a ball around all points but strays; `None` without any.
fn ball_around(points: &[Vector3<f64>]) -> Option<(Vector3<f64>, f64)> {
    let [low, high] = extent_of_most(points)?;
    let radius = (high - low).norm() / 2.0;
    // One junction alone has no extent.
    Some(((low + high) / 2.0, if radius > 0.0 { radius } else { 1.0 }))
}

/// Mean logarithm of the factor by which the viewing direction shortens an edge:
/// largest where no group of parallel edges points at the viewer.
fn openness(wireframe: &Wireframe3d, world_from_camera: &Matrix3<f64>) -> f64 {
    /// An edge that is seen end on must not outweigh all others.
    const FLOOR: f64 = 0.05;
    let forward = world_from_camera.column(2);
    let logarithms = wireframe.segments().into_iter().map(|segment| {
        let direction = segment.end - segment.start;
        let cosine = direction.dot(&forward) / direction.norm().max(f64::MIN_POSITIVE);
        (1.0 - cosine * cosine).max(0.0).sqrt().max(FLOOR).ln()
    });
    logarithms.sum()
}

/// The camera of the picture, turned like `world_from_camera`, with the ball in front of it, and
/// the points but for strays in the middle of the picture.
fn camera_at(
    world_from_camera: &Matrix3<f64>,
    center: &Vector3<f64>,
    radius: f64,
    points: &[Vector3<f64>],
) -> Camera {
    let half = f64::from(SIZE) / 2.0;
    let mut camera = Camera {
        intrinsics: Intrinsics {
            fx: 1.0,
            fy: 1.0,
            cx: 0.0,
            cy: 0.0,
            skew: 0.0,
        },
        world_from_camera: *world_from_camera,
        center_in_world: center - world_from_camera.column(2) * (DISTANCE * radius),
        width: SIZE,
        height: SIZE,
    };
    let seen: Vec<Vector2<f64>> = (points.iter())
        .map(|point| camera.project(point))
        .filter(|seen| seen.depth > 0.0)
        .map(|seen| seen.pixel)
        .collect();
    let [low, high] = extent_of_most(&seen).unwrap_or_default();
    let extent = (high - low).max();
    let focal = if extent > 0.0 {
        FILLED * f64::from(SIZE) / extent
    } else {
        half
    };
    let middle = (low + high) / 2.0;
    camera.intrinsics = Intrinsics {
        fx: focal,
        fy: focal,
        cx: half - 0.5 - focal * middle.x,
        cy: half - 0.5 - focal * middle.y,
        skew: 0.0,
    };
    camera
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_core::synthetic::{Solid, SyntheticData, SyntheticScene, generate};

    fn l_prism() -> SyntheticData {
        let config = SyntheticScene {
            solid: Solid::LPrism,
            views: 5,
            image_size: 32,
            ..SyntheticScene::default()
        };
        generate(&config).unwrap()
    }

    #[test]
    fn the_object_fills_the_picture_without_leaving_it() {
        let data = l_prism();
        let picture = draw_wireframe(&data.truth, &[], &data.scene);
        let inked = |x: u32, y: u32| picture.get_pixel(x, y).0 != [255; 3];
        let columns: Vec<u32> = (0..SIZE)
            .filter(|x| (0..SIZE).any(|y| inked(*x, y)))
            .collect();
        let (first, last) = (columns[0], columns[columns.len() - 1]);
        assert!(first > 0 && last < SIZE - 1, "{first} {last}");
        assert!(last - first > SIZE / 3, "{first} {last}");
    }

    /// It neither shrinks the others nor is it drawn where it is not.
    #[test]
    fn a_stray_edge_leaves_the_picture_as_it_is() {
        let data = l_prism();
        let pieces = data.truth.segments().into_iter().flat_map(|edge| {
            let of_edge = move |i: u32| edge.point_at(f64::from(i) / 12.0);
            (0..12).map(move |i| [of_edge(i), of_edge(i + 1)])
        });
        let mut wireframe = Wireframe3d::default();
        for ends in pieces {
            let first = wireframe.junctions.len();
            wireframe.junctions.extend(ends);
            wireframe.edges.push([first, first + 1]);
        }
        let alone = draw_wireframe(&wireframe, &[], &data.scene);
        let orientation = data.scene.views[0].camera.world_from_camera;
        let [right, forward] = [0, 2].map(|axis| orientation.column(axis).into_owned());
        for far in [right, forward, -forward] {
            let mut with_stray = wireframe.clone();
            let first = with_stray.junctions.len();
            let stray = [100.0, 100.1].map(|distance| far * distance);
            with_stray.junctions.extend(stray);
            with_stray.edges.push([first, first + 1]);
            let picture = draw_wireframe(&with_stray, &[], &data.scene);
            let inked = |picture: &RgbImage| picture.pixels().filter(|p| p.0 != [255; 3]).count();
            let share = inked(&picture) as f64 / inked(&alone) as f64;
            assert!((0.5..1.2).contains(&share), "{share}");
        }
    }

    #[test]
    fn an_empty_wireframe_is_a_white_picture() {
        let scene = Scene {
            name: "empty".into(),
            views: Vec::new(),
            original_from_world: neat_core::Similarity::identity(),
            pixel_center: 0.5,
            sphere_radius: 1.0,
            sparse_points: Vec::new(),
        };
        let picture = draw_wireframe(&Wireframe3d::default(), &[], &scene);
        assert!(picture.pixels().all(|pixel| pixel.0 == [255; 3]));
        let lonely = Wireframe3d {
            junctions: vec![Vector3::new(1.0, 2.0, 3.0)],
            edges: Vec::new(),
        };
        let picture = draw_wireframe(&lonely, &[], &scene);
        let color = picture.get_pixel(SIZE / 2, SIZE / 2).0.map(f64::from);
        assert_eq!(color, JUNCTION.color);
    }
}
