//! What is detected in an image.

use crate::arrays::{read_only, rgb_image, rows};
use crate::background;
use crate::errors::Failure;
use crate::settings;
use nalgebra::Vector2;
use neat_core::{LineSegment2, Wireframe2d};
use neat_detect::{detect as detect_in, wireframe_from_segments};
use neat_pipeline::config::{Preset, apply_overrides};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use std::sync::Arc;

/// Image coordinates of the centre of the first pixel: the corner of the image is the origin.
pub const PIXEL_CENTER: f64 = 0.5;

/// The 2D wireframe of an image: segments with scores, whose ends are shared vertices.
///
/// Coordinates are pixels, x to the right and y down, from the image's upper left corner: the
/// centre of the first pixel is (0.5, 0.5).
#[pyclass(frozen, module = "neat3d")]
pub struct Segments {
    pub wireframe: Arc<Wireframe2d>,
}

#[pymethods]
impl Segments {
    /// Ends of the segments (E, 4): x, y, x, y in pixels.
    #[getter]
    fn ends<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let vertices = &self.wireframe.vertices;
        let ends = self.wireframe.edges.iter().flatten();
        let values = ends
            .flat_map(|vertex| <[f64; 2]>::from(vertices[*vertex]))
            .collect();
        read_only(py, (self.wireframe.edges.len(), 4), values)
    }

    /// Confidence of every segment (E,), from 0 to 1.
    #[getter]
    fn scores<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let scores = self.wireframe.edge_scores.clone();
        read_only(py, scores.len(), scores)
    }

    /// Vertices that segments share (V, 2): x, y in pixels.
    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let vertices = &self.wireframe.vertices;
        let values = vertices.iter().flat_map(|v| [v.x, v.y]).collect();
        read_only(py, (vertices.len(), 2), values)
    }

    /// The two vertices of every segment (E, 2), as indices.
    #[getter]
    fn edges<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<i64>> {
        let edges = &self.wireframe.edges;
        let values = edges.iter().flatten().map(|i| *i as i64).collect();
        read_only(py, (edges.len(), 2), values)
    }

    fn __len__(&self) -> usize {
        self.wireframe.edges.len()
    }

    fn __repr__(&self) -> String {
        let Wireframe2d { width, height, .. } = *self.wireframe;
        let (segments, vertices) = (self.__len__(), self.wireframe.vertices.len());
        format!(
            "<neat3d.Segments: {segments} segments of {vertices} vertices in {width}×{height} pixels>"
        )
    }
}

/// Detects the 2D wireframe of an image.
///
/// image: (height, width, 3) uint8, red first. settings: of the detector, as a dict such as
/// {"min_length": 12} or a list of "key=value"; lengths are pixels of an image of 512 by 512
/// and follow the size of yours. segments: (N, 4) x, y, x, y in pixels, of another
/// detector: they are fitted to the image and joined like neat's own.
#[pyfunction]
#[pyo3(signature = (image, settings=None, *, segments=None, threads=None))]
pub fn detect(
    image: &Bound<'_, PyAny>,
    settings: Option<&Bound<'_, PyAny>>,
    segments: Option<&Bound<'_, PyAny>>,
    threads: Option<usize>,
) -> PyResult<Segments> {
    let py = image.py();
    let image = rgb_image(image, "image")?;
    let settings: Vec<String> = (settings::overrides(settings)?.iter())
        .map(|set| format!("detect.{}", set.strip_prefix("detect.").unwrap_or(set)))
        .collect();
    let config = apply_overrides(&Preset::default().config(), &settings);
    let config = config.map_err(Failure::from)?.detect;
    config.validate().map_err(Failure::input)?;
    let given = segments.map(|all| rows::<4>(all, "segments")).transpose()?;
    let wireframe = background::run(py, threads, move || {
        // The detector has pixel centres at integers.
        let mut wireframe = match given {
            None => detect_in(&image, &config),
            Some(segments) => {
                let shifted = |x, y| Vector2::new(x, y).add_scalar(-PIXEL_CENTER);
                let segments: Vec<LineSegment2> = (segments.into_iter())
                    .map(|[a, b, c, d]| LineSegment2::new(shifted(a, b), shifted(c, d)))
                    .collect();
                wireframe_from_segments(&image, &segments, &config)
            }
        };
        for vertex in &mut wireframe.vertices {
            *vertex = vertex.add_scalar(PIXEL_CENTER);
        }
        Ok(wireframe)
    })?;
    Ok(Segments {
        wireframe: wireframe.into(),
    })
}

/// Ends and scores of (N, 4) or (N, 5) numbers.
fn scored_segments(object: &Bound<'_, PyAny>) -> PyResult<Vec<([Vector2<f64>; 2], f64)>> {
    let ends = |x0, y0, x1, y1| [Vector2::new(x0, y0), Vector2::new(x1, y1)];
    if let Ok(rows) = rows::<5>(object, "segments") {
        return Ok(rows
            .into_iter()
            .map(|[a, b, c, d, score]| (ends(a, b, c, d), score))
            .collect());
    }
    let rows = rows::<4>(object, "segments")?;
    Ok(rows
        .into_iter()
        .map(|[a, b, c, d]| (ends(a, b, c, d), 1.0))
        .collect())
}

/// The 2D wireframe of one view as it was given: what `detect` returned, or segments, each
/// with two vertices of its own.
pub fn given(object: &Bound<'_, PyAny>, (width, height): (u32, u32)) -> PyResult<Wireframe2d> {
    if let Ok(segments) = object.cast::<Segments>() {
        return Ok(Wireframe2d::clone(&segments.get().wireframe));
    }
    let mut wireframe = Wireframe2d::empty(width, height);
    for (index, (ends, score)) in scored_segments(object)?.into_iter().enumerate() {
        wireframe.vertices.extend(ends);
        wireframe.vertex_scores.extend([score; 2]);
        wireframe.edges.push([2 * index, 2 * index + 1]);
        wireframe.edge_scores.push(score);
    }
    Ok(wireframe)
}
