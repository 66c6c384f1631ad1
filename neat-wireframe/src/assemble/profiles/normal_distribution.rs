//! The normal distribution, read from a table: computed anew for each place of each profile, it
//! was a seventh of the time of a photographed house.

use std::f64::consts::{PI, SQRT_2};
use std::sync::LazyLock;

/// Beyond so many standard deviations it is 0 or 1, but for the last digit.
pub(super) const FLAT: f64 = 8.0;
/// Cells for each standard deviation: by its fourth derivative, 0.55 at most, a cubic is off by
/// 1.4e-9.
const CELLS: usize = 32;

/// Coefficients of the cubic over each cell, which has the distribution's values and slopes at
/// both ends.
static CUBICS: LazyLock<Vec<[f64; 4]>> = LazyLock::new(|| {
    let count = 2 * FLAT as usize * CELLS;
    let end = |cell: usize| {
        let z = cell as f64 / CELLS as f64 - FLAT;
        [exact(z), density(z) / CELLS as f64]
    };
    (0..count)
        .map(|cell| {
            let ([low, rise], [high, next_rise]) = (end(cell), end(cell + 1));
            let change = high - low;
            let square = 3.0 * change - 2.0 * rise - next_rise;
            [low, rise, square, rise + next_rise - 2.0 * change]
        })
        .collect()
});

/// The shares of the standard normal distribution below some places.
pub(super) fn shares_below<const N: usize>(places: [f64; N]) -> [f64; N] {
    let cubics = CUBICS.as_slice();
    places.map(|z| {
        let place = (z + FLAT) * CELLS as f64;
        // A cast saturates, and a place that is no number is as good as the first.
        let cell = place as usize;
        match cubics.get(cell) {
            _ if z <= -FLAT => 0.0,
            Some([a, b, c, d]) => {
                let t = place - cell as f64;
                a + t * (b + t * (c + t * d))
            }
            None => 1.0,
        }
    })
}

fn density(z: f64) -> f64 {
    (-0.5 * z * z).exp() / (2.0 * PI).sqrt()
}

fn exact(z: f64) -> f64 {
    0.5 * libm::erfc(-z / SQRT_2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_the_distribution() {
        for k in -9000..=9000 {
            let z = f64::from(k) * 1e-3 + 1e-4;
            let [share] = shares_below([z]);
            assert!((share - exact(z)).abs() < 2e-9, "{z}: {share}");
        }
        assert_eq!(
            shares_below([-1e300, -FLAT, FLAT, 1e300]),
            [0.0, 0.0, 1.0, 1.0]
        );
        assert!(shares_below([f64::NAN])[0].is_nan());
    }
}
