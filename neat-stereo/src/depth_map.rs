//! Planes of surfaces that one view sees: a plane sweep (Collins 1996) over a part of the
//! pixels of small images, then slanted patches that neighbouring pixels propose to each
//! other and that are changed a little (PatchMatch stereo: Bleyer, Rhemann and Rother 2011),
//! on ever larger images.

use crate::matcher::{Matcher, Target};
use crate::view::StereoView;
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// One of so many pixels along each side is swept; the others take over its plane. All
/// pixels, or every second one, find the same points in up to three times the time.
const SWEPT: usize = 4;
/// Passes over the pixels at each level: one to the lower right, one back.
const PASSES: usize = 2;
/// Largest change of a plane's unit normal, along each axis, in the first pass.
const MAX_TURN: f32 = 0.5;
/// The noise of 49 pixels correlates with a standard deviation of 1/7: the best of some
/// hundred tries stays below this.
const MIN_SCORE: f32 = 0.5;

/// Planes on a lattice of pixels.
#[derive(Clone, Debug, Default)]
pub(crate) struct DepthMap {
    pub columns: usize,
    pub rows: usize,
    /// The lattice is that of the pixels of this level.
    pub level: usize,
    /// The plane `plane · x = 1` in the camera's frame.
    pub planes: Vec<Option<Vector3<f32>>>,
}

/// A plane and how well neighbours agree on it.
#[derive(Clone, Copy)]
struct Match {
    plane: Vector3<f32>,
    score: f32,
}

/// The lattice while it is filled.
struct Lattice {
    columns: usize,
    rows: usize,
    level: usize,
    matches: Vec<Option<Match>>,
}

impl DepthMap {
    /// Of `view` by `others`, within the ball around the origin. Without others, or levels,
    /// there is nothing on it.
    pub fn estimate(
        view: &StereoView,
        others: &[&StereoView],
        ball_radius: f64,
        seed: u64,
    ) -> Self {
        let Some(levels) = view.levels().filter(|_| !others.is_empty()) else {
            return Self::default();
        };
        let (finest, coarsest) = levels.into_inner();
        let image = view.image(coarsest);
        let mut lattice = Lattice {
            columns: image.width,
            rows: image.height,
            level: coarsest,
            matches: vec![None; image.width * image.height],
        };
        lattice.sweep(&Matcher::new(view, others, coarsest), ball_radius);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        for level in (finest..=coarsest).rev() {
            lattice.refine(&Matcher::new(view, others, level), &mut rng);
        }
        lattice.settle(&Matcher::new(view, others, finest));
        let planes = lattice.matches.into_iter();
        Self {
            columns: lattice.columns,
            rows: lattice.rows,
            level: coarsest,
            planes: planes.map(|found| Some(found?.plane)).collect(),
        }
    }

    /// The pixel of the whole image in the middle of a lattice pixel.
    pub fn pixel(&self, index: usize) -> [usize; 2] {
        middle_pixel(index, self.columns, self.level)
    }
}

/// Of lattice pixel `index`, in an image that is larger by 2 to the power `levels`.
fn middle_pixel(index: usize, columns: usize, levels: usize) -> [usize; 2] {
    [index % columns, index / columns].map(|cell| ((2 * cell + 1) << levels) / 2)
}

impl Lattice {
    fn targets(&self, matcher: &Matcher<'_>) -> Vec<Option<Target>> {
        let levels = self.level - matcher.level();
        let pixel = |index: usize| middle_pixel(index, self.columns, levels);
        let all = 0..self.matches.len();
        all.map(|index| matcher.target(pixel(index))).collect()
    }

    /// Tries patches parallel to the image at all depths.
    fn sweep(&mut self, matcher: &Matcher<'_>, ball_radius: f64) {
        let columns = self.columns;
        let is_swept = |index: &usize| {
            (index % columns).is_multiple_of(SWEPT) && (index / columns).is_multiple_of(SWEPT)
        };
        let targets = self.targets(matcher);
        for index in (0..targets.len()).filter(is_swept) {
            let Some(target) = &targets[index] else {
                continue;
            };
            let Some([low, high]) = matcher.inverse_depths(target, ball_radius) else {
                continue;
            };
            let steps = ((high - low) / matcher.step).ceil() as usize;
            for k in 0..=steps {
                let inverse_depth = low + k as f32 * matcher.step;
                self.propose(matcher, target, index, Vector3::z() * inverse_depth);
            }
        }
    }

