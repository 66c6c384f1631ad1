//! Detects the wireframes of all images of a folder and writes HAWP files.
//!
//! `cargo run --release -p neat-detect --example detect_folder -- IMAGES OUT [--overlays DIR] [--config FILE]`

#![expect(clippy::print_stdout, reason = "an example tells what it does")]

use image::{DynamicImage, Rgb, RgbImage};
use nalgebra::Vector2;
use neat_core::{Wireframe2d, hawp_json};
use neat_detect::{DetectorConfig, detect};
use rayon::prelude::*;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;
use std::{env, fs};

fn main() -> Result<(), Box<dyn Error>> {
    let (mut folders, mut overlays, mut config) = (Vec::new(), None, DetectorConfig::default());
    let mut arguments = env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--overlays" => overlays = arguments.next().map(PathBuf::from),
            "--config" => {
                let file = arguments.next().ok_or("--config needs a file")?;
                config = toml::from_str(&fs::read_to_string(file)?)?;
            }
            _ => folders.push(PathBuf::from(argument)),
        }
    }
    let [images, out] = folders.as_slice() else {
        return Err("usage: detect_folder IMAGES OUT [--overlays DIR] [--config FILE]".into());
    };
    fs::create_dir_all(out)?;
    if let Some(dir) = &overlays {
        fs::create_dir_all(dir)?;
    }
    let mut paths: Vec<PathBuf> = fs::read_dir(images)?
        .map(|entry| Ok(entry?.path()))
        .collect::<Result<_, std::io::Error>>()?;
    paths.retain(|path| {
        path.extension().is_some_and(|e| {
            ["png", "jpg", "jpeg"]
                .iter()
                .any(|known| e.eq_ignore_ascii_case(known))
        })
    });
    paths.sort();
    let lines: Vec<String> = paths
        .par_iter()
        .map(|path| {
            let image = on_black(image::open(path)?);
            let start = Instant::now();
            let wireframe = detect(&image, &config);
            let seconds = start.elapsed().as_secs_f64();
            let stem = path.file_stem().unwrap_or_default();
            let named = |dir: &Path, ending: &str| dir.join(stem).with_extension(ending);
            hawp_json::write(&named(out, "json"), &wireframe, 0.0)?;
            if let Some(dir) = &overlays {
                draw(&image, &wireframe).save(named(dir, "png"))?;
            }
            Ok(format!(
                "{}: {} edges, {} vertices, {seconds:.3} s",
                path.display(),
                wireframe.edges.len(),
                wireframe.vertices.len()
            ))
        })
        .collect::<Result<_, Box<dyn Error + Send + Sync>>>()
        .map_err(|error| error.to_string())?;
    for line in lines {
        println!("{line}");
    }
    Ok(())
}

/// Transparent pixels show black.
fn on_black(image: DynamicImage) -> RgbImage {
    let rgba = image.into_rgba8();
    RgbImage::from_fn(rgba.width(), rgba.height(), |x, y| {
        let [r, g, b, alpha] = rgba.get_pixel(x, y).0;
        Rgb([r, g, b].map(|value| (u16::from(value) * u16::from(alpha) / 255) as u8))
    })
}

/// The photograph, darkened, with edges from red (unsure) to green (sure).
fn draw(image: &RgbImage, wireframe: &Wireframe2d) -> RgbImage {
    // Small images are enlarged, so that fractions of a pixel can be seen.
    let zoom = (1500 / image.width().max(image.height())).max(1);
    let mut picture = RgbImage::from_fn(image.width() * zoom, image.height() * zoom, |x, y| {
        Rgb(image
            .get_pixel(x / zoom, y / zoom)
            .0
            .map(|value| value / 5 * 3))
    });
    let zoomed = |point: &Vector2<f64>| (point.add_scalar(0.5) * f64::from(zoom)).add_scalar(-0.5);
    for ([a, b], score) in wireframe.edges.iter().zip(&wireframe.edge_scores) {
        let [start, end] = [*a, *b].map(|end| zoomed(&wireframe.vertices[end]));
        let steps = (end - start).amax().ceil().max(1.0) as usize * 2;
        let color = [(255.0 * (1.0 - score)) as u8, (255.0 * score) as u8, 40];
        for step in 0..=steps {
            let point = start + (end - start) * (step as f64 / steps as f64);
            put(&mut picture, &point, color);
        }
    }
    for (vertex, score) in wireframe.vertices.iter().zip(&wireframe.vertex_scores) {
        let color = if *score > 0.5 {
            [80, 160, 255]
        } else {
            [255, 255, 0]
        };
        for (x, y) in [(0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
            put(&mut picture, &(zoomed(vertex) + Vector2::new(x, y)), color);
        }
    }
    picture
}

fn put(picture: &mut RgbImage, point: &Vector2<f64>, color: [u8; 3]) {
    let inside = point.x >= 0.0 && point.y >= 0.0;
    if let Some(pixel) = picture
        .get_pixel_mut_checked(point.x.round() as u32, point.y.round() as u32)
        .filter(|_| inside)
    {
        *pixel = Rgb(color);
    }
}
