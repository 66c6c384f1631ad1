//! Where, across a line, the colour changes fastest.

use crate::smoothed_image::SmoothedImage;
use nalgebra::{Vector2, Vector3};

/// Distance between the samples of a profile, in pixels.
const SPACING: f64 = 0.5;
/// Half of the longest profile, in samples.
const MAX_HALF: usize = 16;

/// The edge that a profile across a line crosses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct EdgePoint {
    /// Its distance from the middle of the profile along the normal, in pixels.
    pub offset: f64,
    /// The change of colour there along the normal, in grey levels per pixel.
    pub change: Vector3<f64>,
}

/// The strength of an edge with this change of colour: the root mean square over
/// the channels, so that for a grey edge it is the change of grey.
pub(crate) fn strength(change: &Vector3<f64>) -> f64 {
    change.norm() / 3f64.sqrt()
}

/// The colours across a line.
pub(crate) struct EdgeProfile {
    colors: [Vector3<f32>; 2 * (MAX_HALF + 2) + 1],
    /// Index of the middle sample.
    reach: usize,
}

impl EdgeProfile {
    /// The profile of `image` through `point` along the unit vector `normal`, of
    /// length 2 `half_width` in pixels. `None` at the image's border.
    pub(crate) fn sample(
        image: &SmoothedImage,
        point: &Vector2<f64>,
        normal: &Vector2<f64>,
        half_width: f64,
    ) -> Option<Self> {
        let half = ((half_width / SPACING).round() as usize).clamp(1, MAX_HALF);
        // One sample more on each side for the derivative, one for its maximum.
        let reach = half + 2;
        let ends = [-1.0, 1.0].map(|side| point + normal * (side * reach as f64 * SPACING));
        if !ends.iter().all(|end| image.contains(end)) {
            return None;
        }
        let mut colors = [Vector3::zeros(); 2 * (MAX_HALF + 2) + 1];
        for (i, color) in colors[..=2 * reach].iter_mut().enumerate() {
            *color = image.sample(&(ends[0] + normal * (i as f64 * SPACING)));
        }
        Some(Self { colors, reach })
    }

    /// The strongest change along the profile, whether or not it is a maximum.
    pub(crate) fn max_strength(&self) -> f64 {
        let colors = &self.colors[..=2 * self.reach];
        let changes = colors
            .windows(2)
            .map(|pair| (pair[1] - pair[0]) / SPACING as f32);
        changes
            .map(|change| strength(&change.cast()))
            .fold(0.0, f64::max)
    }

    /// The maximum of the colour's derivative; of several, a nearer one wins over
    /// a stronger one that is far off. With `contrast` only changes into that
    /// direction of the colour space count. `None` if there is no maximum.
    pub(crate) fn edge(&self, contrast: Option<&Vector3<f64>>) -> Option<EdgePoint> {
        let reach = self.reach;
        let change = |i: usize| (self.colors[i + 1] - self.colors[i - 1]) / (2.0 * SPACING as f32);
        let contrast = contrast.map(|contrast| contrast.cast::<f32>());
        let mut strengths = [0.0; 2 * (MAX_HALF + 2) + 1];
        for (i, strength) in strengths[..2 * reach].iter_mut().enumerate().skip(1) {
            *strength = match &contrast {
                Some(contrast) => change(i).dot(contrast),
                None => change(i).norm(),
            };
        }
        let nearness = |i: usize| {
            let distance = (i as f32 - reach as f32) / (reach - 2) as f32;
            1.0 / (1.0 + distance * distance)
        };
        let peak = (2..2 * reach - 1)
            .filter(|&i| strengths[i] > 0.0)
            .filter(|&i| strengths[i] >= strengths[i - 1] && strengths[i] > strengths[i + 1])
            .max_by(|&a, &b| {
                f32::total_cmp(&(strengths[a] * nearness(a)), &(strengths[b] * nearness(b)))
            })?;
        let [before, at, after] = [peak - 1, peak, peak + 1].map(|i| f64::from(strengths[i]));
        // The vertex of the parabola through the three, at most half a sample away.
        let shift = 0.5 * (before - after) / (before - 2.0 * at + after);
        Some(EdgePoint {
            offset: (peak as f64 - reach as f64 + shift) * SPACING,
            change: change(peak).cast(),
        })
    }
}
