//! Learned detectors in ONNX files (feature `onnx`), run by `rten`.
//!
//! The contract of a model:
//! - one input of shape 1×3×H×W, 32-bit floats: red, green and blue in [0, 1]. Where
//!   H and W are fixed, the image is resized to them; otherwise it is given as it is.
//! - an output `lines` of shape N×4 (or 1×N×4, or N×2×2): x1, y1, x2, y2 in pixels of
//!   that input, pixel centres at integers. A single output may have any name.
//! - optionally an output `scores` of N numbers; segments up to
//!   [`OnnxDetector::MIN_SCORE`] are dropped.
//!
//! Segments are then fitted to the image and joined by
//! [`crate::wireframe_from_segments`], as those of any other detector.

use image::RgbImage;
use image::imageops::{FilterType, resize};
use nalgebra::Vector2;
use neat_core::{LineSegment2, SceneError, file};
use rten::{Dimension, Model, NodeId, Value};
use rten_tensor::{AsView, NdTensor};
use std::path::{Path, PathBuf};

/// A detector that was read from an ONNX file.
pub struct OnnxDetector {
    path: PathBuf,
    model: Model,
    input: NodeId,
    /// Width and height that the model asks for.
    size: Option<[u32; 2]>,
    lines: NodeId,
    scores: Option<NodeId>,
}

impl OnnxDetector {
    /// Segments need a higher score, where the model gives any.
    pub const MIN_SCORE: f32 = 0.05;

    /// Reads a model.
    ///
    /// # Errors
    /// If the file is missing or empty, `rten` cannot run it, or it does not follow
    /// the contract of this module.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        Self::from_bytes(
            file::read(path, "give the ONNX file of a line detector")?,
            path,
        )
    }

    /// [`Self::load`] from bytes; `path` is for messages.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn from_bytes(bytes: Vec<u8>, path: &Path) -> Result<Self, SceneError> {
        let malformed = |reason: String| SceneError::Malformed {
            path: path.into(),
            reason,
        };
        let model = runnable(bytes, path)?;
        let [input] = *model.input_ids() else {
            let count = model.input_ids().len();
            return Err(malformed(format!(
                "it has {count} inputs, expected one, 1×3×H×W"
            )));
        };
        let size = match model.input_shape(0).as_deref() {
            Some([_, Dimension::Fixed(channels), ..]) if *channels != 3 => {
                return Err(malformed(format!(
                    "its input has {channels} channels, expected 3"
                )));
            }
            Some([_, _, Dimension::Fixed(height), Dimension::Fixed(width)]) => {
                let [width, height] = [width, height].map(|&side| u32::try_from(side).unwrap_or(0));
                if width.min(height) == 0 || width.max(height) > MAX_SIDE {
                    return Err(malformed(format!(
                        "its input is for {width}×{height} pixels"
                    )));
                }
                Some([width, height])
            }
            Some([_, _, _, _]) | None => None,
            Some(shape) => {
                let axes = shape.len();
                return Err(malformed(format!(
                    "its input has {axes} axes, expected 1×3×H×W"
                )));
            }
        };
        let named = |name: &str| {
            let is_named =
                |id: &&NodeId| model.node_info(**id).and_then(|node| node.name()) == Some(name);
            model.output_ids().iter().find(is_named).copied()
        };
        let only = match *model.output_ids() {
            [only] => Some(only),
            _ => None,
        };
        let lines = (named("lines").or(only))
            .ok_or_else(|| malformed("none of its outputs is named `lines`".into()))?;
        let scores = named("scores");
        Ok(Self {
            path: path.into(),
            model,
            input,
            size,
            lines,
            scores,
        })
    }

    /// The segments that the model finds in `image`, in pixels of `image`.
    ///
    /// # Errors
    /// If the model fails, or its outputs do not follow the contract.
    pub fn segments(&self, image: &RgbImage) -> Result<Vec<LineSegment2>, SceneError> {
        let [width, height] = self.size.unwrap_or([image.width(), image.height()]);
        if image.width().min(image.height()) == 0 {
            return Ok(Vec::new());
        }
        let input = if image.dimensions() == (width, height) {
            planes(image)
        } else {
            planes(&resize(image, width, height, FilterType::Triangle))
        };
        let outputs: Vec<NodeId> = [self.lines].into_iter().chain(self.scores).collect();
        let values = (self.model)
            .run(vec![(self.input, input.into())], &outputs, None)
            .map_err(|error| self.malformed(format!("the model cannot be run ({error})")))?;
        let mut values = values.into_iter();
        let lines = self.numbers(values.next(), "lines")?;
        let scores = match self.scores {
            Some(_) => Some(self.numbers(values.next(), "scores")?),
            None => None,
        };
        let (rows, rest) = lines.as_chunks::<4>();
        if !rest.is_empty()
            || scores
                .as_ref()
                .is_some_and(|scores| scores.len() != rows.len())
        {
            return Err(self.malformed("`lines` is not N×4, or `scores` is not N".into()));
        }
        // Between the pixel centres of the two images.
        let factor = Vector2::new(
            f64::from(image.width()) / f64::from(width),
            f64::from(image.height()) / f64::from(height),
        );
        let end = |x: f32, y: f32| {
            let in_input = Vector2::new(f64::from(x), f64::from(y)).add_scalar(0.5);
            in_input.component_mul(&factor).add_scalar(-0.5)
        };
        let is_sure = |index: usize| {
            scores
                .as_ref()
                .is_none_or(|scores| scores[index] > Self::MIN_SCORE)
        };
        Ok((rows.iter().enumerate())
            .filter(|(index, row)| is_sure(*index) && row.iter().all(|value| value.is_finite()))
            .map(|(_, &[x1, y1, x2, y2])| LineSegment2::new(end(x1, y1), end(x2, y2)))
            .collect())
    }

    fn numbers(&self, value: Option<Value>, name: &str) -> Result<Vec<f32>, SceneError> {
        (value.and_then(Value::into_tensor::<f32>))
            .map(|tensor| tensor.to_vec())
            .ok_or_else(|| self.malformed(format!("its output `{name}` is not of 32-bit floats")))
    }

    fn malformed(&self, reason: String) -> SceneError {
        SceneError::Malformed {
            path: self.path.clone(),
            reason,
        }
    }
}

/// The longest side of a model's input, in pixels.
const MAX_SIDE: u32 = 1 << 14;

/// An image as a tensor of channels in [0, 1].
fn planes(image: &RgbImage) -> NdTensor<f32, 4> {
    let (width, height) = image.dimensions();
    let values: Vec<f32> = (0..3)
        .flat_map(|channel| image.as_raw().iter().skip(channel).step_by(3))
        .map(|&value| f32::from(value) / 255.0)
        .collect();
    NdTensor::from_data([1, 3, height as usize, width as usize], values)
}

/// A model as `rten` runs it; `path` is for messages.
pub(crate) fn runnable(bytes: Vec<u8>, path: &Path) -> Result<Model, SceneError> {
    Model::load(bytes).map_err(|error| SceneError::Malformed {
        path: path.into(),
        reason: format!("it is not an ONNX model that can be run ({error})"),
    })
}
