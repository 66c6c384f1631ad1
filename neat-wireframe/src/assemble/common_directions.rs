//! Lines that run in the same direction: of what people build most edges do.
//!
//! How deep the ends of a line lie is known much worse than where they are in the images, most of
//! all where cameras move along it: a lintel that is seen from the street turns by degrees. All
//! lintels together tell their direction to a hundredth of one.
//!
//! A direction is worth, in nats, what is more likely with it than without. Of N lines a share π
//! runs in it, turned off it by δ in both directions across: normal, with the covariance Σ by
//! which images know a line's direction and the scatter τ² that real walls have. The others run
//! anywhere on the half sphere:
//!
//! Σ ln(1 − π + π · 2π N(δ; 0, Σ + τ²)),
//!
//! less what it takes to say which it is: two numbers to their σ. Each line then turns to its
//! mean over all directions and none, by what images leave open.

use super::edge_samples::Images;
use super::line_selection::ChosenLine;
use nalgebra::{Matrix2, Matrix2x4, Matrix3, Matrix3x2, Matrix4, Vector2, Vector3, Vector4};
use neat_core::LineSegment3;
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Squared distance in standard deviations up to which a line may run in a direction: exceeded by
/// one of a thousand (chi-square of two degrees of freedom).
const CHI_SQUARE: f64 = 13.8;
/// The scatter is one of these, in radians, the likeliest: none in drawings, milliradians where
/// masons worked. What is off by more is another direction.
const SCATTERS: [f64; 8] = [0.0, 2e-4, 4e-4, 8e-4, 1.6e-3, 3.2e-3, 6.4e-3, 1.28e-2];
/// Which lines run in a direction is asked anew so often.
const ROUNDS: usize = 4;
/// Cosine of about 25°: lines at larger angles do not run in a direction, however little is known
/// of theirs.
const MIN_COSINE: f64 = 0.9;
/// What edgels leave open is no wider than this times what they know best: numbers stay finite.
const OPEN: f64 = 1e-6;

/// Turns lines to the directions that many have. How many directions there are.
pub(super) fn turn_to_common_directions(
    images: &Images,
    noise: f64,
    lines: &mut [ChosenLine],
) -> usize {
    let measured: Vec<Option<Measured>> = (lines.par_iter())
        .map(|chosen| Measured::new(images, noise, chosen))
        .collect();
    let known: Vec<&Measured> = measured.iter().flatten().collect();
    let directions = common_directions(&known);
    (lines.par_iter_mut().zip(&measured)).for_each(|(chosen, measured)| {
        if let Some(measured) = measured {
            chosen.line = measured.turned(&directions);
        }
    });
    directions.len()
}

/// A line, and how well images know it.
struct Measured {
    line: LineSegment3,
    direction: Vector3<f64>,
    /// Two unit vectors perpendicular to the line and each other.
    across: Matrix3x2<f64>,
    /// Of the places of its start and its end along both.
    covariance: Matrix4<f64>,
    /// The angles by which it turns as its ends move.
    turn: Matrix2x4<f64>,
    /// Of these angles.
    covariance_of_turn: Matrix2<f64>,
}

/// A direction that several lines have.
struct CommonDirection {
    direction: Vector3<f64>,
    /// Variance of the angles by which lines are truly off it.
    scatter: f64,
    /// Of all lines.
    share: f64,
}

/// How a line lies to a direction.
struct Deviation {
    /// The angles by which it would have to turn.
    angles: Vector2<f64>,
    /// The inverse of their covariance.
    information: Matrix2<f64>,
    /// In standard deviations.
    squared: f64,
    /// Logarithm of how much likelier these angles are than anywhere.
    log_ratio: f64,
}

impl Measured {
    /// `None` where edgels do not say where the line is.
    fn new(images: &Images, noise: f64, chosen: &ChosenLine) -> Option<Self> {
        let line = chosen.line;
        let (across, information) = images.information(&line, chosen.evidence.views())?;
        let kept = Matrix4::identity() * (OPEN * information.trace());
        let covariance = (information + kept).cholesky()?.inverse() * noise.powi(2);
        Some(Self::with_covariance(line, across, covariance))
    }

    fn with_covariance(
        line: LineSegment3,
        across: Matrix3x2<f64>,
        covariance: Matrix4<f64>,
    ) -> Self {
        let per_length = line.length().recip();
        let turn = Matrix2x4::new(-1.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 1.0) * per_length;
        Self {
            line,
            direction: (line.end - line.start) * per_length,
            across,
            covariance,
            turn,
            covariance_of_turn: turn * covariance * turn.transpose(),
        }
    }

