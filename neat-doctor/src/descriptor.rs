//! Binary descriptors: what a corner looks like, whatever its rotation.

use crate::corners::{Corner, corners, vertex_of_parabola};
use crate::gray_image::GrayImage;
use std::f32::consts::TAU;

/// A corner with what it looks like.
#[derive(Clone, Debug)]
pub(crate) struct Keypoint {
    /// Pixels of the working image.
    pub x: f32,
    pub y: f32,
    /// Size of a pixel of the level where it was found.
    pub scale: f32,
    pub descriptor: Descriptor,
}

/// 256 bits that tell how the gradients around a corner are distributed.
pub(crate) type Descriptor = [u64; 4];

/// How many bits differ.
#[inline(always)]
pub(crate) fn distance(a: &Descriptor, b: &Descriptor) -> u32 {
    (0..4).map(|i| (a[i] ^ b[i]).count_ones()).sum()
}

/// Each level of the pyramid is this much smaller than the one before it.
const LEVEL_SCALE: f32 = 1.5;
/// Keypoints of each level, at most.
const LEVEL_LIMITS: [usize; 4] = [360, 200, 100, 50];

/// Keypoints of all levels, the finest first.
pub(crate) fn keypoints(image: &GrayImage) -> Vec<Keypoint> {
    let mut keypoints = Vec::new();
    let mut level = image.clone();
    let mut scale = 1.0;
    for limit in LEVEL_LIMITS {
        let gradients = level.blurred(1).gradients();
        for corner in corners(&level, limit) {
            if let Some(descriptor) = describe(&gradients, &corner) {
                keypoints.push(Keypoint {
                    x: (corner.x + 0.5) * scale - 0.5,
                    y: (corner.y + 0.5) * scale - 0.5,
                    scale,
                    descriptor,
                });
            }
        }
        level = level.shrunk(LEVEL_SCALE);
        scale *= LEVEL_SCALE;
    }
    keypoints
}

/// Cells along each side, and bins of orientation in each.
const CELLS: usize = 4;
const BINS: usize = 8;
/// Pixels along the side of a cell, and so of samples.
const CELL_SIZE: usize = 4;
/// Distance of two samples, in pixels.
const STEP: f32 = 1.5;

/// A histogram of gradients (Lowe 2004), of which only comparisons are kept: of
/// each number to the mean, and to the next orientation of its cell.
pub(crate) fn describe(gradients: &[GrayImage; 2], corner: &Corner) -> Option<Descriptor> {
    let side = CELLS * CELL_SIZE;
    let half = side as f32 / 2.0;
    // The corners of the square, in any rotation.
    let reach = half * STEP * std::f32::consts::SQRT_2;
    let [along_x, along_y] = gradients;
    let inside = |at: f32, extent: usize| at > reach && at + reach < extent as f32 - 1.0;
    if !inside(corner.x, along_x.width) || !inside(corner.y, along_x.height) {
        return None;
    }
    let (sin, cos) = orientation(gradients, corner).sin_cos();
    let mut histogram = [0.0f32; CELLS * CELLS * BINS];
    for row in 0..side {
        for column in 0..side {
            let u = (column as f32 + 0.5 - half) * STEP;
            let v = (row as f32 + 0.5 - half) * STEP;
            let x = (corner.x + cos * u - sin * v).round() as usize;
            let y = (corner.y + sin * u + cos * v).round() as usize;
            let (gx, gy) = (along_x.at(x, y), along_y.at(x, y));
            let weight = (-(u * u + v * v) / (half * half * STEP * STEP)).exp();
            // In the frame of the corner.
            let angle = (cos * gy - sin * gx).atan2(cos * gx + sin * gy);
            let bin = (angle / TAU).rem_euclid(1.0) * BINS as f32;
            let lower = bin as usize % BINS;
            let share = bin - bin.floor();
            let magnitude = gx.hypot(gy) * weight;
            let cell = BINS * (row / CELL_SIZE * CELLS + column / CELL_SIZE);
            histogram[cell + lower] += magnitude * (1.0 - share);
            histogram[cell + (lower + 1) % BINS] += magnitude * share;
        }
    }
    let mean = histogram.iter().sum::<f32>() / histogram.len() as f32;
    let mut descriptor = [0u64; 4];
    for (index, value) in histogram.iter().enumerate() {
        let next = histogram[index / BINS * BINS + (index + 1) % BINS];
        let (word, bit) = (index / 64, index % 64);
        descriptor[word] |= u64::from(*value > mean) << bit;
        descriptor[2 + word] |= u64::from(*value > next) << bit;
    }
    Some(descriptor)
}

