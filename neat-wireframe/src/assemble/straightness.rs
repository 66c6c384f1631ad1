//! Whether what a line stands for is straight: chords of curves are no edges, and a straight
//! edge that runs into an arc ends where it does.
//!
//! Between the ends of a line its edgels are asked for a displacement in space, at stations
//! along it or as a bow over all of it. Noise averages out over hundreds of edgels, so a
//! tenth of a pixel tells.

use super::edge_samples::Images;
use super::line_evidence::{LineEvidence, Showing};
use super::line_fitting::directions_across;
use super::projected_line::ProjectedLine;
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};
use neat_core::LineSegment3;

/// Edgels of a bent edge lie farther from its chord than those of a straight one: within so
/// many reaches, and at least so many pixels.
const WIDE_REACH: f64 = 2.5;
const MIN_WIDE_REACH: f64 = 0.8;
/// A station every so many pixels, within these bounds.
const PIXELS_PER_STATION: f64 = 6.0;
const STATIONS: [usize; 2] = [12, 96];
const SAMPLES_PER_STATION: usize = 3;
/// Fewer edgels tell nothing of a station, or of a bow.
const MIN_OF_STATION: usize = 6;
const MIN_OF_BOW: usize = 20;
/// Fewer stations tell nothing of a line.
const MIN_STATIONS: usize = 6;
/// Stations of a straight stretch lie this near to its line: so many standard deviations of
/// an edgel, and at least a tenth of a pixel, which lenses and renderers leave.
const STATION_NOISES: f64 = 1.2;
const MIN_STATION_TOLERANCE: f64 = 0.1;
/// A shorter straight stretch, as a share of the line, is one of a curve.
const MIN_STRAIGHT: f64 = 0.25;
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

    fn rows(&self, line: &LineSegment3, showing: &Showing, count: Option<usize>) -> Vec<Row> {
        let camera = &self.views[showing.view].camera;
        let prepared = directions_across(line)
            .zip(ProjectedLine::new(camera, line))
            .zip(self.samples(showing.view, line, [0.0, 1.0], count));
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
            .flat_map(|showing| self.rows(line, showing, None))
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
        let (solution, covariance) = robust(&rows, self.reach, pixel)?;
        let height = solution.fixed_rows::<2>(4) / pixel;
        let direction = height.try_normalize(0.0).unwrap_or(Vector2::x());
        let variance = direction.dot(&(covariance.fixed_view::<2, 2>(4, 4) * direction));
        Some(Bow {
            height,
            error: (CORRELATION * variance).sqrt() / pixel,
        })
    }

    /// The longest straight stretch of a line; the whole of it where too little is known,
    /// and `None` for one that is straight nowhere. `noise` is the standard deviation of an
    /// edgel, in pixels.
    pub(super) fn straight_stretch(
        &self,
        line: &LineSegment3,
        evidence: &LineEvidence,
        noise: f64,
    ) -> Option<LineSegment3> {
        let length = self.projected_length(line, evidence.views());
        let count = ((length / PIXELS_PER_STATION) as usize).clamp(STATIONS[0], STATIONS[1]);
        let mut rows: Vec<Vec<(Vector2<f64>, f64)>> = vec![Vec::new(); count];
        for showing in &evidence.showing {
            for row in self.rows(line, showing, Some(SAMPLES_PER_STATION * count)) {
                let station = ((row.place * count as f64) as usize).min(count - 1);
                rows[station].push((row.by_shift, row.distance));
            }
        }
        let pixel = self.pixel_size(line, evidence.views());
        let stations: Vec<Option<Vector2<f64>>> = (rows.iter())
            .map(|rows| {
                let known = rows.len() >= MIN_OF_STATION;
                let (shift, _) = known.then(|| robust(rows, self.reach, pixel))??;
                Some(shift / pixel)
            })
            .collect();
        if stations.iter().flatten().count() < MIN_STATIONS {
            return Some(*line);
        }
        let tolerance = (STATION_NOISES * noise).max(MIN_STATION_TOLERANCE);
        let [start, end] = longest_straight(&stations, tolerance);
        let place = |station: usize| station as f64 / count as f64;
        ((end - start) as f64 >= MIN_STRAIGHT * count as f64)
            .then(|| LineSegment3::new(line.point_at(place(start)), line.point_at(place(end))))
    }
}

/// Iteratively reweighted least squares: the parameters that take the distances away, and
/// their covariance for independent rows.
fn robust<const N: usize>(
    rows: &[(SVector<f64, N>, f64)],
    scale: f64,
    pixel: f64,
) -> Option<(SVector<f64, N>, SMatrix<f64, N, N>)> {
    const ROUNDS: usize = 6;
    // A direction that no view tells of stays: less than a hundredth of an edgel's weight.
    let ridge = 0.01 * rows.len() as f64 / (pixel * pixel);
    let mut solution = SVector::<f64, N>::zeros();
    let mut covariance = SMatrix::<f64, N, N>::zeros();
    for _ in 0..ROUNDS {
        let mut hessian = SMatrix::<f64, N, N>::identity() * ridge;
        let mut gradient = SVector::<f64, N>::zeros();
        let (mut squares, mut weights) = (0.0, 0.0);
        for (row, distance) in rows {
            let residual = distance + row.dot(&solution);
            let weight = 1.0 / (1.0 + (residual / (0.5 * scale)).powi(2));
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

/// The longest run of stations near one line, found by trying lines through pairs of them.
fn longest_straight(stations: &[Option<Vector2<f64>>], tolerance: f64) -> [usize; 2] {
    /// Stations tried as first and second of a pair, at most.
    const TRIED: usize = 16;
    let known: Vec<(usize, Vector2<f64>)> = (stations.iter().enumerate())
        .filter_map(|(k, station)| Some((k, (*station)?)))
        .collect();
    let step = (known.len() / TRIED).max(1);
    let apart = (known.len() / 5).max(1);
    let mut longest = [0, 0];
    for (n, (i, first)) in known.iter().enumerate().step_by(step) {
        for (j, second) in known.iter().skip(n + apart).step_by(step) {
            let slope = (second - first) / (*j as f64 - *i as f64);
            let fits = |k: usize| {
                let on_line = first + slope * (k as f64 - *i as f64);
                stations[k].is_none_or(|station| (station - on_line).norm() <= tolerance)
            };
            let mut start = 0;
            for k in 0..=stations.len() {
                if k == stations.len() || !fits(k) {
                    if k - start > longest[1] - longest[0] {
                        longest = [start, k];
                    }
                    start = k + 1;
                }
            }
        }
    }
    longest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_straight_part_ends_where_an_arc_begins() {
        let stations: Vec<_> = (0..40_i32)
            .map(|k| {
                let bent = f64::from((k - 29).max(0)).powi(2) * 0.05;
                let jitter = 0.02 * f64::from(k % 3 - 1);
                (k % 7 != 3).then(|| Vector2::new(0.3 - 0.01 * f64::from(k) + jitter, bent))
            })
            .collect();
        let [start, end] = longest_straight(&stations, 0.12);
        assert_eq!(start, 0);
        assert!((30..=33).contains(&end), "{end}");
        assert_eq!(longest_straight(&[None, None], 0.1), [0, 0]);
    }

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
        let (solution, covariance) = robust(&rows, 0.5, 10.0).unwrap();
        assert!(
            (solution - Vector2::new(0.2, -0.1)).norm() < 0.01,
            "{solution}"
        );
        assert!(covariance[(0, 0)] > 0.0 && covariance[(0, 0)] < 0.01);
    }
}
