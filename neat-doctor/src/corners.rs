//! Corners of images: points that can be found again in other views.

use crate::gray_image::GrayImage;

/// A corner in a [`GrayImage`], in its pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Corner {
    pub x: f32,
    pub y: f32,
    /// det / trace of the structure tensor: large where the brightness changes
    /// in two directions.
    pub strength: f32,
}

/// No second corner within this many pixels, in both directions.
const SEPARATION: usize = 4;
/// A corner's strength as a share of the strongest one's, at least. The sides
/// of objects differ much less from each other than from their background.
const MIN_RELATIVE_STRENGTH: f32 = 2e-3;
/// A step of 2 of 255 levels makes a corner of about this strength.
const MIN_STRENGTH: f32 = 4e-6;

/// The corners of an image, the strongest first, `limit` of them at most
/// (Harris and Stephens 1988, with the harmonic mean of the eigenvalues).
pub(crate) fn corners(image: &GrayImage, limit: usize) -> Vec<Corner> {
    let strength = strengths(image);
    let strongest = strength.values.iter().copied().fold(0.0, f32::max);
    let threshold = (MIN_RELATIVE_STRENGTH * strongest).max(MIN_STRENGTH);
    let mut corners = Vec::new();
    let border = 2 * SEPARATION;
    for y in border..image.height.saturating_sub(border) {
        for x in border..image.width.saturating_sub(border) {
            let value = strength.at(x, y);
            if value > threshold && is_peak(&strength, x, y) {
                corners.push(Corner {
                    x: x as f32 + parabola_top(&strength, x, y, 1),
                    y: y as f32 + parabola_top(&strength, x, y, image.width),
                    strength: value,
                });
            }
        }
    }
    // Ties by place, so that the order is the same everywhere.
    corners.sort_by(|a, b| {
        (b.strength.total_cmp(&a.strength))
            .then(a.y.total_cmp(&b.y))
            .then(a.x.total_cmp(&b.x))
    });
    corners.truncate(limit);
    corners
}

fn strengths(image: &GrayImage) -> GrayImage {
    let [along_x, along_y] = image.blurred(2).gradients();
    let product = |a: &GrayImage, b: &GrayImage| {
        let values = a.values.iter().zip(&b.values).map(|(a, b)| a * b);
        a.with_values(values.collect()).blurred(4)
    };
    let mut xx = product(&along_x, &along_x);
    let (xy, yy) = (product(&along_x, &along_y), product(&along_y, &along_y));
    for ((xx, xy), yy) in xx.values.iter_mut().zip(&xy.values).zip(&yy.values) {
        let trace = *xx + yy;
        *xx = if trace > 0.0 {
            (*xx * yy - xy * xy) / trace
        } else {
            0.0
        };
    }
    xx
}

/// Whether no pixel near is stronger; of equal ones the first counts.
fn is_peak(strength: &GrayImage, x: usize, y: usize) -> bool {
    let value = strength.at(x, y);
    (y - SEPARATION..=y + SEPARATION).all(|row| {
        (x - SEPARATION..=x + SEPARATION).all(|column| {
            let other = strength.at(column, row);
            other < value || (other == value && (row, column) >= (y, x))
        })
    })
}

/// Where between the pixels the top is, by a parabola along one axis.
fn parabola_top(strength: &GrayImage, x: usize, y: usize, step: usize) -> f32 {
    let index = y * strength.width + x;
    let [before, top, after] = [index - step, index, index + step].map(|i| strength.values[i]);
    vertex_of_parabola(before, top, after)
}

/// Where the parabola through three values has its top, from the middle one, within half
/// a step; 0 where it has none.
pub(crate) fn vertex_of_parabola(before: f32, top: f32, after: f32) -> f32 {
    let curvature = before - 2.0 * top + after;
    if curvature < 0.0 {
        (0.5 * (before - after) / curvature).clamp(-0.5, 0.5)
    } else {
        0.0
    }
}

