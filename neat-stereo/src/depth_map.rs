//! Planes of surface seen by one view, by matching patches with neighbouring views: a plane
//! sweep (Collins 1996) on small images, refined with slanted patches that neighbouring
//! pixels propose to each other (PatchMatch stereo: Bleyer et al. 2011) on ever larger ones.

use crate::neighbours::ball_interval;
use crate::patch::{PIXELS, Patch};
use crate::view::StereoView;
use nalgebra::{Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Passes over the pixels at each level.
const PASSES: usize = 2;
/// One of so many pixels along each side is swept; the others take over its plane.
const SWEPT: usize = 4;
/// Levels that refine a sweep.
pub(crate) const REFINED_LEVELS: usize = 3;
/// Patches seen at a flatter angle than this to the surface are no evidence.
const MIN_COSINE: f32 = 0.2;

/// What was found at a pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Match {
    /// The plane `plane · x = 1` in the camera's frame.
    pub plane: Vector3<f32>,
    /// Mean correlation of those neighbours that agree best.
    pub score: f32,
    /// Standard deviation of the place along the epipolar lines, in pixels of the image.
    pub deviation: f32,
}

/// Matches on a lattice of pixels.
#[derive(Clone, Debug)]
pub(crate) struct DepthMap {
    pub columns: usize,
    pub rows: usize,
    /// Pixels between two of the lattice are 2 to this power.
    pub level: usize,
    pub matches: Vec<Option<Match>>,
}

/// A view and its neighbours at one level.
struct Matcher<'a> {
    view: &'a StereoView,
    others: Vec<Other<'a>>,
    level: usize,
    calibrated_from_pixels: Matrix3<f32>,
    /// Change of the inverse depth that moves a patch by a pixel of this level in the
    /// neighbour farthest away.
    step: f32,
}

struct Other<'a> {
    view: &'a StereoView,
    linear: Matrix3<f32>,
    offset: Vector3<f32>,
}

impl<'a> Matcher<'a> {
    fn new(view: &'a StereoView, others: &[&'a StereoView], level: usize) -> Self {
        let calibrated = view.calibrated_from_pixels(level);
        let of_other = |other: &&'a StereoView| {
            let transfer = view.transfer_to(other, level);
            Other {
                view: other,
                linear: (transfer.linear * calibrated).cast(),
                offset: transfer.offset.cast(),
            }
        };
        let baseline = |other: &&StereoView| {
            (other.camera.center_in_world - view.camera.center_in_world).norm()
        };
        let widest = others.iter().map(baseline).fold(0.0, f64::max);
        let focal = view.pixels_from_calibrated(level)[(0, 0)];
        Self {
            view,
            others: others.iter().map(of_other).collect(),
            level,
            calibrated_from_pixels: calibrated.cast(),
            step: (1.0 / (focal * widest)) as f32,
        }
    }

    fn ray(&self, [x, y]: [usize; 2]) -> Vector3<f32> {
        self.calibrated_from_pixels * Vector3::new(x as f32, y as f32, 1.0)
    }

    fn patch(&self, [x, y]: [usize; 2]) -> Option<Patch> {
        Patch::around(&self.view.levels[self.level], x, y)
    }

    /// Mean correlation over the better half of the neighbours: the others may not see it.
    fn score(&self, patch: &Patch, [x, y]: [usize; 2], plane: &Vector3<f32>) -> Option<f32> {
        let plane = self.calibrated_from_pixels.tr_mul(plane);
        let mut best = [f32::NEG_INFINITY; 8];
        for (k, other) in self.others.iter().enumerate() {
            let homography = other.linear + other.offset * plane.transpose();
            let image = &other.view.levels[self.level];
            if let Some(c) = patch.correlation(image, &homography, x as f32, y as f32) {
                best[k] = c;
            }
        }
        let counted = self.others.len().div_ceil(2);
        let best = &mut best[..self.others.len()];
        best.sort_unstable_by(|a, b| b.total_cmp(a));
        let sum = best[..counted].iter().sum::<f32>();
        sum.is_finite().then(|| sum / counted as f32)
    }
}