    /// `None` where the line surely runs elsewhere.
    fn deviation(&self, direction: &Vector3<f64>, scatter: f64) -> Option<Deviation> {
        let cosine = self.direction.dot(direction);
        if cosine.abs() < MIN_COSINE {
            return None;
        }
        let angles = self.across.tr_mul(direction) / cosine;
        let covariance = self.covariance_of_turn + Matrix2::identity() * scatter;
        let information = covariance.try_inverse()?;
        let squared = angles.dot(&(information * angles));
        (squared <= CHI_SQUARE).then_some(Deviation {
            angles,
            information,
            squared,
            // The density's 2π is the area of the half sphere.
            log_ratio: -0.5 * (covariance.determinant().ln() + squared),
        })
    }

    /// The line in its mean direction, moved by what images leave open.
    fn turned(&self, directions: &[CommonDirection]) -> LineSegment3 {
        let shares: f64 = directions.iter().map(|common| common.share).sum();
        let (mut all, mut step) = (1.0 - shares, Vector4::zeros());
        for common in directions {
            if let Some(deviation) = self.deviation(&common.direction, common.scatter) {
                let weight = common.share * deviation.log_ratio.exp();
                let asked = self.turn.transpose() * (deviation.information * deviation.angles);
                step += self.covariance * asked * weight;
                all += weight;
            }
        }
        let [start, end] = [0, 2].map(|k| self.across * step.fixed_rows::<2>(k) / all);
        LineSegment3::new(self.line.start + start, self.line.end + end)
    }
}

/// The directions that are worth more than they cost, each of lines that no other before it has,
/// the one that is worth most first.
fn common_directions(lines: &[&Measured]) -> Vec<CommonDirection> {
    let mut open = vec![true; lines.len()];
    // Numbers above 0 are in the order of their bits.
    let proposal = |gain: f64, line: usize| (gain > 0.0).then_some((gain.to_bits(), Reverse(line)));
    let worth = |open: &[bool], line: usize| gain(lines, open, &lines[line].direction, 0.0);
    let proposals: Vec<(u64, Reverse<usize>)> = (0..lines.len())
        .into_par_iter()
        .filter_map(|line| proposal(worth(&open, line), line))
        .collect();
    let mut queue = BinaryHeap::from(proposals);
    let mut directions = Vec::new();
    while let Some((_, Reverse(line))) = queue.pop() {
        // Gains fall as others take lines.
        let now = proposal(worth(&open, line), line);
        let is_first = |now: &(u64, Reverse<usize>)| queue.peek().is_none_or(|next| next <= now);
        if !now.as_ref().is_some_and(is_first) {
            queue.extend(now);
            continue;
        }
        let (direction, scatter) = fitted(lines, &open, lines[line].direction);
        if gain(lines, &open, &direction, scatter) <= 0.0 {
            continue;
        }
        let mut count = 0;
        for (line, open) in lines.iter().zip(&mut open) {
            if *open && line.deviation(&direction, scatter).is_some() {
                *open = false;
                count += 1;
            }
        }
        directions.push(CommonDirection {
            direction,
            scatter,
            // One more line has none, so that nothing is impossible.
            share: f64::from(count) / (lines.len() + 1) as f64,
        });
    }
    directions
}

/// Deviations of the open lines that may run in a direction.
fn members<'a>(
    lines: &'a [&Measured],
    open: &'a [bool],
    direction: &'a Vector3<f64>,
    scatter: f64,
) -> impl Iterator<Item = (&'a Measured, Deviation)> {
    let open = lines.iter().zip(open).filter(|(_, open)| **open);
    open.filter_map(move |(line, _)| Some((*line, line.deviation(direction, scatter)?)))
}

/// What a direction explains more than it costs, in nats.
fn gain(lines: &[&Measured], open: &[bool], direction: &Vector3<f64>, scatter: f64) -> f64 {
    let members = members(lines, open, direction, scatter);
    let ratios: Vec<(f64, f64)> = members.map(|(_, d)| (d.log_ratio, d.squared)).collect();
    if ratios.is_empty() {
        return 0.0;
    }
    let (count, all) = (
        ratios.len() as f64,
        open.iter().filter(|open| **open).count() as f64,
    );
    let share = count / (all + 1.0);
    let explained: f64 = (ratios.iter())
        .map(|(log_ratio, _)| (1.0 - share + share * log_ratio.exp()).ln())
        .sum();
    // Its two numbers are known as well as those of its lines are in the mean.
    let cost = ratios
        .iter()
        .map(|(log_ratio, squared)| log_ratio + 0.5 * squared);
    explained + (all - count) * (1.0 - share).ln() - cost.sum::<f64>() / count
}

