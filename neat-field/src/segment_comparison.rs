//! Rendered segments beside observed ones: the segment loss, and what junctions are
//! made of.
//!
//! [`compare_segments`] takes the loss where the ends lie: in tensor operations
//! ([`crate::segment_loss`]), or in one pass on the host where that holds the tensors
//! anyway ([`crate::host_segment_loss`]).

use crate::host_segment_loss::{HostSegmentLoss, ObservedSegment, host_segment_loss};
use crate::segment_loss::{SegmentLossConfig, segment_loss};
use burn::tensor::{Tensor, TensorData};
use neat_tensor::NeatBackend;
use neat_tensor::cameras::{RayCameras, project_calibrated};
use neat_tensor::host::host_vec;

/// Rendered segments beside observed ones.
#[derive(Clone, Debug)]
pub struct ComparedSegments {
    /// The segment loss, `[1]`.
    pub loss: Tensor<1>,
    /// One entry per ray.
    pub rays: Vec<ComparedRay>,
    /// The numbers of the tensor that was read with the ends.
    pub also: Option<Vec<f32>>,
}

/// One rendered segment beside the observed one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ComparedRay {
    /// Both rendered ends in the world.
    pub ends: [f32; 6],
    /// Mean error of the ends in pixels.
    pub error_in_pixels: f32,
    /// Whether the ray counts in the loss.
    pub counted: bool,
}

/// Compares rendered ends `[R, 6]` in the world, with the accumulated weights
/// `opacity` `[R, 1]` of their rays, with what was `observed`, one entry per ray.
///
/// `also` is read from the device in the same transfer as the ends.
pub fn compare_segments(
    backend: &dyn NeatBackend,
    ends: Tensor<2>,
    opacity: Tensor<2>,
    observed: &[ObservedSegment<'_>],
    config: SegmentLossConfig,
    also: Option<&Tensor<2>>,
) -> ComparedSegments {
    if backend.works_on_host() {
        let values = host_vec(ends.clone());
        let compared = host_segment_loss(&values, &host_vec(opacity), observed, config);
        ComparedSegments {
            loss: compared.of_ends(ends),
            rays: compared.rays(&values),
            also: also.map(|also| host_vec(also.clone())),
        }
    } else {
        compare_on_device(ends, opacity, observed, config, also)
    }
}

/// In tensor operations, with one transfer.
fn compare_on_device(
    ends: Tensor<2>,
    opacity: Tensor<2>,
    observed: &[ObservedSegment<'_>],
    config: SegmentLossConfig,
    also: Option<&Tensor<2>>,
) -> ComparedSegments {
    /// Ends, error, counted or not.
    const COLUMNS: usize = 8;
    let device = ends.device();
    let rows = observed.len();
    let cameras = RayCameras::new(observed.iter().map(|o| o.camera), &device);
    let matrix = |values: Vec<f32>, columns: usize| {
        Tensor::<2>::from_data(TensorData::new(values, [rows, columns]), &device)
    };
    let target = observed.iter().flat_map(|o| o.ends_calibrated).collect();
    let score = observed.iter().map(|o| o.score).collect();
    let loss = segment_loss(
        project_calibrated(ends.clone(), &cameras),
        matrix(target, 4),
        matrix(score, 1),
        opacity,
        &cameras,
        config,
    );
    let columns = vec![ends.detach(), loss.error_in_pixels, loss.counted];
    let flat = |t: Tensor<2>| {
        let count = t.shape().num_elements();
        t.detach().reshape([count])
    };
    let both = std::iter::once(Tensor::cat(columns, 1)).chain(also.cloned());
    let gathered = host_vec(Tensor::<1>::cat(both.map(flat).collect(), 0));
    let (rays, rest) = gathered.split_at(rows * COLUMNS);
    let rays = rays.chunks_exact(COLUMNS).map(|row| ComparedRay {
        ends: std::array::from_fn(|i| row[i]),
        error_in_pixels: row[6],
        counted: row[7] > 0.0,
    });
    ComparedSegments {
        loss: loss.loss,
        rays: rays.collect(),
        also: also.map(|_| rest.to_vec()),
    }
}

impl HostSegmentLoss {
    /// The loss `[1]` as a linear function of the `ends` `[R, 6]` that it was computed
    /// for: their gradient is the one that is known.
    fn of_ends(&self, ends: Tensor<2>) -> Tensor<1> {
        let linear = linear_in(ends, self.gradient.clone());
        let offset = self.loss - host_vec(linear.clone())[0];
        linear.add_scalar(offset)
    }

    /// One entry per ray; `ends` `[R · 6]` are those that were compared.
    pub fn rays(&self, ends: &[f32]) -> Vec<ComparedRay> {
        let of_rays = self.error_in_pixels.iter().zip(&self.counted);
        ends.chunks_exact(6)
            .zip(of_rays)
            .map(|(ends, (error, counted))| ComparedRay {
                ends: std::array::from_fn(|i| ends[i]),
                error_in_pixels: *error,
                counted: *counted,
            })
            .collect()
    }
}

/// A tensor `[1]` whose gradient with respect to `ends` is the given one.
pub fn linear_in(ends: Tensor<2>, gradient: Vec<f32>) -> Tensor<1> {
    let (shape, device) = (ends.dims(), ends.device());
    (ends * Tensor::from_data(TensorData::new(gradient, shape), &device)).sum()
}
