//! Line drawings: a wireframe over photographs, and seen along its axes.

use image::{Rgb, RgbImage};
use nalgebra::{Matrix3, Vector2, Vector3};
use neat_core::{Scene, View};
use neat_wireframe::Wireframe3d;
use neat_wireframe::projection::project_in_front;
use std::path::Path;

const WHITE: Rgb<u8> = Rgb([255, 255, 255]);
const BLACK: Rgb<u8> = Rgb([0, 0, 0]);
const JUNCTION: Rgb<u8> = Rgb([255, 230, 0]);

/// Writes one PNG per view: the darkened photograph, every edge in a colour from
/// red (few views) to green (many), junctions of at least two edges in yellow.
pub fn draw_overlays(
    dir: &Path,
    scene: &Scene,
    wireframe: &Wireframe3d,
    views_per_edge: &[usize],
) -> Result<(), Box<dyn std::error::Error>> {
    std::fs::create_dir_all(dir)?;
    for view in &scene.views {
        let image = overlay(view, scene.pixel_center, wireframe, views_per_edge);
        image.save(dir.join(format!("{}.png", view.name)))?;
    }
    Ok(())
}

fn overlay(
    view: &View,
    pixel_center: f64,
    wireframe: &Wireframe3d,
    views_per_edge: &[usize],
) -> RgbImage {
    let mut image = view
        .image
        .read()
        .expect("the image is in memory")
        .into_owned();
    for pixel in image.pixels_mut() {
        pixel.0 = pixel.0.map(|value| value / 2);
    }
    let project = |point: &Vector3<f64>| {
        project_in_front(&view.camera, point).map(|pixel| pixel.add_scalar(-pixel_center))
    };
    let mut degree = vec![0; wireframe.junctions.len()];
    for ([a, b], views) in wireframe.edges.iter().zip(views_per_edge) {
        degree[*a] += 1;
        degree[*b] += 1;
        if let (Some(start), Some(end)) = (
            project(&wireframe.junctions[*a]),
            project(&wireframe.junctions[*b]),
        ) {
            let certainty = ((*views as f64 - 3.0) / 5.0).clamp(0.0, 1.0);
            let green = (255.0 * certainty) as u8;
            draw_line(&mut image, &start, &end, Rgb([255 - green, green, 60]));
        }
    }
    for (junction, degree) in wireframe.junctions.iter().zip(degree) {
        if let (2.., Some(pixel)) = (degree, project(junction)) {
            for offset in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                put(
                    &mut image,
                    pixel.x as i64 + offset.0,
                    pixel.y as i64 + offset.1,
                    JUNCTION,
                );
            }
        }
    }
    image
}

/// Writes three PNGs: the wireframe seen along each of the principal axes of its
/// junctions, longest first, without perspective.
pub fn draw_plans(dir: &Path, wireframe: &Wireframe3d) -> Result<(), Box<dyn std::error::Error>> {
    /// Side of the pictures in pixels.
    const SIZE: u32 = 1000;
    std::fs::create_dir_all(dir)?;
    let count = wireframe.junctions.len().max(1) as f64;
    let mean = wireframe.junctions.iter().sum::<Vector3<f64>>() / count;
    let covariance: Matrix3<f64> = wireframe
        .junctions
        .iter()
        .map(|junction| (junction - mean) * (junction - mean).transpose())
        .sum();
    let eigen = covariance.symmetric_eigen();
    let mut axes = [0, 1, 2];
    axes.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let axes = axes.map(|axis| eigen.eigenvectors.column(axis).into_owned());
    // The middle 98 % fill the picture.
    let mut extents: Vec<f64> = wireframe
        .junctions
        .iter()
        .map(|junction| (junction - mean).amax())
        .collect();
    extents.sort_by(f64::total_cmp);
    let extent = extents
        .get(extents.len() * 98 / 100)
        .copied()
        .unwrap_or(1.0);
    let scale = 0.45 * f64::from(SIZE) / extent.max(f64::MIN_POSITIVE);
    for (k, (right, down)) in [(1, 2), (0, 2), (0, 1)].into_iter().enumerate() {
        let mut image = RgbImage::from_pixel(SIZE, SIZE, WHITE);
        let place = |junction: usize| {
            let offset = (wireframe.junctions[junction] - mean) * scale;
            Vector2::new(offset.dot(&axes[right]), offset.dot(&axes[down]))
                .add_scalar(0.5 * f64::from(SIZE))
        };
        for [a, b] in &wireframe.edges {
            draw_line(&mut image, &place(*a), &place(*b), BLACK);
        }
        image.save(dir.join(format!("along_axis_{k}.png")))?;
    }
    Ok(())
}

fn draw_line(image: &mut RgbImage, start: &Vector2<f64>, end: &Vector2<f64>, color: Rgb<u8>) {
    let steps = (end - start).amax().ceil().clamp(1.0, 20_000.0) as usize;
    for step in 0..=steps {
        let point = start + (end - start) * (step as f64 / steps as f64);
        put(image, point.x.round() as i64, point.y.round() as i64, color);
    }
}

fn put(image: &mut RgbImage, x: i64, y: i64, color: Rgb<u8>) {
    if let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y))
        && x < image.width()
        && y < image.height()
    {
        image.put_pixel(x, y, color);
    }
}