/// Half the side of the window in which edges are intersected.
const WINDOW: isize = 5;
/// A corner that moves further than this was none.
const MAX_SHIFT: f32 = 3.0;

/// The corner moved to where the edges around it meet (Förstner and Gülch
/// 1987): the strength alone peaks inside of acute corners. `None` if they meet
/// nowhere near. `gradients` are those of the lightly blurred image.
pub(crate) fn refined(gradients: &[GrayImage; 2], corner: &Corner) -> Option<Corner> {
    let [along_x, along_y] = gradients;
    let (mut x, mut y) = (corner.x, corner.y);
    for _ in 0..4 {
        let (column, row) = (x.round() as isize, y.round() as isize);
        let inside =
            |center: isize, extent: usize| center >= WINDOW && center + WINDOW < extent as isize;
        if !inside(column, along_x.width) || !inside(row, along_x.height) {
            return None;
        }
        let (mut xx, mut xy, mut yy, mut bx, mut by) = (0.0f32, 0.0, 0.0, 0.0, 0.0);
        for dy in -WINDOW..=WINDOW {
            for dx in -WINDOW..=WINDOW {
                let index = (row + dy) as usize * along_x.width + (column + dx) as usize;
                let (gx, gy) = (along_x.values[index], along_y.values[index]);
                let (px, py) = ((column + dx) as f32 - x, (row + dy) as f32 - y);
                let weight = (-(px * px + py * py) / 8.0).exp();
                let along = gx * px + gy * py;
                xx += weight * gx * gx;
                xy += weight * gx * gy;
                yy += weight * gy * gy;
                bx += weight * gx * along;
                by += weight * gy * along;
            }
        }
        let determinant = xx * yy - xy * xy;
        // Edges of nearly one direction do not say where along them.
        if determinant <= 0.01 * (xx + yy) * (xx + yy) {
            return None;
        }
        let shift_x = (yy * bx - xy * by) / determinant;
        let shift_y = (xx * by - xy * bx) / determinant;
        x += shift_x;
        y += shift_y;
        if (x - corner.x).abs().max((y - corner.y).abs()) > MAX_SHIFT {
            return None;
        }
        if shift_x.abs().max(shift_y.abs()) < 0.02 {
            break;
        }
    }
    Some(Corner { x, y, ..*corner })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bright quadrilateral on black with a smooth border.
    fn quadrilateral(points: &[[f32; 2]; 4]) -> GrayImage {
        let (width, height) = (120, 100);
        let mut values = Vec::new();
        for y in 0..height {
            for x in 0..width {
                let inside = (0..4)
                    .map(|i| {
                        let ([ax, ay], [bx, by]) = (points[i], points[(i + 1) % 4]);
                        let (dx, dy) = (bx - ax, by - ay);
                        ((x as f32 - ax) * -dy + (y as f32 - ay) * dx) / dx.hypot(dy)
                    })
                    .fold(f32::INFINITY, f32::min);
                values.push((inside + 0.5).clamp(0.0, 1.0));
            }
        }
        GrayImage {
            width,
            height,
            values,
        }
    }

    #[test]
    fn corners_of_a_shape_are_found_to_a_fraction_of_a_pixel() {
        let points = [[20.3, 15.6], [95.2, 25.1], [85.7, 80.4], [30.9, 70.2]];
        let image = quadrilateral(&points);
        let found = corners(&image, 100);
        assert_eq!(found.len(), 4);
        let gradients = image.blurred(1).gradients();
        for [x, y] in points {
            let nearest = found
                .iter()
                .filter_map(|corner| refined(&gradients, corner))
                .map(|corner| (corner.x - x).hypot(corner.y - y))
                .fold(f32::INFINITY, f32::min);
            assert!(nearest < 0.35, "{nearest}");
        }
    }

    #[test]
    fn flat_and_tiny_images_have_no_corners() {
        for (width, height) in [(1, 1), (5, 40), (64, 64)] {
            let image = GrayImage {
                width,
                height,
                values: vec![0.5; width * height],
            };
            assert_eq!(corners(&image, 10), []);
        }
    }
}
