//! What the images show beside an edge: narrow strips of the half-planes hinged at it, and
//! bands of the image along it.

use super::edge_frame::{EdgeFrame, HALF_PLANES, Side, is_seen};
use nalgebra::{Vector2, Vector3};
use neat_core::{Camera, Scene, SceneError};
use rayon::prelude::*;

/// Distances of a strip's rows from the edge, in pixels: beyond the blur of the edge itself,
/// and within faces that are ten pixels wide.
const ROWS: [f64; 4] = [2.0, 4.0, 6.0, 8.0];
/// An edge is compared in pieces of about this many pixels, so that something that hides a
/// part of it in some views does not spoil the rest.
const PIECE: f64 = 48.0;
/// Pixels between the samples along a piece.
const SPACING: f64 = 2.0;
/// At most this many pieces of a long edge: a plane shows in less.
const MAX_PIECES: usize = 12;
/// Samples along a piece: enough to correlate, and bounded for edges that are nearly points.
const SAMPLES: (usize, usize) = (6, 32);
/// Share of the edge at each end that is left out: other edges begin there.
const END: f64 = 0.05;
/// Bands along the edge in the image, in pixels from it: the colours of its two sides beyond
/// what a joint or a rounded edge is wide, and the edge itself.
const SIDE_BAND: [f64; 5] = [6.0, 7.5, 9.0, 10.5, 12.0];
const CENTRE_BAND: [f64; 3] = [-0.5, 0.0, 0.5];
/// Bands next to the edge, just beyond its blur: a thin line has the same on both sides.
const NEAR_BAND: [f64; 3] = [2.5, 3.25, 4.0];

/// What one view shows of an edge.
#[derive(Clone, Debug, Default)]
pub(super) struct ViewSamples {
    /// By side, half-plane and piece, as [`strip_index`] counts: the luminances of the strip;
    /// empty where the view does not see all of it.
    pub strips: Vec<Vec<u8>>,
    pub bands: Option<Bands>,
}

/// Mean colours along an edge, red, green and blue from 0 to 255.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bands {
    pub left: [f64; 3],
    pub centre: [f64; 3],
    pub right: [f64; 3],
    /// Next to the edge, left and right.
    pub near: [[f64; 3]; 2],
}

/// Where an edge is sampled: for each piece, shares of the edge's length.
pub(super) fn pieces(frame: &EdgeFrame) -> Vec<Vec<f64>> {
    let pixels = (1.0 - 2.0 * END) * frame.length_in_pixels();
    // Not so for NaN; a hostile edge must not fill the memory.
    let all = (pixels / PIECE).round().clamp(1.0, 1e6) as usize;
    let per_piece = (pixels / all as f64 / SPACING) as usize;
    let per_piece = per_piece.clamp(SAMPLES.0, SAMPLES.1);
    let used = all.min(MAX_PIECES);
    let piece = |i: usize| {
        let index = if used == 1 {
            0
        } else {
            i * (all - 1) / (used - 1)
        };
        let share = |k: usize| (index as f64 + (k as f64 + 0.5) / per_piece as f64) / all as f64;
        (0..per_piece)
            .map(|k| END + (1.0 - 2.0 * END) * share(k))
            .collect()
    };
    (0..used).map(piece).collect()
}

/// Where the strip of a piece stands in [`ViewSamples::strips`].
pub(super) fn strip_index(side: Side, half_plane: usize, piece: usize, pieces: usize) -> usize {
    (side as usize * HALF_PLANES + half_plane) * pieces + piece
}

/// What the samples of an edge in all its views take in memory.
pub(super) fn sampled_bytes(frame: &EdgeFrame) -> usize {
    let stations: usize = pieces(frame).iter().map(Vec::len).sum();
    let of_view = Side::BOTH.len() * HALF_PLANES * ROWS.len() * stations;
    frame.asked_views().count() * of_view
}

/// For every edge what each of its asked views shows; image after image.
///
/// # Errors
/// If an image cannot be read.
pub(super) fn edge_samples(
    frames: &[Option<EdgeFrame>],
    scene: &Scene,
) -> Result<Vec<Vec<ViewSamples>>, SceneError> {
    let mut asks: Vec<Vec<(usize, f64)>> = scene.views.iter().map(|_| Vec::new()).collect();
    for (edge, frame) in frames.iter().enumerate() {
        for (view, azimuth) in frame.iter().flat_map(EdgeFrame::asked_views) {
            asks[view].push((edge, azimuth));
        }
    }
    let mut samples: Vec<Vec<ViewSamples>> = vec![Vec::new(); frames.len()];
    for (view, asked) in scene.views.iter().zip(&asks) {
        if asked.is_empty() {
            continue;
        }
        let pixels = view.image.read()?;
        let image = Image {
            rgb: pixels.as_raw(),
            size: view.image.dimensions(),
            pixel_center: scene.pixel_center,
            camera: &view.camera,
        };
        let found: Vec<(usize, ViewSamples)> = (asked.par_iter())
            .filter_map(|&(edge, azimuth)| {
                Some((edge, image.samples(frames[edge].as_ref()?, azimuth)))
            })
            .collect();
        for (edge, of_view) in found {
            samples[edge].push(of_view);
        }
    }
    Ok(samples)
}