impl DepthMap {
    /// Of `view` by `others`, within the ball around the origin.
    pub fn estimate(
        view: &StereoView,
        others: &[&StereoView],
        ball_radius: f64,
        seed: u64,
    ) -> Self {
        let coarsest = view.levels.len() - 1;
        let image = &view.levels[coarsest];
        let mut map = Self {
            columns: image.width,
            rows: image.height,
            level: coarsest,
            matches: vec![None; image.width * image.height],
        };
        if others.is_empty() {
            return map;
        }
        map.sweep(&Matcher::new(view, others, coarsest), ball_radius);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let finest = coarsest.saturating_sub(REFINED_LEVELS);
        for level in (finest..=coarsest).rev() {
            map.refine(&Matcher::new(view, others, level), &mut rng);
        }
        map.settle(&Matcher::new(view, others, finest));
        map
    }

    /// The pixel of `level` in the middle of cell `index`.
    pub fn pixel(&self, index: usize, level: usize) -> [usize; 2] {
        let middle = |cell: usize| ((2 * cell + 1) << (self.level - level)) / 2;
        [index % self.columns, index / self.columns].map(middle)
    }

    /// Fronto-parallel patches at all depths.
    fn sweep(&mut self, matcher: &Matcher<'_>, ball_radius: f64) {
        let swept = |index: &usize| {
            (index % self.columns).is_multiple_of(SWEPT) && (index / self.columns).is_multiple_of(SWEPT)
        };
        for index in (0..self.matches.len()).filter(swept).collect::<Vec<_>>() {
            let pixel = self.pixel(index, matcher.level);
            let Some(patch) = matcher.patch(pixel) else {
                continue;
            };
            let Some([low, high]) = inverse_depths(matcher, pixel, ball_radius) else {
                continue;
            };
            let steps = ((high - low) / matcher.step).ceil() as usize;
            let mut best: Option<Match> = None;
            for k in 0..=steps {
                let plane = Vector3::new(0.0, 0.0, low + k as f32 * matcher.step);
                let score = matcher.score(&patch, pixel, &plane);
                if let Some(score) = score.filter(|&s| best.is_none_or(|b| s > b.score)) {
                    best = Some(Match {
                        plane,
                        score,
                        deviation: f32::INFINITY,
                    });
                }
            }
            self.matches[index] = best;
        }
    }

    /// Planes of neighbouring pixels, and the own one a little changed, are tried.
    fn refine(&mut self, matcher: &Matcher<'_>, rng: &mut ChaCha8Rng) {
        let patches: Vec<_> = (0..self.matches.len())
            .map(|index| matcher.patch(self.pixel(index, matcher.level)))
            .collect();
        for (index, patch) in patches.iter().enumerate() {
            let pixel = self.pixel(index, matcher.level);
            let found = self.matches[index]
                .zip(patch.as_ref())
                .and_then(|(found, patch)| {
                    let score = matcher.score(patch, pixel, &found.plane)?;
                    Some(Match { score, ..found })
                });
            self.matches[index] = found;
        }
        for pass in 0..PASSES {
            let forward = pass % 2 == 0;
            for k in 0..self.matches.len() {
                let index = if forward {
                    k
                } else {
                    self.matches.len() - 1 - k
                };
                if let Some(patch) = &patches[index] {
                    self.improve(matcher, patch, index, forward, pass, rng);
                }
            }
        }
    }

