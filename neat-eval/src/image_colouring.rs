//! Rendered colours, depths and normals as images.

use image::{Rgb, RgbImage};

/// What depths look like.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DepthColors {
    /// White is near, and black is far or none.
    #[default]
    Gray,
    /// matplotlib's viridis: yellow is near, violet far, and black none.
    Viridis,
}

/// Colours from 0 to 1, row by row, as an image.
///
/// # Panics
/// If there is not one per pixel, as all functions here.
pub fn color_image(width: u32, height: u32, colors: &[[f32; 3]]) -> RgbImage {
    image_of(width, height, |i| colors[i])
}

/// Depths, row by row, as colours.
///
/// Depths that are not finite, or less than half of the median of the positive
/// ones, are none: a ray that only grazes something has little weight, and with
/// it a depth in front of everything. For the same reason the nearest tenth does
/// not count for the range.
pub fn depth_image(width: u32, height: u32, depths: &[f32], colors: DepthColors) -> RgbImage {
    let is_positive = |depth: &f32| *depth > 0.0 && depth.is_finite();
    let mut sorted: Vec<f32> = depths.iter().copied().filter(is_positive).collect();
    sorted.sort_by(f32::total_cmp);
    let least = sorted
        .get(sorted.len() / 2)
        .map_or(0.0, |median| median / 2.0);
    sorted.retain(|depth| *depth >= least);
    let (near, far) = match (sorted.get(sorted.len() / 10), sorted.last()) {
        (Some(near), Some(far)) => (*near, *far),
        _ => (0.0, 0.0),
    };
    // All at one depth: all near.
    let range = if far > near {
        far - near
    } else {
        f32::INFINITY
    };
    image_of(width, height, |i| {
        let depth = depths[i];
        if !is_positive(&depth) || depth < least {
            return [0.0; 3];
        }
        let nearness = (1.0 - (depth - near) / range).clamp(0.0, 1.0);
        match colors {
            DepthColors::Gray => [nearness; 3],
            DepthColors::Viridis => viridis(nearness),
        }
    })
}

/// Normals, row by row, with x, y and z from −1 to 1 as red, green and blue from
/// 0 to 1.
pub fn normal_image(width: u32, height: u32, normals: &[[f32; 3]]) -> RgbImage {
    image_of(width, height, |i| normals[i].map(|x| (x + 1.0) / 2.0))
}

fn image_of(width: u32, height: u32, color: impl Fn(usize) -> [f32; 3]) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| {
        let index = y as usize * width as usize + x as usize;
        Rgb(color(index).map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8))
    })
}

/// Every eighth of viridis (Smith, van der Walt and Firing 2015), from 0 to 1.
const VIRIDIS: [[u8; 3]; 9] = [
    [68, 1, 84],
    [71, 44, 122],
    [59, 81, 139],
    [44, 113, 142],
    [33, 144, 141],
    [39, 173, 129],
    [92, 200, 99],
    [170, 220, 50],
    [253, 231, 37],
];

fn viridis(value: f32) -> [f32; 3] {
    let position = value * (VIRIDIS.len() - 1) as f32;
    let below = (position as usize).min(VIRIDIS.len() - 2);
    let weight = position - below as f32;
    std::array::from_fn(|channel| {
        let [a, b] = [below, below + 1].map(|i| f32::from(VIRIDIS[i][channel]) / 255.0);
        a + (b - a) * weight
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depths_are_bright_where_near() {
        let depths = [2.0, 3.0, 4.0, 0.0, f32::INFINITY, f32::NAN, 0.5, -1.0];
        let image = depth_image(4, 2, &depths, DepthColors::Gray);
        let levels: Vec<u8> = image.pixels().map(|p| p.0[0]).collect();
        assert_eq!(levels, [255, 128, 0, 0, 0, 0, 0, 0]);
        let flat = depth_image(2, 1, &[2.0, 2.0], DepthColors::Gray);
        assert!(flat.pixels().all(|p| p.0 == [255; 3]));
        let nothing = depth_image(2, 1, &[0.0, f32::NAN], DepthColors::Viridis);
        assert!(nothing.pixels().all(|p| p.0 == [0; 3]));
    }

    #[test]
    fn viridis_goes_from_violet_to_yellow() {
        let image = depth_image(3, 1, &[2.0, 3.0, 4.0], DepthColors::Viridis);
        let pixels: Vec<[u8; 3]> = image.pixels().map(|p| p.0).collect();
        assert_eq!(pixels, [[253, 231, 37], [33, 144, 141], [68, 1, 84]]);
    }

    #[test]
    fn a_png_reads_back() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let image = normal_image(2, 1, &[[0.0, 1.0, -1.0], [1.0, 0.0, 0.0]]);
        neat_core::file::write_png(&path, &image).unwrap();
        assert_eq!(image::open(&path).unwrap().into_rgb8(), image);
        assert_eq!(image.get_pixel(0, 0).0, [128, 255, 0]);
    }
}
