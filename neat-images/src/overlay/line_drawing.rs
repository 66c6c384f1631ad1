//! Smooth thick lines and discs on an image.

use image::{Rgb, RgbImage};
use nalgebra::Vector2;
use neat_core::LineSegment2;

/// How a line looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pen {
    /// Red, green and blue, from 0 to 255.
    pub color: [f64; 3],
    /// Half of the line's width, in pixels.
    pub radius: f64,
}

impl Pen {
    /// A pen of another width.
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            radius: self.radius * factor,
            ..*self
        }
    }

    /// The pen at `t` on the way from this one (0) to `other` (1).
    pub fn mix(&self, other: &Self, t: f64) -> Self {
        let mix = |a: f64, b: f64| a + (b - a) * t;
        Self {
            color: std::array::from_fn(|i| mix(self.color[i], other.color[i])),
            radius: mix(self.radius, other.radius),
        }
    }
}

/// Draws a segment with round ends, by one pen at its start that becomes the
/// other at its end; a segment without length is a disc. Coordinates have the
/// centre of the first pixel at (0, 0). What lies outside the image is cut off.
pub fn draw_segment(image: &mut RgbImage, segment: &LineSegment2, pens: &[Pen; 2]) {
    let direction = segment.end - segment.start;
    // Pixels are visited along the axis on which the segment is longer: on the
    // other one it then spans few.
    let major = usize::from(direction.y.abs() > direction.x.abs());
    let minor = 1 - major;
    let (width, height) = image.dimensions();
    let size = [width, height];
    let reach = pens[0].radius.max(pens[1].radius) + 1.0;
    // A slope of at most 45 degrees widens the cut across the line by √2.
    let half_span = reach * std::f64::consts::SQRT_2;

    let ends = [segment.start[major], segment.end[major]];
    let [low, high] = [ends[0].min(ends[1]), ends[0].max(ends[1])];
    for u in pixels(low - reach, high + reach, size[major]) {
        let t = match direction[major] {
            0.0 => 0.0,
            length => ((f64::from(u) - segment.start[major]) / length).clamp(0.0, 1.0),
        };
        let center = segment.point_at(t)[minor];
        for v in pixels(center - half_span, center + half_span, size[minor]) {
            let [x, y] = if major == 0 { [u, v] } else { [v, u] };
            let point = Vector2::new(f64::from(x), f64::from(y));
            let foot = segment.line_parameter(&point).clamp(0.0, 1.0);
            let pen = pens[0].mix(&pens[1], foot);
            // The share of the pixel that the line covers, to first order.
            let coverage = pen.radius + 0.5 - (segment.point_at(foot) - point).norm();
            blend(image.get_pixel_mut(x, y), &pen, coverage.clamp(0.0, 1.0));
        }
    }
}

/// Draws a disc around `center`.
pub fn draw_disc(image: &mut RgbImage, center: &Vector2<f64>, pen: &Pen) {
    draw_segment(image, &LineSegment2::new(*center, *center), &[*pen; 2]);
}

/// The pixel indices from `low` to `high` that exist.
fn pixels(low: f64, high: f64, size: u32) -> std::ops::Range<u32> {
    // Float to integer conversion saturates, and NaN becomes 0.
    let first = low.ceil().max(0.0) as u32;
    let past_last = (high.floor() + 1.0).clamp(0.0, f64::from(size)) as u32;
    first..past_last
}

fn blend(pixel: &mut Rgb<u8>, pen: &Pen, coverage: f64) {
    for (value, target) in pixel.0.iter_mut().zip(pen.color) {
        let mixed = f64::from(*value) * (1.0 - coverage) + target * coverage;
        *value = mixed.round() as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHITE: Pen = Pen {
        color: [255.0; 3],
        radius: 1.5,
    };

    fn brightness(image: &RgbImage) -> f64 {
        image.pixels().map(|p| f64::from(p.0[0]) / 255.0).sum()
    }

    #[test]
    fn a_line_covers_its_area_in_every_direction() {
        for i in 0..16 {
            let angle = f64::from(i) * std::f64::consts::TAU / 16.0 + 0.1;
            let half = Vector2::new(angle.cos(), angle.sin()) * 30.0;
            let center = Vector2::new(50.3, 49.8);
            let segment = LineSegment2::new(center - half, center + half);
            let mut image = RgbImage::new(100, 100);
            draw_segment(&mut image, &segment, &[WHITE; 2]);
            // A rectangle and two half discs.
            let area = 60.0 * 3.0 + std::f64::consts::PI * 1.5 * 1.5;
            assert!((brightness(&image) - area).abs() < 0.03 * area, "{angle}");
        }
    }

    #[test]
    fn what_is_outside_the_image_is_cut_off() {
        let mut image = RgbImage::new(20, 10);
        let far = LineSegment2::new(Vector2::new(-1e9, 5.0), Vector2::new(1e9, 5.0));
        draw_segment(&mut image, &far, &[WHITE; 2]);
        assert_eq!(image.get_pixel(0, 5).0, [255; 3]);
        assert_eq!(image.get_pixel(19, 5).0, [255; 3]);
        assert_eq!(image.get_pixel(10, 0).0, [0; 3]);

        let before = image.clone();
        for point in [
            Vector2::new(-50.0, 5.0),
            Vector2::new(5.0, 1e12),
            Vector2::new(f64::NAN, f64::NAN),
        ] {
            draw_disc(&mut image, &point, &WHITE);
        }
        assert_eq!(image, before);
    }

    #[test]
    fn pens_change_along_the_line() {
        let mut image = RgbImage::new(101, 9);
        let segment = LineSegment2::new(Vector2::new(0.0, 4.0), Vector2::new(100.0, 4.0));
        let black = Pen {
            color: [0.0; 3],
            radius: 1.5,
        };
        draw_segment(&mut image, &segment, &[black, WHITE]);
        let levels = [0, 20, 50, 100].map(|x| image.get_pixel(x, 4).0[0]);
        assert_eq!(levels, [0, 51, 128, 255]);
    }
}
