//! Pictures of a wireframe: drawn on the photographs, and alone.

mod line_drawing;
mod picture;

pub use picture::draw_wireframe;

use image::{Rgb, RgbImage};
use line_drawing::{Pen, draw_disc, draw_segment};
use nalgebra::{Vector2, Vector3};
use neat_core::{Camera, LineSegment2, LineSegment3, SceneError, View, Wireframe2d, Wireframe3d};

/// Line width relative to the larger side of the image.
const WIDTH_PER_SIZE: f64 = 1.0 / 400.0;
const SEGMENT_COLOR: [f64; 3] = [255.0, 64.0, 32.0];
const JUNCTION_COLOR: [f64; 3] = [32.0, 200.0, 255.0];

/// The photograph of a view with the wireframe on it, and curves by points along each, hidden
/// parts too. All are in the world frame of the cameras; what is behind the camera is cut off.
///
/// `pixel_center` is [`neat_core::Scene::pixel_center`].
///
/// # Errors
/// If the photograph lies in a file that cannot be read.
pub fn draw_overlay(
    view: &View,
    pixel_center: f64,
    (wireframe, curves): (&Wireframe3d, &[Vec<Vector3<f64>>]),
) -> Result<RgbImage, SceneError> {
    let photograph = view.image.read()?.into_owned();
    Ok(draw_projected(
        photograph,
        &view.camera,
        pixel_center,
        (wireframe, curves),
    ))
}

/// The same on the 2D segments of the view instead of the photograph, for who may
/// not pass photographs on.
pub fn draw_sketch(
    view: &View,
    pixel_center: f64,
    min_segment_score: f64,
    drawn: (&Wireframe3d, &[Vec<Vector3<f64>>]),
) -> RgbImage {
    let (width, height) = view.image.dimensions();
    let size = f64::from(width.max(height));
    let detected = Pen {
        color: [168.0; 3],
        radius: (size * WIDTH_PER_SIZE / 4.0).max(0.75),
    };
    let mut image = RgbImage::from_pixel(width, height, Rgb([255; 3]));
    for scored in view.wireframe.segments(min_segment_score) {
        let segment = (scored.segment).map(|end| end.add_scalar(-pixel_center));
        draw_segment(&mut image, &segment, &[detected; 2]);
    }
    draw_projected(image, &view.camera, pixel_center, drawn)
}

/// All edges, and chords of all curves, which are given by points along them.
fn segments_of(wireframe: &Wireframe3d, curves: &[Vec<Vector3<f64>>]) -> Vec<LineSegment3> {
    let mut segments = wireframe.segments();
    for ends in curves.iter().flat_map(|curve| curve.windows(2)) {
        segments.push(LineSegment3::new(ends[0], ends[1]));
    }
    segments
}

fn draw_projected(
    mut image: RgbImage,
    camera: &Camera,
    pixel_center: f64,
    (wireframe, curves): (&Wireframe3d, &[Vec<Vector3<f64>>]),
) -> RgbImage {
    let size = f64::from(image.width().max(image.height()));
    let radius = (size * WIDTH_PER_SIZE / 2.0 * thinness(wireframe)).max(0.75);
    let line = Pen {
        color: SEGMENT_COLOR,
        radius,
    };
    let dot = Pen {
        color: JUNCTION_COLOR,
        radius: 2.0 * radius,
    };
    for segment in segments_of(wireframe, curves) {
        if let Some(segment) = visible_part(&segment, camera, pixel_center) {
            draw_segment(&mut image, &segment, &[line; 2]);
        }
    }
    for junction in &wireframe.junctions {
        let projection = camera.project(junction);
        if projection.depth > 0.0 {
            let pixel = projection.pixel - Vector2::repeat(pixel_center);
            draw_disc(&mut image, &pixel, &dot);
        }
    }
    image
}

