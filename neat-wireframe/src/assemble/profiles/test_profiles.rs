//! Profiles of known steps, for the unit tests of what explains them.

use super::curve::{Curve, Step};
use super::light::{LightProfile, Response};
use super::profile::{PLACES, Profile};
use super::step_model::step_column;
use super::straight::Straight;
use crate::test_scenes::Noise;
use nalgebra::{Vector2, Vector3};
use neat_core::LineSegment3;

/// Pixels by a unit of length where a line is seen from straight in front.
pub(super) const PIXELS: f64 = 100.0;

/// Steps in space whose heights differ from view to view, where these see four parts of a line.
pub(super) struct Steps {
    /// Each with the heights of its channels, at most.
    pub steps: Vec<(Step<4>, [f64; 3])>,
    pub response: Response,
    /// Values differ by at most so much from what they should be.
    pub noise: f64,
}

/// A line along z, of which steps along x and y are seen.
pub(super) fn line_along_z() -> Straight {
    Straight::new(&LineSegment3::new(Vector3::zeros(), Vector3::z())).unwrap()
}

impl Steps {
    pub(super) fn profiles(&self, views: usize) -> Vec<Profile<4>> {
        let line = line_along_z();
        let mut noise = Noise(7);
        let mut profiles = Vec::new();
        for view in 0..views {
            // All from one side: steps are in the same order.
            let (sin, cos) = (1.2 * view as f64 / views as f64 - 0.6).sin_cos();
            let brightness = 0.7 + 0.3 * noise.uniform();
            for along in [-0.375, -0.125, 0.125, 0.375] {
                let by_shift = Vector2::new(cos, sin) * PIXELS;
                let by_step = line.shift_by_step(along).tr_mul(&by_shift);
                let mut light = [[12.0; 3]; PLACES];
                for (step, heights) in &self.steps {
                    let offset = by_step.dot(step);
                    let column = step_column(offset, self.response.blur);
                    for (light, share) in light.iter_mut().zip(column) {
                        for (light, height) in light.iter_mut().zip(heights) {
                            *light += brightness * height * share;
                        }
                    }
                }
                let exponent = self.response.exponent;
                let mut value = |light: f64| {
                    let value = 255.0 * (light / 255.0).powf(exponent.recip());
                    (value + self.noise * noise.uniform()) as f32
                };
                profiles.push(Profile {
                    view,
                    along: line.along(along),
                    by_shift,
                    by_step,
                    values: light.map(|light| light.map(&mut value)),
                });
            }
        }
        profiles
    }

    pub(super) fn in_light(&self, views: usize) -> Vec<LightProfile<4>> {
        let exponent = self.response.exponent;
        (self.profiles(views).iter())
            .map(|profile| LightProfile::new(profile, exponent))
            .collect()
    }
}
