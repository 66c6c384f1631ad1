//! Noise and blur.

use super::RgbImage;
use std::fmt;

/// What is done to an image before detection.
pub struct Degradation {
    /// Standard deviation of the Gaussian blur, in pixels.
    pub blur: f32,
    /// Standard deviation of the noise added after it, in grey levels.
    pub noise: f64,
}

impl Degradation {
    /// The rows of the table.
    pub const ALL: [Self; 6] = [
        Self {
            blur: 0.0,
            noise: 0.0,
        },
        Self {
            blur: 0.0,
            noise: 3.0,
        },
        Self {
            blur: 0.0,
            noise: 10.0,
        },
        Self {
            blur: 1.0,
            noise: 0.0,
        },
        Self {
            blur: 2.0,
            noise: 0.0,
        },
        Self {
            blur: 1.0,
            noise: 5.0,
        },
    ];

    /// The same image, degraded; `seed` decides the noise.
    pub fn apply(&self, image: &RgbImage, seed: u64) -> RgbImage {
        let mut degraded = if self.blur > 0.0 {
            image::imageops::blur(image, self.blur)
        } else {
            image.clone()
        };
        let mut state = seed;
        for value in degraded.iter_mut().filter(|_| self.noise > 0.0) {
            // The sum of twelve uniform numbers has variance 1.
            let gaussian = (0..12).map(|_| uniform(&mut state)).sum::<f64>() - 6.0;
            *value = (f64::from(*value) + self.noise * gaussian)
                .round()
                .clamp(0.0, 255.0) as u8;
        }
        degraded
    }
}

/// SplitMix64, as a number in [0, 1).
fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

impl fmt::Display for Degradation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "blur {} px, noise {}", self.blur, self.noise)
    }
}
