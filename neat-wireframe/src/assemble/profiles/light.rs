//! Profiles in light: what lens and pixels have added up.
//!
//! A photograph's file holds about the 2.4th root of light (sRGB): where the sides of an edge
//! differ much, its values change fastest on the darker side of the edge, up to half a pixel off.

use super::profile::{PLACES, Profile};
use nalgebra::{SVector, Vector2};

/// Darker values are noise and rounding, by which light is known no better.
const DARKEST: f64 = 6.0;

/// What files make of light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::assemble) struct Response {
    /// Light is this power of the value in the file.
    pub exponent: f64,
    /// Standard deviation of the blur in pixels.
    pub blur: f64,
}

/// A profile in light.
#[derive(Clone, Debug)]
pub(super) struct LightProfile<const N: usize> {
    pub view: usize,
    /// See [`Profile::along`].
    pub along: f64,
    /// See [`Profile::by_shift`].
    pub by_shift: Vector2<f64>,
    /// See [`Profile::by_step`].
    pub by_step: SVector<f64, N>,
    /// Each channel about its mean, in so large units that white is 255.
    pub light: [[f64; PLACES]; 3],
    /// How much a squared residual counts at each place: the square of how much values change by
    /// light there, the mean of the channels.
    pub weights: [f64; PLACES],
}

impl<const N: usize> LightProfile<N> {
    /// Of a file in which light is the `exponent`th power of values.
    pub(super) fn new(profile: &Profile<N>, exponent: f64) -> Self {
        let value = |k: usize, c: usize, least| f64::from(profile.values[k][c]).max(least) / 255.0;
        let channel = |c: usize| {
            let light: [f64; PLACES] =
                std::array::from_fn(|k| 255.0 * value(k, c, 0.0).powf(exponent));
            let mean = light.iter().sum::<f64>() / PLACES as f64;
            light.map(|light| light - mean)
        };
        let by_light = |k, c| value(k, c, DARKEST).powf(1.0 - exponent) / exponent;
        Self {
            view: profile.view,
            along: profile.along,
            by_shift: profile.by_shift,
            by_step: profile.by_step,
            light: std::array::from_fn(channel),
            weights: std::array::from_fn(|k| {
                (0..3).map(|c| by_light(k, c).powi(2)).sum::<f64>() / 3.0
            }),
        }
    }
}