    /// Tries at each pixel the planes of the two before it and its own, a little changed.
    fn refine(&mut self, matcher: &Matcher<'_>, rng: &mut ChaCha8Rng) {
        let targets = self.targets(matcher);
        for (found, target) in self.matches.iter_mut().zip(&targets) {
            *found = found.zip(target.as_ref()).and_then(|(found, target)| {
                let score = matcher.score(target, &found.plane)?;
                Some(Match { score, ..found })
            });
        }
        for pass in 0..PASSES {
            let forward = pass % 2 == 0;
            let reach = 1.0 / (1 << pass) as f32;
            for k in 0..targets.len() {
                let index = if forward { k } else { targets.len() - 1 - k };
                let Some(target) = &targets[index] else {
                    continue;
                };
                for from in self.before(index, forward).into_iter().flatten() {
                    if let Some(proposal) = self.matches[from] {
                        self.propose(matcher, target, index, proposal.plane);
                    }
                }
                self.change(matcher, target, index, reach, rng);
            }
        }
    }

    /// The pixels beside and above, or the other way round on the way back.
    fn before(&self, index: usize, forward: bool) -> [Option<usize>; 2] {
        let (column, row) = (index % self.columns, index / self.columns);
        match forward {
            true => [
                (column > 0).then(|| index - 1),
                (row > 0).then(|| index - self.columns),
            ],
            false => [
                (column + 1 < self.columns).then(|| index + 1),
                (row + 1 < self.rows).then(|| index + self.columns),
            ],
        }
    }

    /// Tries another depth, up to `reach` pixels off, and then another normal.
    fn change(
        &mut self,
        matcher: &Matcher<'_>,
        target: &Target,
        index: usize,
        reach: f32,
        rng: &mut ChaCha8Rng,
    ) {
        let mut draw = || reach * rng.random_range(-1.0f32..1.0);
        let Some(found) = self.matches[index] else {
            return;
        };
        let moved = shifted(&found.plane, target, matcher.step * draw());
        self.propose(matcher, target, index, moved);
        let plane = self.matches[index].map_or(found.plane, |found| found.plane);
        let turn = MAX_TURN * Vector3::new(draw(), draw(), draw());
        let turned = plane.normalize() + turn;
        let at_same_depth = turned * (plane.dot(&target.ray) / turned.dot(&target.ray));
        self.propose(matcher, target, index, at_same_depth);
    }

    /// Takes the plane if it is better than the one that is known.
    fn propose(
        &mut self,
        matcher: &Matcher<'_>,
        target: &Target,
        index: usize,
        plane: Vector3<f32>,
    ) {
        let Some(score) = matcher.score(target, &plane) else {
            return;
        };
        let found = &mut self.matches[index];
        if found.is_none_or(|found| score > found.score) {
            *found = Some(Match { plane, score });
        }
    }

    /// Moves each plane to the vertex of the parabola through the scores one pixel before
    /// and behind, and drops those that do not stand out.
    fn settle(&mut self, matcher: &Matcher<'_>) {
        let targets = self.targets(matcher);
        for (found, target) in self.matches.iter_mut().zip(&targets) {
            let sure = found.filter(|found| found.score >= MIN_SCORE);
            *found = sure.zip(target.as_ref()).and_then(|(found, target)| {
                let plane = |pixels: f32| shifted(&found.plane, target, pixels * matcher.step);
                let score = |pixels: f32| matcher.score(target, &plane(pixels));
                let (before, behind) = (score(-1.0)?, score(1.0)?);
                let curvature = before + behind - 2.0 * found.score;
                let vertex = 0.5 * (before - behind) / curvature;
                (curvature < 0.0 && vertex.abs() < 1.0).then(|| Match {
                    plane: plane(vertex),
                    ..found
                })
            });
        }
    }
}

/// A parallel plane whose inverse depth at the target is larger by `change`.
fn shifted(plane: &Vector3<f32>, target: &Target, change: f32) -> Vector3<f32> {
    let inverse_depth = plane.dot(&target.ray);
    plane * ((inverse_depth + change) / inverse_depth)
}