/// An image with a 2D wireframe on it, whose pixel centres are integers: the more
/// certain a segment, the brighter.
pub fn draw_detection(image: &RgbImage, wireframe: &Wireframe2d) -> RgbImage {
    const CERTAIN: [f64; 3] = [64.0, 255.0, 64.0];
    const DOUBTFUL: [f64; 3] = [255.0, 64.0, 32.0];
    let mut drawn = image.clone();
    let size = f64::from(image.width().max(image.height()));
    let radius = (size * WIDTH_PER_SIZE / 4.0).max(0.5);
    for scored in wireframe.segments(f64::NEG_INFINITY) {
        let certain = Pen {
            color: CERTAIN,
            radius,
        };
        let doubtful = Pen {
            color: DOUBTFUL,
            radius,
        };
        let pen = doubtful.mix(&certain, scored.score.clamp(0.0, 1.0));
        draw_segment(&mut drawn, &scored.segment, &[pen; 2]);
    }
    let dot = Pen {
        color: JUNCTION_COLOR,
        radius: 2.0 * radius,
    };
    for vertex in &wireframe.vertices {
        draw_disc(&mut drawn, vertex, &dot);
    }
    drawn
}

/// Factor on the widths with which a wireframe is drawn: with many edges thick lines
/// would hide each other.
fn thinness(wireframe: &Wireframe3d) -> f64 {
    const EDGES: f64 = 100.0;
    (EDGES / wireframe.edges.len().max(1) as f64)
        .sqrt()
        .clamp(0.4, 1.0)
}

/// The part of a segment that is in front of the camera, in pixels with the
/// centre of the first one at (0, 0).
fn visible_part(
    segment: &LineSegment3,
    camera: &Camera,
    pixel_center: f64,
) -> Option<LineSegment2> {
    /// Lines are cut at this share of the larger depth: at 0 they would be
    /// infinitely far away in the image.
    const NEAR: f64 = 1e-3;
    let [start, end] = segment.ends().map(|p| camera.to_camera(&p).z);
    let near = NEAR * start.max(end);
    if near <= 0.0 {
        return None;
    }
    let crossing = || segment.point_at((near - start) / (end - start));
    let clipped = LineSegment3::new(
        if start < near {
            crossing()
        } else {
            segment.start
        },
        if end < near { crossing() } else { segment.end },
    );
    let center = Vector2::repeat(pixel_center);
    Some(clipped.map(|point| camera.project(point).pixel - center))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use neat_core::synthetic::{SyntheticScene, generate};

    fn scene() -> neat_core::synthetic::SyntheticData {
        let config = SyntheticScene {
            views: 12,
            image_size: 64,
            ..SyntheticScene::default()
        };
        generate(&config).unwrap()
    }

    #[test]
    fn lines_lie_on_the_projected_edges() {
        let data = scene();
        let view = &data.scene.views[3];
        let image = draw_overlay(view, data.scene.pixel_center, (&data.truth, &[])).unwrap();
        for segment in data.truth.segments() {
            let middle = view.camera.project(&segment.point_at(0.5)).pixel;
            // The index of the pixel that holds a point: its centre is at +0.5.
            let pixel = image.get_pixel(middle.x.floor() as u32, middle.y.floor() as u32);
            assert!(
                [SEGMENT_COLOR, JUNCTION_COLOR]
                    .iter()
                    .any(|c| (0..3).all(|i| (c[i] - f64::from(pixel.0[i])).abs() < 80.0)),
                "{pixel:?}"
            );
        }
    }

    #[test]
    fn sketches_show_nothing_of_the_photograph() {
        let mut data = scene();
        let sketch = |data: &neat_core::synthetic::SyntheticData| {
            draw_sketch(
                &data.scene.views[3],
                data.scene.pixel_center,
                0.05,
                (&data.truth, &[]),
            )
        };
        let before = sketch(&data);
        data.scene.views[3].image = RgbImage::from_pixel(64, 64, Rgb([77; 3])).into();
        assert_eq!(sketch(&data), before);
        assert_ne!(before, RgbImage::from_pixel(64, 64, Rgb([255; 3])));
    }

    #[test]
    fn what_is_behind_the_camera_is_cut_off() {
        let data = scene();
        let camera = &data.scene.views[0].camera;
        let in_front = Vector3::zeros();
        let behind = camera.center_in_world * 2.0;
        let segment = LineSegment3::new(behind, in_front);
        let part = visible_part(&segment, camera, 0.0).unwrap();
        assert!((part.end - camera.project(&in_front).pixel).norm() < 1e-9);
        assert!(part.start.iter().all(|x| x.is_finite()));
        let wholly = LineSegment3::new(behind, behind * 1.5);
        assert_eq!(visible_part(&wholly, camera, 0.0), None);
    }
}