/// The pixels of a view.
struct Image<'a> {
    /// Rows one after the other, three bytes a pixel.
    rgb: &'a [u8],
    size: (u32, u32),
    pixel_center: f64,
    camera: &'a Camera,
}

impl Image<'_> {
    fn samples(&self, frame: &EdgeFrame, azimuth: f64) -> ViewSamples {
        let pieces = pieces(frame);
        let mut strips = Vec::with_capacity(Side::BOTH.len() * HALF_PLANES * pieces.len());
        for side in Side::BOTH {
            for index in 0..HALF_PLANES {
                let seen = is_seen(side, index, azimuth);
                let pixel = seen.then(|| frame.pixel_into(side, index));
                strips.extend(pieces.iter().map(|stations| {
                    let strip = pixel.and_then(|pixel| self.strip(frame, &pixel, stations));
                    strip.unwrap_or_default()
                }));
            }
        }
        let stations: Vec<f64> = pieces.into_iter().flatten().collect();
        ViewSamples {
            strips,
            bands: self.bands(frame, &stations),
        }
    }

    /// The luminances of a strip, a pixel of which is this long; `None` if a part of it is out of
    /// the image.
    fn strip(&self, frame: &EdgeFrame, pixel: &Vector3<f64>, stations: &[f64]) -> Option<Vec<u8>> {
        let rows = ROWS
            .iter()
            .flat_map(|row| stations.iter().map(move |s| (row, s)));
        rows.map(|(row, station)| {
            let shown = self
                .camera
                .project(&(frame.segment.point_at(*station) + pixel * *row));
            let rgb = (shown.depth > 0.0).then(|| self.colour(&shown.pixel))??;
            Some(luminance(&rgb).round() as u8)
        })
        .collect()
    }

    /// `None` if more than half of a band is out of the image.
    fn bands(&self, frame: &EdgeFrame, stations: &[f64]) -> Option<Bands> {
        let (start, end) = (
            self.camera.project(&frame.segment.start),
            self.camera.project(&frame.segment.end),
        );
        if !(start.depth > 0.0 && end.depth > 0.0) {
            return None;
        }
        let along = (end.pixel - start.pixel).try_normalize(0.0)?;
        let left = Vector2::new(along.y, -along.x);
        let mean = |band: &[f64], sign: f64| {
            let places = band
                .iter()
                .flat_map(|row| stations.iter().map(move |s| (row, s)));
            let colours: Vec<[f64; 3]> = places
                .filter_map(|(row, station)| {
                    let on_edge = self.camera.project(&frame.segment.point_at(*station)).pixel;
                    self.colour(&(on_edge + left * (sign * row)))
                })
                .collect();
            let enough = 2 * colours.len() > band.len() * stations.len();
            let sum = |k: usize| colours.iter().map(|rgb| rgb[k]).sum::<f64>();
            enough.then(|| std::array::from_fn(|k| sum(k) / colours.len() as f64))
        };
        Some(Bands {
            left: mean(&SIDE_BAND, 1.0)?,
            centre: mean(&CENTRE_BAND, 1.0)?,
            right: mean(&SIDE_BAND, -1.0)?,
            near: [mean(&NEAR_BAND, 1.0)?, mean(&NEAR_BAND, -1.0)?],
        })
    }

    /// The colour at a point given in image coordinates, bilinear; `None` outside.
    fn colour(&self, point: &Vector2<f64>) -> Option<[f64; 3]> {
        let (width, height) = self.size;
        let (x, y) = (point.x - self.pixel_center, point.y - self.pixel_center);
        let within = |x: f64, size: u32| x >= 0.0 && x < f64::from(size) - 1.0;
        if !(within(x, width) && within(y, height)) {
            return None;
        }
        let (column, row) = (x as usize, y as usize);
        let (dx, dy) = (x.fract(), y.fract());
        let at = |i: usize, j: usize, k: usize| {
            f64::from(self.rgb[3 * ((row + j) * width as usize + column + i) + k])
        };
        let in_row = |j: usize, k: usize| at(0, j, k) * (1.0 - dx) + at(1, j, k) * dx;
        Some(std::array::from_fn(|k| {
            in_row(0, k) * (1.0 - dy) + in_row(1, k) * dy
        }))
    }
}

/// Rec. 601.
fn luminance([red, green, blue]: &[f64; 3]) -> f64 {
    0.299 * red + 0.587 * green + 0.114 * blue
}
