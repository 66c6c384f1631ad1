//! The search for what explains the images better than the cameras as they were read.

use crate::agreement::Agreement;
use crate::hypothesis::{Hypothesis, PoseOrder, conventions, of_intrinsics};
use crate::image_checks::{field_of_view, is_usual};
use crate::lens::strengths;
use crate::pose_diagnosis::{CLEARLY, Candidate, Diagnosis};
use crate::quaternion_order::QuaternionOrder;
use neat_core::Camera;
use rayon::prelude::*;

/// Explanations whose scores differ less are equally good: the simpler holds.
const EQUALLY: f64 = 0.95;

/// Factors of focal lengths that are tried: 7 % between them, 1 among them.
pub(crate) fn focal_factors() -> impl Iterator<Item = f64> {
    (-14..=14).map(|step| 1.07_f64.powi(step))
}

impl Diagnosis<'_> {
    pub fn try_out(
        &self,
        hypothesis: Hypothesis,
        cameras: &[Camera],
        trusted: &[bool],
    ) -> Candidate {
        let cameras = hypothesis.cameras(cameras, &self.names);
        let agreement = match hypothesis {
            Hypothesis::Lens(strength) => {
                let straight = self.evidence().straightened(&cameras, strength);
                straight.agreement(&cameras, trusted)
            }
            _ => self.evidence().agreement(&cameras, trusted),
        };
        Candidate {
            agreement,
            hypothesis,
            cameras,
        }
    }

    /// What explains clearly more than the given cameras.
    pub fn better_explanation(
        &self,
        given: &Agreement,
        trusted: &[bool],
        min_share: f64,
    ) -> Option<Vec<Candidate>> {
        let mut candidates: Vec<Candidate> = self
            .hypotheses()
            .into_par_iter()
            .map(|hypothesis| self.try_out(hypothesis, &self.cameras, trusted))
            .collect();
        candidates.push(self.best_focal(&self.cameras, trusted));
        candidates.push(self.best_lens(trusted));
        let best = candidates
            .iter()
            .map(|candidate| candidate.agreement.score)
            .fold(0.0, f64::max);
        let candidate = candidates
            .into_iter()
            .filter(|candidate| candidate.agreement.score >= EQUALLY * best)
            .min_by_key(|candidate| candidate.hypothesis.complexity())?;
        let mut found = vec![candidate];
        if !matches!(
            found[0].hypothesis,
            Hypothesis::FocalScale(_) | Hypothesis::Lens(_)
        ) {
            // Scenes of other programs can be wrong in two ways.
            let focal = self.best_focal(&found[0].cameras, trusted);
            if focal.agreement.score > CLEARLY * found[0].agreement.score {
                found.push(focal);
            }
        }
        let agreement = &found.last()?.agreement;
        // Few corners that fit better are no more corners that fit.
        let explains_more = agreement.share() >= min_share.max(given.share());
        let clear = agreement.score > CLEARLY * given.score && explains_more;
        (clear && self.holds_for_other_views(&found[0].hypothesis, trusted)).then_some(found)
    }

    /// Whether what explains more of one half of the views explains clearly more of the other,
    /// too. Few true corners let some factor of the focal length or some lens bring false ones
    /// together, another in each half; a true one is the same in both. Where halves show
    /// nothing, the whole has the word.
    fn holds_for_other_views(&self, hypothesis: &Hypothesis, trusted: &[bool]) -> bool {
        let half = |parity: usize| -> Vec<bool> {
            let mut rank = 0..;
            let mut chosen =
                |&trusts: &bool| trusts && rank.next().is_some_and(|n| n % 2 == parity);
            trusted.iter().map(&mut chosen).collect()
        };
        let halves = [half(0), half(1)];
        let (mut found, mut given) = (0.0, 0.0);
        for [one, other] in [[0, 1], [1, 0]] {
            let fitted = match hypothesis {
                Hypothesis::FocalScale(_) => {
                    self.best_focal(&self.cameras, &halves[one]).hypothesis
                }
                Hypothesis::Lens(_) => self.best_lens(&halves[one]).hypothesis,
                other => *other,
            };
            let there = self.try_out(fitted, &self.cameras, &halves[other]);
            found += there.agreement.score;
            given += self.given(&halves[other]).score;
        }
        found > CLEARLY * given || found + given == 0.0
    }

    fn best_lens(&self, trusted: &[bool]) -> Candidate {
        self.best_along(&strengths(), Hypothesis::Lens, &self.cameras, trusted)
    }

    fn hypotheses(&self) -> Vec<Hypothesis> {
        let convention = |is| Hypothesis::Convention {
            read_as: self.read_as(),
            is,
            file_axes: self.file_axes,
        };
        let mut hypotheses: Vec<_> = conventions(&self.cameras[0], self.read_as())
            .into_iter()
            .map(convention)
            .collect();
        hypotheses.extend(
            PoseOrder::all(&self.names)
                .into_iter()
                .map(Hypothesis::Order),
        );
        hypotheses.extend(of_intrinsics(&self.cameras));
        hypotheses.extend(QuaternionOrder::ALL.map(Hypothesis::Quaternions));
        hypotheses.push(Hypothesis::CentersAsTranslations);
        // Turned by two quarters they are cameras with other axes.
        hypotheses.extend([1, 3].map(Hypothesis::TurnedImages));
        hypotheses
    }

    /// The factor of the focal lengths that explains most.
    fn best_focal(&self, cameras: &[Camera], trusted: &[bool]) -> Candidate {
        // In another unit, such as millimetres, they are anything: a normal lens is looked for.
        let start = match field_of_view(&cameras[0]) {
            angle if is_usual(angle) => 1.0,
            _ => f64::from(cameras[0].width) / cameras[0].intrinsics.fx,
        };
        let scales: Vec<f64> = focal_factors().map(|factor| start * factor).collect();
        self.best_along(&scales, Hypothesis::FocalScale, cameras, trusted)
    }

    /// What explains most of a family of hypotheses that is told by a number: the best of the
    /// given numbers, and what is better beside it.
    fn best_along(
        &self,
        numbers: &[f64],
        of: fn(f64) -> Hypothesis,
        cameras: &[Camera],
        trusted: &[bool],
    ) -> Candidate {
        let try_out = |number: f64| self.try_out(of(number), cameras, trusted);
        let score = |number: f64| try_out(number).agreement.score;
        let scores: Vec<f64> = numbers.par_iter().map(|number| score(*number)).collect();
        let best = (0..numbers.len()).fold(0, |best, next| {
            if scores[next] > scores[best] {
                next
            } else {
                best
            }
        });
        // Thirds of the interval that holds the top.
        let mut lower = numbers[best.saturating_sub(1)];
        let mut upper = numbers[(best + 1).min(numbers.len() - 1)];
        for _ in 0..9 {
            let thirds = [lower + (upper - lower) / 3.0, upper - (upper - lower) / 3.0];
            let [below, above] = thirds.map(score);
            if below < above {
                lower = thirds[0];
            } else {
                upper = thirds[1];
            }
        }
        let found = 0.5 * (lower + upper);
        // Three digits after the first: as exact as the search is.
        let unit = 10f64.powf(found.abs().max(0.1).log10().floor() - 3.0);
        try_out((found / unit).round() * unit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::corner_consensus::{CornerEvidence, ViewCorners};
    use crate::evidence::{Evidence, Gathered};
    use crate::lens::straightened;
    use crate::pose_diagnosis::tests::diagnosis;
    use neat_core::synthetic::{SyntheticScene, generate};

    #[test]
    fn a_lens_has_to_be_the_same_in_both_halves_of_the_views() {
        let config = SyntheticScene {
            views: 40,
            image_size: 400,
            ..SyntheticScene::default()
        };
        let data = generate(&config).unwrap();
        let corners = &data.truth.junctions;
        let holds = |strengths: [f64; 2]| {
            let views = (data.scene.views.iter().enumerate()).map(|(index, view)| {
                let bend = |corner| {
                    let pixel = view.camera.project(corner).pixel;
                    straightened(&pixel, &view.camera, -strengths[index % 2])
                };
                ViewCorners::new(index, corners.iter().map(bend).collect(), 400.0)
            });
            let gathered = Gathered {
                views: (0..40).collect(),
                evidence: Evidence::Corners(CornerEvidence::new(views.collect())),
                likeness: Vec::new(),
                silhouettes: Vec::new(),
            };
            diagnosis(&data.scene, &gathered)
                .holds_for_other_views(&Hypothesis::Lens(0.1), &[true; 40])
        };
        assert!(holds([0.16, 0.16]));
        assert!(!holds([0.16, -0.1]));
        assert!(!holds([0.0, 0.0]));
    }
}
