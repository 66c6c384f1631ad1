//! Lines of M-LSD, a learned detector (feature `onnx`), run by `rten`.
//!
//! Gu et al., *Towards Light-weight and Real-time Line Segment Detection*, AAAI 2022. Its weights
//! do not come along: `scripts/fetch_mlsd.sh` fetches the ONNX model that is meant. It has
//! - one input of shape 1×S×S×4: red, green and blue from 0 to 255, and ones;
//! - an output `scores` of shape 1×H×H×1, where H is S / 2: for each cell how sure a line has its
//!   middle there, and 0 beside a surer one;
//! - an output `offsets` of shape 1×H×H×4: from the cell to the ends of that line, x1, y1, x2, y2,
//!   in cells.
//!
//! What it sees is true to a pixel or two of its input, so its lines are hints:
//! [`crate::detect_with_hints`] fits them to the image.

use crate::onnx::runnable;
use image::RgbImage;
use image::imageops::{FilterType, resize};
use nalgebra::Vector2;
use neat_core::{LineSegment2, SceneError, file};
use rten::{Dimension, Model, NodeId, RunOptions, ThreadPool, Value};
use rten_tensor::{AsView, NdTensor};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Input pixels of a cell, along each side.
const CELL: usize = 2;
/// Lines that are less sure are none. The authors' value.
const MIN_SCORE: f32 = 0.1;
/// Shorter lines are none, in pixels of the input. The authors take 20, where lines are a result
/// and not hints.
const MIN_LENGTH: f64 = 10.0;
/// The longest side of a model's input, in pixels.
const MAX_SIDE: usize = 1 << 12;

/// M-LSD with its weights.
pub struct Mlsd {
    path: PathBuf,
    model: Model,
    input: NodeId,
    /// Side of its input, in pixels.
    side: usize,
    scores: NodeId,
    offsets: NodeId,
    /// As many threads as rayon has here: by itself `rten` takes all of the machine.
    threads: Arc<ThreadPool>,
}

impl Mlsd {
    /// The name of the file of weights.
    pub const FILE_NAME: &str = "mlsd_512x512_large.onnx";

    /// Reads the weights.
    ///
    /// # Errors
    /// If the file is missing or empty, `rten` cannot run it, or it is another model.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        let bytes = file::read(path, "scripts/fetch_mlsd.sh fetches the weights of M-LSD")?;
        Self::from_bytes(bytes, path)
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
        let side = match (model.input_ids().len(), model.input_shape(0).as_deref()) {
            (
                1,
                Some(
                    [
                        _,
                        Dimension::Fixed(height),
                        Dimension::Fixed(width),
                        Dimension::Fixed(4),
                    ],
                ),
            ) if height == width && (CELL..=MAX_SIDE).contains(width) => *width,
            _ => {
                return Err(malformed(
                    "its input is not that of M-LSD, 1×S×S×4".to_owned(),
                ));
            }
        };
        let output = |name: &str| {
            let is_named =
                |id: &&NodeId| model.node_info(**id).and_then(|node| node.name()) == Some(name);
            let found = model.output_ids().iter().find(is_named).copied();
            found.ok_or_else(|| malformed(format!("none of its outputs is named `{name}`")))
        };
        let (scores, offsets) = (output("scores")?, output("offsets")?);
        Ok(Self {
            path: path.into(),
            input: model.input_ids()[0],
            side,
            scores,
            offsets,
            model,
            threads: Arc::new(ThreadPool::with_num_threads(rayon::current_num_threads())),
        })
    }

    /// The lines that it sees in `image`, in pixels of `image`, pixel centres at integers.
    ///
    /// The image is scaled to the model's square, as its authors do. Squares of the image's
    /// height side by side were tried: twice the time for what comes out the same in 3D.
    ///
    /// # Errors
    /// If the model cannot be run, or has other outputs.
    pub fn lines(&self, image: &RgbImage) -> Result<Vec<LineSegment2>, SceneError> {
        if image.width().min(image.height()) == 0 {
            return Ok(Vec::new());
        }
        let input = self.input_of(image);
        let outputs = [self.scores, self.offsets];
        let options = RunOptions::default().with_thread_pool(Some(self.threads.clone()));
        let values = (self.model)
            .run(vec![(self.input, input.into())], &outputs, Some(options))
            .map_err(|error| self.malformed(format!("the model cannot be run ({error})")))?;
        let [scores, offsets] = <[Value; 2]>::try_from(values)
            .map_err(|_| self.malformed("it has other outputs".to_owned()))?
            .map(|value| value.into_tensor::<f32>().map(|tensor| tensor.to_vec()));
        let cells = self.side / CELL;
        let (Some(scores), Some(offsets)) = (scores, offsets) else {
            return Err(self.malformed("its outputs are not of 32-bit floats".to_owned()));
        };
        let (ends, rest) = offsets.as_chunks::<4>();
        if scores.len() != cells * cells || ends.len() != scores.len() || !rest.is_empty() {
            return Err(self.malformed(format!(
                "`scores` is not {cells}×{cells}×1, or `offsets` not {cells}×{cells}×4"
            )));
        }
        let (width, height) = image.dimensions();
        let image_from_input = Vector2::new(width, height).map(f64::from) / self.side as f64;
        let line = |index: usize| {
            let cell = Vector2::new((index % cells) as f64, (index / cells) as f64);
            let end = |x: f32, y: f32| (cell + Vector2::new(x.into(), y.into())) * CELL as f64;
            let [x1, y1, x2, y2] = ends[index];
            LineSegment2::new(end(x1, y1), end(x2, y2))
        };
        Ok((0..scores.len())
            .filter(|&index| scores[index] >= MIN_SCORE)
            .map(line)
            .filter(|line| line.length().is_finite() && line.length() >= MIN_LENGTH)
            .map(|line| line.map(|end| end.component_mul(&image_from_input)))
            .collect())
    }

    /// An image as the model wants it.
    fn input_of(&self, image: &RgbImage) -> NdTensor<f32, 4> {
        let side = self.side;
        let scaled = resize(image, side as u32, side as u32, FilterType::Triangle);
        let values: Vec<f32> = (scaled.pixels())
            .flat_map(|pixel| {
                let [red, green, blue] = pixel.0.map(f32::from);
                [red, green, blue, 1.0]
            })
            .collect();
        NdTensor::from_data([1, side, side, 4], values)
    }

    fn malformed(&self, reason: String) -> SceneError {
        SceneError::Malformed {
            path: self.path.clone(),
            reason,
        }
    }
}