/// The angle of the strongest gradients around a corner.
fn orientation(gradients: &[GrayImage; 2], corner: &Corner) -> f32 {
    const ANGLES: usize = 36;
    const RADIUS: isize = 7;
    let [along_x, along_y] = gradients;
    let (column, row) = (corner.x.round() as isize, corner.y.round() as isize);
    let mut histogram = [0.0f32; ANGLES];
    for dy in -RADIUS..=RADIUS {
        for dx in -RADIUS..=RADIUS {
            let squared = (dx * dx + dy * dy) as f32;
            if squared > (RADIUS * RADIUS) as f32 {
                continue;
            }
            // The caller has checked a wider square.
            let index = (row + dy) as usize * along_x.width + (column + dx) as usize;
            let (gx, gy) = (along_x.values[index], along_y.values[index]);
            let bin = (gy.atan2(gx) / TAU).rem_euclid(1.0) * ANGLES as f32;
            histogram[bin as usize % ANGLES] += gx.hypot(gy) * (-squared / 24.0).exp();
        }
    }
    let smooth = |i: usize| {
        let neighbours = histogram[(i + ANGLES - 1) % ANGLES] + histogram[(i + 1) % ANGLES];
        histogram[i] + 0.5 * neighbours
    };
    let peak = (0..ANGLES)
        .max_by(|&a, &b| smooth(a).total_cmp(&smooth(b)))
        .unwrap_or(0);
    let [before, top, after] = [peak + ANGLES - 1, peak, peak + 1].map(|i| smooth(i % ANGLES));
    let offset = vertex_of_parabola(before, top, after);
    (peak as f32 + 0.5 + offset) * TAU / ANGLES as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Smooth noise, turned by `angle` about the middle.
    fn texture(angle: f32) -> GrayImage {
        let size = 160;
        let (sin, cos) = angle.sin_cos();
        let mut values = Vec::new();
        for y in 0..size {
            for x in 0..size {
                let (u, v) = (x as f32 - 79.5, y as f32 - 79.5);
                let (u, v) = (cos * u + sin * v, cos * v - sin * u);
                let wave = |a: f32, b: f32, c: f32| (a * u + b * v + c).sin();
                let sum = wave(0.31, 0.11, 0.0) * wave(-0.17, 0.37, 1.0)
                    + wave(0.23, -0.29, 2.0) * wave(0.41, 0.07, 0.5);
                values.push(0.5 + 0.2 * sum);
            }
        }
        GrayImage {
            width: size,
            height: size,
            values,
        }
    }

    #[test]
    fn turned_images_have_the_same_descriptors_at_turned_places() {
        let angle = 0.6f32;
        let (before, after) = (keypoints(&texture(0.0)), keypoints(&texture(angle)));
        assert!(before.len() > 30, "{}", before.len());
        let (sin, cos) = angle.sin_cos();
        let mut good = 0;
        let mut found = 0;
        for a in before.iter().filter(|a| a.scale == 1.0) {
            let (u, v) = (a.x - 79.5, a.y - 79.5);
            let (x, y) = (cos * u - sin * v + 79.5, cos * v + sin * u + 79.5);
            let partner = |b: &&Keypoint| b.scale == 1.0 && (b.x - x).hypot(b.y - y) < 1.0;
            if let Some(b) = after.iter().find(partner) {
                found += 1;
                good += usize::from(distance(&a.descriptor, &b.descriptor) < 60);
            }
        }
        assert!(found > 10 && good * 2 > found, "{good} of {found}");
    }
}