/// The direction of the open lines near it, and their scatter.
fn fitted(lines: &[&Measured], open: &[bool], near: Vector3<f64>) -> (Vector3<f64>, f64) {
    let (mut direction, mut scatter) = (near, 0.0);
    for _ in 0..ROUNDS {
        // They run in it if nothing of it lies across them.
        let mut across = Matrix3::zeros();
        for (line, deviation) in members(lines, open, &direction, scatter) {
            across += line.across * deviation.information * line.across.transpose();
        }
        let eigen = across.symmetric_eigen();
        let least = eigen.eigenvectors.column(eigen.eigenvalues.imin());
        direction = least * least.dot(&direction).signum();
        let worth = |variance: f64| gain(lines, open, &direction, variance);
        scatter = (SCATTERS.map(|angle| angle * angle).into_iter())
            .max_by(|a, b| worth(*a).total_cmp(&worth(*b)))
            .unwrap_or_default();
    }
    (direction, scatter)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::line_fitting::directions_across;
    use crate::test_scenes::Noise;

    /// Known across the sight to 1e-4, along it, which is y, to 0.01.
    const SIGMAS: [f64; 2] = [1e-4, 0.01];

    /// A line of length 1 as it is measured.
    fn measured(direction: Vector3<f64>, noise: &mut Noise) -> Measured {
        let start = noise.vector();
        let line = LineSegment3::new(start, start + direction.normalize());
        // The sum of three uniform numbers has variance 1.
        let mut off = || {
            let [x, y, z] = [SIGMAS[0], SIGMAS[1], SIGMAS[0]].map(|s| s * noise.vector().sum());
            Vector3::new(x, y, z)
        };
        let moved = LineSegment3::new(line.start + off(), line.end + off());
        let across = directions_across(&moved).unwrap();
        let squares = Vector3::new(SIGMAS[0], SIGMAS[1], SIGMAS[0]).map(|s| s * s);
        let of_end = across.transpose() * Matrix3::from_diagonal(&squares) * across;
        let mut covariance = Matrix4::zeros();
        for k in [0, 2] {
            covariance.fixed_view_mut::<2, 2>(k, k).copy_from(&of_end);
        }
        Measured::with_covariance(moved, across, covariance)
    }

    fn sine(line: &LineSegment3, direction: &Vector3<f64>) -> f64 {
        (line.end - line.start).normalize().cross(direction).norm()
    }

    #[test]
    fn lines_turn_to_the_direction_of_many_by_what_images_leave_open() {
        let mut noise = Noise(1);
        let mut lines: Vec<Measured> = (0..40)
            .map(|_| measured(Vector3::x(), &mut noise))
            .collect();
        // Others run anywhere, one of them a degree off in the image.
        let off = Vector3::new(1.0, 0.0, 0.02);
        lines.push(measured(off, &mut noise));
        lines.extend((0..20).map(|_| {
            let direction = noise.vector();
            measured(direction, &mut noise)
        }));
        let known: Vec<&Measured> = lines.iter().collect();
        let directions = common_directions(&known);
        assert_eq!(directions.len(), 1);
        assert_eq!(directions[0].scatter, 0.0);
        assert!(directions[0].direction.cross(&Vector3::x()).norm() < 5e-3);
        let mut turned = 0;
        for line in &lines[..40] {
            let after = line.turned(&directions);
            turned += usize::from(sine(&after, &Vector3::x()) < 6e-3);
            // Where images know it it stays.
            let moved = after.start - line.line.start;
            assert!(moved.x.abs() < 1e-3 && moved.z.abs() < 5e-4, "{moved}");
        }
        // One of a thousand is off by more than is asked for.
        assert!(turned >= 39, "{turned}");
        for line in &lines[40..] {
            assert!(sine(&line.turned(&directions), &line.direction) < 1e-3);
        }
    }

    #[test]
    fn what_is_known_to_run_in_slightly_different_directions_stays() {
        let mut noise = Noise(2);
        let lines: Vec<Measured> = (0..60)
            .map(|_| {
                let off = 2e-3 * Vector2::new(noise.vector().sum(), noise.vector().sum());
                measured(Vector3::new(off.x, 1.0, off.y), &mut noise)
            })
            .collect();
        let known: Vec<&Measured> = lines.iter().collect();
        let directions = common_directions(&known);
        assert_eq!(directions.len(), 1);
        let scatter = directions[0].scatter.sqrt();
        assert!((1.6e-3..=3.2e-3).contains(&scatter), "{scatter}");
        for line in &lines {
            assert!(sine(&line.turned(&directions), &line.direction) < 1e-4);
        }
    }

    #[test]
    fn few_lines_in_any_direction_have_none_in_common() {
        let mut noise = Noise(3);
        let lines: Vec<Measured> = (0..12)
            .map(|_| {
                let direction = noise.vector();
                measured(direction, &mut noise)
            })
            .collect();
        let known: Vec<&Measured> = lines.iter().collect();
        assert!(common_directions(&known).is_empty());
        assert!(common_directions(&[]).is_empty());
    }
}
