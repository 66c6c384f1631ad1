//! Whether what a line stands for is straight: chords of curves are no edges.
//!
//! The edgels of all views are asked for a bow in space over the line. Noise averages out
//! over hundreds of edgels, so a tenth of a pixel tells.

use super::edge_samples::Images;
use super::line_evidence::{LineEvidence, Showing};
use super::line_fitting::directions_across;
use super::projected_line::ProjectedLine;
use nalgebra::{SMatrix, SVector, Vector2};
use neat_core::LineSegment3;

/// Edgels of a bent edge lie farther from its chord than those of a straight one: within so
/// many reaches, and at least so many pixels.
const WIDE_REACH: f64 = 2.5;
const MIN_WIDE_REACH: f64 = 0.8;
/// The part of a line that is asked: beyond, edges run into others that meet them at a small
/// angle.
const INNER: [f64; 2] = [0.1, 0.9];
/// Fewer edgels tell nothing of a bow.
const MIN_OF_BOW: usize = 20;
/// A bow of so many standard deviations of an edgel, and of itself, is one …
const BOW_NOISES: f64 = 2.0;
const BOW_ERRORS: f64 = 3.0;
/// … if two halves of the views agree on its direction to this cosine: what lies beside an
/// edge in some views bends it there only.
const BOW_AGREEMENT: f64 = 0.8;
/// Edgels of a view are not independent: variances are so many times larger.
const CORRELATION: f64 = 4.0;

/// The height of the arc that edgels draw over a line.
#[derive(Clone, Copy)]
struct Bow {
    /// In two directions across the line, in pixels of the median view.
    height: Vector2<f64>,
    /// Standard deviation of its length.
    error: f64,
}

impl Bow {
    fn is_significant(&self, noise: f64) -> bool {
        let height = self.height.norm();
        height > BOW_NOISES * noise && height > BOW_ERRORS * self.error
    }

    fn agrees(&self, other: &Self) -> bool {
        self.height.dot(&other.height) > BOW_AGREEMENT * self.height.norm() * other.height.norm()
    }
}

/// How an edgel's distance from the line changes as a point of the line moves across it, and
/// the distance.
struct Row {
    place: f64,
    by_shift: Vector2<f64>,
    distance: f64,
}

impl Images<'_> {
    fn wide_reach(&self) -> f64 {
        (WIDE_REACH * self.reach).max(MIN_WIDE_REACH)
    }

    /// Whether edgels beside a line bend away from it in the middle, as those of an arc.
    /// `noise` is the standard deviation of an edgel, in pixels.
    pub(super) fn is_curved(
        &self,
        line: &LineSegment3,
        evidence: &LineEvidence,
        noise: f64,
    ) -> bool {
        let showing = &evidence.showing;
        let bow = |skip: usize, step: usize| {
            let bow = self.bow(line, showing.iter().skip(skip).step_by(step))?;
            bow.is_significant(noise).then_some(bow)
        };
        bow(0, 1).is_some()
            && Option::zip(bow(0, 2), bow(1, 2)).is_some_and(|(one, other)| one.agrees(&other))
    }

    fn rows(&self, line: &LineSegment3, showing: &Showing) -> Vec<Row> {
        let camera = &self.views[showing.view].camera;
        let prepared = directions_across(line)
            .zip(ProjectedLine::new(camera, line))
            .zip(self.samples(showing.view, line, INNER, None));
        let Some(((across, projected), samples)) = prepared else {
            return Vec::new();
        };
        (samples.points.iter())
            .filter_map(|(place, pixel)| {
                let edgel = self.edgel(showing.view, pixel, &samples.normal, self.wide_reach())?;
                let position = self.maps[showing.view].get(edgel).position.cast();
                let found = projected.distance_with_gradient(camera, &position);
                let [by_start, by_end] = found.by_points;
                Some(Row {
                    place: *place,
                    by_shift: across.tr_mul(&(by_start + by_end)),
                    distance: found.distance,
                })
            })
            .collect()
    }

    fn bow<'s>(
        &self,
        line: &LineSegment3,
        showing: impl Iterator<Item = &'s Showing> + Clone,
    ) -> Option<Bow> {
        let pixel = self.pixel_size(line, showing.clone().map(|s| s.view));
        // A shift, a tilt and a bow, each in two directions.
        let rows: Vec<(SVector<f64, 6>, f64)> = showing
            .flat_map(|showing| self.rows(line, showing))
            .map(|row| {
                let along = 2.0 * row.place - 1.0;
                let bend = 1.0 - along * along;
                let [x, y] = row.by_shift.into();
                let design = [x, y, x * along, y * along, x * bend, y * bend];
                (SVector::from(design), row.distance)
            })
            .collect();
        if rows.len() < MIN_OF_BOW {
            return None;
        }
        let (solution, covariance) = robust(&rows, 0.5 * self.wide_reach(), pixel)?;
        let height = solution.fixed_rows::<2>(4) / pixel;
        let direction = height.try_normalize(0.0).unwrap_or(Vector2::x());
        let variance = direction.dot(&(covariance.fixed_view::<2, 2>(4, 4) * direction));
        Some(Bow {
            height,
            error: (CORRELATION * variance).sqrt() / pixel,
        })
    }
}

/// Iteratively reweighted least squares with Cauchy's weights of this scale in pixels: the
/// parameters that take the distances away, and their covariance for independent rows.
fn robust<const N: usize>(
    rows: &[(SVector<f64, N>, f64)],
    scale: f64,
    pixel: f64,
) -> Option<(SVector<f64, N>, SMatrix<f64, N, N>)> {
    const ROUNDS: usize = 6;
    // A direction that no view tells of stays where it is.
    let ridge = 1e-6 * rows.len() as f64 / (pixel * pixel);
    let mut solution = SVector::<f64, N>::zeros();
    let mut covariance = SMatrix::<f64, N, N>::zeros();
    for _ in 0..ROUNDS {
        let mut hessian = SMatrix::<f64, N, N>::identity() * ridge;
        let mut gradient = SVector::<f64, N>::zeros();
        let (mut squares, mut weights) = (0.0, 0.0);
        for (row, distance) in rows {
            let residual = distance + row.dot(&solution);
            let weight = 1.0 / (1.0 + (residual / scale).powi(2));
            hessian += weight * row * row.transpose();
            gradient += weight * *distance * row;
            squares += weight * residual * residual;
            weights += weight;
        }
        let inverse = hessian.cholesky()?.inverse();
        solution = -(inverse * gradient);
        covariance = inverse * (squares / weights);
    }
    (solution.iter().all(|value| value.is_finite())).then_some((solution, covariance))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outliers_do_not_move_a_robust_solution() {
        let rows: Vec<(Vector2<f64>, f64)> = (0..60)
            .map(|k| {
                let angle = f64::from(k);
                let row = Vector2::new(angle.cos(), angle.sin());
                let distance = -row.dot(&Vector2::new(0.2, -0.1));
                (
                    row,
                    if k % 10 == 0 {
                        distance + 5.0
                    } else {
                        distance
                    },
                )
            })
            .collect();
        let (solution, covariance) = robust(&rows, 0.25, 10.0).unwrap();
        assert!(
            (solution - Vector2::new(0.2, -0.1)).norm() < 0.01,
            "{solution}"
        );
        assert!(covariance[(0, 0)] > 0.0 && covariance[(0, 0)] < 0.01);
    }
}
