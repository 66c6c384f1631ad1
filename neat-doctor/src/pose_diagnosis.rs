//! Poses and intrinsics against the images: if they disagree, why.

use crate::agreement::Agreement;
use crate::evidence::{Evidence, Gathered, evenly};
use crate::examination::{Check, Finding, Level, Repair, counted, percent};
use crate::hypothesis::{Hypothesis, PoseOrder, conventions, of_intrinsics};
use crate::point_transfer::{known_points, transfer_gain};
use crate::silhouettes::covered_share;
use neat_core::layout::PoseConvention;
use neat_core::{Camera, Scene};
use rayon::prelude::*;

/// Another explanation has to score this many times as much as what is given.
const CLEARLY: f64 = 1.3;
/// Explanations whose scores differ less are equally good: the simpler holds.
const EQUALLY: f64 = 0.95;
/// Views among whose corners better cameras are searched for.
const SEARCHED_VIEWS: usize = 60;

/// Points must be met more than by chance by so many standard deviations: with right poses they
/// are by 8 to 70 on photographs of bricks and leaves, with wrong ones seldom by more than 2.
const SIGNIFICANT: f64 = 4.0;
/// So many views speak for the others.
const ASKED_VIEWS: usize = 8;
/// Right cameras explain at least this share of the silhouettes …
const MIN_COVERED: f64 = 0.95;
/// … and by so much more than the same cameras in another order.
const MIN_DIFFERENCE: f64 = 0.05;

/// A scene, what its images show, and how its poses were read.
pub(crate) struct Diagnosis<'a> {
    pub scene: &'a Scene,
    pub gathered: &'a Gathered,
    pub cameras: Vec<Camera>,
    pub names: Vec<&'a str>,
    /// What the scene was read with.
    pub read_with: Repair,
    /// The poses could only be read by mirroring the world.
    pub mirrored: bool,
}

/// A changed set of cameras, and how it does.
pub(crate) struct Candidate {
    pub hypothesis: Hypothesis,
    pub cameras: Vec<Camera>,
    pub agreement: Agreement,
}

/// What a kind of evidence can show.
pub(crate) struct Limits {
    /// Fewer pieces than this show nothing.
    min_total: usize,
    /// Shares from here on are those of right cameras.
    pub good_share: f64,
    /// Shares below are those of wrong cameras.
    pub bad_share: f64,
}

impl Limits {
    fn of(evidence: &Evidence, views: usize) -> Self {
        match evidence {
            Evidence::Tracks { .. } => Self {
                min_total: 60,
                good_share: 0.35,
                bad_share: 0.15,
            },
            // Curved things have few real corners among those that are found.
            Evidence::Corners(_) => Self {
                min_total: 5 * views.clamp(8, SEARCHED_VIEWS / 2),
                good_share: 0.15,
                bad_share: 0.05,
            },
        }
    }
}

impl<'a> Diagnosis<'a> {
    pub fn new(
        scene: &'a Scene,
        gathered: &'a Gathered,
        read_with: Repair,
        mirrored: bool,
    ) -> Self {
        Self {
            scene,
            gathered,
            cameras: scene.views.iter().map(|view| view.camera).collect(),
            names: scene.views.iter().map(|view| view.name.as_str()).collect(),
            read_with,
            mirrored,
        }
    }

    pub fn read_as(&self) -> PoseConvention {
        self.read_with.pose_convention.unwrap_or_default()
    }

    pub fn evidence(&self) -> &Evidence {
        &self.gathered.evidence
    }

    /// Trusts all views whose images were looked at.
    fn all_trusted(&self) -> Vec<bool> {
        self.trusted(usize::MAX)
    }

    /// Trusts at most so many of them.
    fn trusted(&self, limit: usize) -> Vec<bool> {
        let mut trusted = vec![false; self.scene.views.len()];
        for index in evenly(self.gathered.views.len(), limit) {
            trusted[self.gathered.views[index]] = true;
        }
        trusted
    }

    /// How well the given cameras explain what the `trusted` views show.
    fn given(&self, trusted: &[bool]) -> Agreement {
        self.evidence().agreement(&self.cameras, trusted)
    }

    /// How well the given cameras explain everything.
    pub fn all_given(&self) -> Agreement {
        self.given(&self.all_trusted())
    }

    pub fn limits(&self) -> Limits {
        Limits::of(self.evidence(), self.gathered.views.len())
    }

