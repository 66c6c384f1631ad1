//! PNG: an orthographic view with smooth lines.

use crate::ExportError;
use crate::drawn::Drawn;
use crate::orthographic::{Drawing, Frame};
use crate::target::Target;
use image::{Rgb, RgbImage};
use nalgebra::Vector2;
use neat_core::{LineSegment, LineSegment2, file};
use neat_wireframe::export::WireframeDocument;

const JUNCTION_COLOR: [u8; 3] = [0x11; 3];

/// Writes a PNG.
pub fn write(to: &mut Target) -> Result<(), ExportError> {
    let image = draw(to.document, &to.drawing(Frame::Most)?);
    Ok(file::write_png(to.path, &image)?)
}

/// The picture: uncertain edges first, so that certain ones lie on top.
fn draw(document: &WireframeDocument, drawing: &Drawing) -> RgbImage {
    let mut image = RgbImage::from_pixel(drawing.width, drawing.height, Rgb([255; 3]));
    let radius = drawing.line_width(document.edges.len()) / 2.0;
    let Drawn { wireframe, groups } = Drawn::new(document);
    for (_, color, edges) in groups {
        for edge in edges {
            let ends = wireframe.edges[edge];
            let [start, end] = ends.map(|end| drawing.project(&wireframe.junctions[end]));
            let segment = LineSegment::new(start, end);
            draw_segment(&mut image, &segment, radius, color);
        }
    }
    for junction in &document.junctions {
        let point = drawing.project(junction);
        let dot = LineSegment::new(point, point);
        draw_segment(&mut image, &dot, 2.0 * radius, JUNCTION_COLOR);
    }
    image
}

/// Draws a segment with round ends; pixel (column, row) covers the square from
/// (column, row) to (column + 1, row + 1).
fn draw_segment(image: &mut RgbImage, segment: &LineSegment2, radius: f64, color: [u8; 3]) {
    let along = segment.end - segment.start;
    // Columns of a steep segment are few, rows of a flat one: walk along the longer
    // side and visit only the pixels near the segment.
    let steep = along.y.abs() > along.x.abs();
    let (major, minor) = if steep { (1, 0) } else { (0, 1) };
    let size = [image.width(), image.height()].map(f64::from);
    let reach = radius + 1.0;
    let low = segment.start[major].min(segment.end[major]) - reach;
    let high = segment.start[major].max(segment.end[major]) + reach;
    let slope = if along[major] == 0.0 {
        0.0
    } else {
        along[minor] / along[major]
    };
    // Across a slope the pixels in reach are farther apart.
    let minor_reach = reach * slope.hypot(1.0) + slope.abs();
    for step in low.floor().max(0.0) as u32..high.ceil().min(size[major]) as u32 {
        let at = f64::from(step) + 0.5;
        let middle = segment.start[minor] + slope * (at - segment.start[major]);
        let first = (middle - minor_reach).floor().max(0.0) as u32;
        let last = (middle + minor_reach).ceil().min(size[minor]).max(0.0) as u32;
        for across in first..last {
            let [column, row] = if steep {
                [across, step]
            } else {
                [step, across]
            };
            let center = Vector2::new(f64::from(column), f64::from(row)).add_scalar(0.5);
            let coverage = (radius + 0.5 - distance(segment, &center)).clamp(0.0, 1.0);
            for (channel, color) in image.get_pixel_mut(column, row).0.iter_mut().zip(color) {
                let before = f64::from(*channel);
                *channel = (before + coverage * (f64::from(color) - before)).round() as u8;
            }
        }
    }
}

fn distance(segment: &LineSegment2, point: &Vector2<f64>) -> f64 {
    let along = segment.end - segment.start;
    let squared = along.norm_squared();
    let parameter = if squared > 0.0 {
        ((point - segment.start).dot(&along) / squared).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (point - segment.start - along * parameter).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coverage_adds_up_to_the_area_in_every_direction() {
        for angle in 0..24 {
            let (sin, cos) = (f64::from(angle) * 15f64.to_radians()).sin_cos();
            let center = Vector2::repeat(50.3);
            let half = Vector2::new(cos, sin) * 30.0;
            let mut image = RgbImage::from_pixel(100, 100, Rgb([255; 3]));
            let segment = LineSegment::new(center - half, center + half);
            draw_segment(&mut image, &segment, 2.0, [0; 3]);
            let ink: f64 = image
                .pixels()
                .map(|p| 1.0 - f64::from(p.0[0]) / 255.0)
                .sum();
            let area = 60.0 * 4.0 + std::f64::consts::PI * 4.0;
            assert!((ink / area - 1.0).abs() < 0.03, "{angle}: {ink} {area}");
        }
    }

    #[test]
    fn what_lies_outside_is_cut() {
        let mut image = RgbImage::from_pixel(8, 4, Rgb([255; 3]));
        for (start, end) in [
            ([-50.0, 2.0], [60.0, 2.0]),
            ([4.0, -1e9], [4.0, 1e9]),
            ([90.0, 9.0], [99.0, 9.0]),
        ] {
            let segment = LineSegment::new(Vector2::from(start), Vector2::from(end));
            draw_segment(&mut image, &segment, 0.5, [9; 3]);
        }
        assert!(image.pixels().any(|p| p.0 == [255; 3]));
        assert!(image.get_pixel(0, 2).0[0] < 255);
    }
}