    fn improve(
        &mut self,
        matcher: &Matcher<'_>,
        patch: &Patch,
        index: usize,
        forward: bool,
        pass: usize,
        rng: &mut ChaCha8Rng,
    ) {
        let pixel = self.pixel(index, matcher.level);
        let ray = matcher.ray(pixel);
        let (column, row) = (index % self.columns, index / self.columns);
        let beside = match forward {
            true => (column > 0).then(|| index - 1),
            false => (column + 1 < self.columns).then(|| index + 1),
        };
        let above = match forward {
            true => (row > 0).then(|| index - self.columns),
            false => (row + 1 < self.rows).then(|| index + self.columns),
        };
        for from in [beside, above].into_iter().flatten() {
            if let Some(proposal) = self.matches[from] {
                self.try_plane(matcher, patch, index, pixel, &ray, proposal.plane);
            }
        }
        let Some(found) = self.matches[index] else {
            return;
        };
        let reach = 1.0 / (1 << pass) as f32;
        let mut draw = || rng.random_range(-1.0f32..1.0);
        let w = found.plane.dot(&ray);
        let moved = found.plane * ((w + reach * matcher.step * draw()) / w);
        self.try_plane(matcher, patch, index, pixel, &ray, moved);
        let Some(found) = self.matches[index] else {
            return;
        };
        let w = found.plane.dot(&ray);
        let normal = found.plane.normalize();
        let turned = normal + 0.5 * reach * Vector3::new(draw(), draw(), draw());
        let turned = turned * (w / turned.dot(&ray));
        self.try_plane(matcher, patch, index, pixel, &ray, turned);
    }

    fn try_plane(
        &mut self,
        matcher: &Matcher<'_>,
        patch: &Patch,
        index: usize,
        pixel: [usize; 2],
        ray: &Vector3<f32>,
        plane: Vector3<f32>,
    ) {
        // also false where the plane lies behind the camera
        if !(plane.dot(ray) >= MIN_COSINE * plane.norm() * ray.norm()) {
            return;
        }
        let Some(score) = matcher.score(patch, pixel, &plane) else {
            return;
        };
        if self.matches[index].is_none_or(|found| score > found.score) {
            self.matches[index] = Some(Match {
                plane,
                score,
                deviation: f32::INFINITY,
            });
        }
    }

    /// Depth at the vertex of a parabola through the scores a pixel before and behind, and
    /// how well they determine it.
    fn settle(&mut self, matcher: &Matcher<'_>) {
        for index in 0..self.matches.len() {
            let Some(found) = self.matches[index] else {
                continue;
            };
            let pixel = self.pixel(index, matcher.level);
            self.matches[index] = matcher.patch(pixel).and_then(|patch| {
                let w = found.plane.dot(&matcher.ray(pixel));
                let scaled = |shift: f32| found.plane * ((w + shift * matcher.step) / w);
                let at = |shift: f32| matcher.score(&patch, pixel, &scaled(shift));
                let (before, behind) = (at(-1.0)?, at(1.0)?);
                let curvature = found.score - 0.5 * (before + behind);
                let shift = 0.25 * (behind - before) / curvature;
                (curvature > 0.0 && shift.abs() < 1.0).then(|| Match {
                    plane: scaled(shift),
                    score: found.score,
                    // The residual 1 − score is noise over all pixels, curvature the signal.
                    deviation: ((1.0 - found.score) / (PIXELS as f32 * curvature)).sqrt()
                        * (1 << matcher.level) as f32,
                })
            });
        }
    }
}

/// Least and largest inverse depth of a pixel within the ball.
fn inverse_depths(matcher: &Matcher<'_>, pixel: [usize; 2], ball_radius: f64) -> Option<[f32; 2]> {
    let camera = &matcher.view.camera;
    let ray: Vector3<f64> = matcher.ray(pixel).cast();
    let length = ray.norm();
    let direction = camera.world_from_camera * ray / length;
    let [near, far] = ball_interval(&camera.center_in_world, &direction, ball_radius)?;
    // Nearer than this the neighbour farthest away sees it under a right angle or more.
    let focal = matcher.view.pixels_from_calibrated(matcher.level)[(0, 0)] as f32;
    let most = matcher.step * focal;
    Some([(length / far) as f32, ((length / near) as f32).min(most)])
}
