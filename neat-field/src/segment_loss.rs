//! The segment loss (paper eq. 5) as the published code computes it: the order
//! of the ends by squared distance, the mean absolute difference in calibrated
//! coordinates, weighted by the detector's score, with a cut-off in pixels.

use burn::tensor::Tensor;
use neat_tensor::cameras::{RayCameras, calibrated_difference_in_pixels};

/// How rays are counted in the segment loss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentLossConfig {
    /// Rays whose mean pixel error reaches this do not count.
    pub cutoff_in_pixels: f64,
    /// Rays whose accumulated weight is not above this do not count.
    pub min_opacity: Option<f64>,
    /// Divide by all rays (published) instead of those that count.
    pub mean_over_all_rays: bool,
}

/// The loss and what later steps need of its inside.
#[derive(Clone, Debug)]
pub struct SegmentLoss {
    /// The loss, `[1]`.
    pub loss: Tensor<1>,
    /// Mean pixel error per ray, `[R, 1]`, without gradient.
    pub error_in_pixels: Tensor<2>,
    /// 1 for the rays that count, `[R, 1]`, without gradient.
    pub counted: Tensor<2>,
    /// Target ends in the order used, calibrated `[R, 4]`.
    pub target: Tensor<2>,
}

/// Compares projected segments with the observed ones.
///
/// `projected` and `observed` are calibrated `[R, 4]`, `score` is `[R, 1]`,
/// `opacity` the accumulated weight `[R, 1]`.
pub fn segment_loss(
    projected: Tensor<2>,
    observed: Tensor<2>,
    score: Tensor<2>,
    opacity: Tensor<2>,
    cameras: &RayCameras,
    config: SegmentLossConfig,
) -> SegmentLoss {
    let rays = projected.dims()[0];
    let swapped = Tensor::cat(
        vec![
            observed.clone().narrow(1, 2, 2),
            observed.clone().narrow(1, 0, 2),
        ],
        1,
    );
    let fixed = projected.clone().detach();
    let squared = |target: &Tensor<2>| {
        calibrated_difference_in_pixels(fixed.clone() - target.clone(), cameras)
            .square()
            .sum_dim(1)
    };
    // Ties take the swapped order, as published.
    let keep = squared(&observed).lower(squared(&swapped));
    let target = swapped.mask_where(keep.expand([rays, 4]), observed);

    let error_in_pixels = calibrated_difference_in_pixels(fixed - target.clone(), cameras)
        .abs()
        .mean_dim(1);
    let mut counts = error_in_pixels.clone().lower_elem(config.cutoff_in_pixels);
    if let Some(min_opacity) = config.min_opacity {
        counts = counts.bool_and(opacity.detach().greater_elem(min_opacity));
    }
    // Filled, not converted: a conversion would forget the precision.
    let counted = error_in_pixels.zeros_like().mask_fill(counts, 1.0);
    let denominator = if config.mean_over_all_rays {
        Tensor::full_like(&counted.clone().sum(), rays as f64)
    } else {
        counted.clone().sum()
    };
    let per_ray = (projected - target.clone()).abs().mean_dim(1);
    let loss = (per_ray * score * counted.clone()).sum() / denominator.clamp_min(1.0);
    SegmentLoss {
        loss,
        error_in_pixels,
        counted,
        target,
    }
}