    /// Whether the given cameras explain what they should, in all views and
    /// better than with other focal lengths: nothing has to be searched for.
    pub fn is_plainly_good(&self) -> bool {
        const FOCAL_SCALES: [f64; 6] = [0.8, 0.9, 0.95, 1.05, 1.1, 1.25];
        let trusted = self.all_trusted();
        let (given, limits) = (self.given(&trusted), self.limits());
        let explains = given.all.total >= limits.min_total && given.share() >= limits.good_share;
        let focal_is_better = || {
            FOCAL_SCALES.into_par_iter().any(|scale| {
                let other = self.try_out(Hypothesis::FocalScale(scale), &self.cameras, &trusted);
                other.agreement.score > CLEARLY * given.score
            })
        };
        !self.mirrored
            && explains
            && !focal_is_better()
            && self.without_bad_views(trusted.clone()) == trusted
    }

    /// That the given cameras agree with the images.
    pub fn agreeing_findings(&self) -> Vec<Finding> {
        vec![self.agreeing(&self.all_given(), true)]
    }

    /// What is found about the poses.
    pub fn findings(&self) -> Vec<Finding> {
        // As many as a search among hundreds of hypotheses needs.
        let trusted = self.trusted(SEARCHED_VIEWS);
        let (given, limits) = (self.given(&trusted), self.limits());
        if given.all.total < limits.min_total {
            return vec![self.too_little(&given)];
        }
        if let Some(best) = self.better_explanation(&given, &trusted, limits.bad_share) {
            return vec![self.explained_by(best, &given)];
        }
        if self.mirrored {
            return vec![self.mirrored_as_read()];
        }
        let trusted = self.without_bad_views(self.all_trusted());
        let rest = self.given(&trusted);
        if rest.share() < limits.bad_share {
            let finding = match self.other_witness() {
                Some(message) => Finding::new(Check::Poses, Level::Good, message),
                None => self.disagreement(&given),
            };
            return vec![finding];
        }
        let suspects: Vec<usize> = (self.gathered.views.iter().copied())
            .filter(|&view| !trusted[view])
            .collect();
        let bad: Vec<usize> = (suspects.iter().copied())
            .filter(|&view| !self.shows_known_points(view, &trusted))
            .collect();
        let mut findings = Vec::new();
        if !bad.is_empty() {
            let fits: Vec<Option<usize>> = (bad.par_iter())
                .map(|&view| self.fitting_pose(view, &bad, &trusted, &rest))
                .collect();
            findings.push(self.bad_views(&bad, &fits));
        }
        let good = rest.share() >= limits.good_share || self.other_witness().is_some();
        findings.push(self.agreeing(&rest, good));
        findings
    }

    fn try_out(&self, hypothesis: Hypothesis, cameras: &[Camera], trusted: &[bool]) -> Candidate {
        let cameras = hypothesis.cameras(cameras, &self.names);
        Candidate {
            agreement: self.evidence().agreement(&cameras, trusted),
            hypothesis,
            cameras,
        }
    }

    /// What explains clearly more than the given cameras.
    fn better_explanation(
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
        let best = candidates
            .iter()
            .map(|candidate| candidate.agreement.score)
            .fold(0.0, f64::max);
        let candidate = candidates
            .into_iter()
            .filter(|candidate| candidate.agreement.score >= EQUALLY * best)
            .min_by_key(|candidate| candidate.hypothesis.complexity())?;
        let mut found = vec![candidate];
        if !matches!(found[0].hypothesis, Hypothesis::FocalScale(_)) {
            // Scenes of other programs can be wrong in two ways.
            let focal = self.best_focal(&found[0].cameras, trusted);
            if focal.agreement.score > CLEARLY * found[0].agreement.score {
                found.push(focal);
            }
        }
        let agreement = &found.last()?.agreement;
        let clear = agreement.score > CLEARLY * given.score && agreement.share() >= min_share;
        clear.then_some(found)
    }

    fn hypotheses(&self) -> Vec<Hypothesis> {
        let convention = |is| Hypothesis::Convention {
            read_as: self.read_as(),
            is,
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
        hypotheses
    }

    /// The factor of the focal lengths that explains most.
    fn best_focal(&self, cameras: &[Camera], trusted: &[bool]) -> Candidate {
        const STEPS: i32 = 14;
        const STEP: f64 = 1.07;
        let try_scale = |scale: f64| self.try_out(Hypothesis::FocalScale(scale), cameras, trusted);
        let scored: Vec<(f64, f64)> = (-STEPS..=STEPS)
            .into_par_iter()
            .filter(|&step| step != 0)
            .map(|step| {
                let scale = STEP.powi(step);
                (try_scale(scale).agreement.score, scale)
            })
            .collect();
        let (_, mut scale) =
            (scored.into_iter()).fold(
                (0.0, 1.0),
                |best, next| if next.0 > best.0 { next } else { best },
            );
        // Thirds of the interval that holds the top.
        let (mut lower, mut upper) = (scale / STEP, scale * STEP);
        for _ in 0..9 {
            let thirds = [lower + (upper - lower) / 3.0, upper - (upper - lower) / 3.0];
            let [below, above] = thirds.map(|scale| try_scale(scale).agreement.score);
            if below < above {
                lower = thirds[0];
            } else {
                upper = thirds[1];
            }
            scale = 0.5 * (lower + upper);
        }
        try_scale((scale * 1000.0).round() / 1000.0)
    }

    /// Takes trust from views, the worst first, that explain next to nothing
    /// while the others do.
    fn without_bad_views(&self, mut trusted: Vec<bool>) -> Vec<bool> {
        let views = self.gathered.views.len();
        for _ in 0..views / 2 {
            let agreement = self.given(&trusted);
            let mut shares: Vec<(f64, usize)> = (self.gathered.views.iter())
                .filter(|&&view| trusted[view] && agreement.per_view[view].total > 0)
                .map(|&view| (agreement.per_view[view].share(), view))
                .collect();
            shares.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let at = |quantile: usize| shares.get(quantile * shares.len() / 10).map(|s| s.0);
            let (Some(&(worst, view)), Some(median), Some(low)) = (shares.first(), at(5), at(3))
            else {
                break;
            };
            let chance_of_none = (1.0 - low).powi(agreement.per_view[view].total as i32);
            if worst > 0.2 * median || worst > 0.1 || chance_of_none > 0.01 {
                break;
            }
            trusted[view] = false;
        }
        trusted
    }

    /// What speaks for the given cameras where tracks or corners do not; `None` if nothing does.
    fn other_witness(&self) -> Option<String> {
        let views = &self.gathered.views;
        if let Evidence::Tracks { .. } = self.evidence() {
            let asked = evenly(views.len(), ASKED_VIEWS);
            let agree = (asked.par_iter())
                .filter(|&&index| self.shows_known_points(views[index], &self.all_trusted()))
                .count();
            return (4 * agree >= 3 * asked.len()).then(|| {
                format!(
                    "{agree} of {} show points of the others where they should be",
                    counted(asked.len(), "view")
                )
            });
        }
        let silhouettes = &self.gathered.silhouettes;
        if 2 * silhouettes.len() < views.len() {
            return None;
        }
        let share =
            |cameras: &[Camera]| covered_share(silhouettes, cameras, self.scene.sphere_radius);
        let given = share(&self.cameras);
        // Things that look the same from everywhere tell nothing.
        let stands_out = |by: usize| {
            let order = Hypothesis::Order(PoseOrder::Shifted(by as isize));
            share(&order.cameras(&self.cameras, &self.names)) < given - MIN_DIFFERENCE
        };
        let agree = given > MIN_COVERED
            && [1, views.len() / 3, views.len() / 2]
                .into_iter()
                .all(stands_out);
        agree.then(|| {
            format!(
                "the cameras explain {} of the silhouettes of {}",
                percent(given),
                counted(silhouettes.len(), "view")
            )
        })
    }

    /// Whether points that `trusted` views agree on are seen where a view's pose puts them.
    fn shows_known_points(&self, view: usize, trusted: &[bool]) -> bool {
        let Evidence::Tracks { tracks, keypoints } = self.evidence() else {
            return false;
        };
        let mut others = trusted.to_vec();
        others[view] = false;
        let points = known_points(tracks, &self.cameras, &others);
        (keypoints.iter().find(|of_view| of_view.view == view))
            .is_some_and(|own| transfer_gain(own, &self.cameras[view], &points) > SIGNIFICANT)
    }

    /// The view whose pose would explain the image of a bad one.
    fn fitting_pose(
        &self,
        view: usize,
        bad: &[usize],
        trusted: &[bool],
        rest: &Agreement,
    ) -> Option<usize> {
        let mut trusted = trusted.to_vec();
        trusted[view] = true;
        let mut best = (0.0, None);
        for &other in bad.iter().filter(|&&other| other != view) {
            let mut cameras = self.cameras.clone();
            cameras[view].world_from_camera = self.cameras[other].world_from_camera;
            cameras[view].center_in_world = self.cameras[other].center_in_world;
            let share = self.evidence().agreement(&cameras, &trusted).per_view[view].share();
            if share > best.0 {
                best = (share, Some(other));
            }
        }
        best.1.filter(|_| best.0 > 0.5 * rest.share())
    }
}
