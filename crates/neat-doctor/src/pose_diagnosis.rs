//! Poses and intrinsics against the images: if they disagree, why.

use crate::agreement::{Agreement, Evidence};
use crate::evidence::Gathered;
use crate::examination::{Cause, Check, Finding, Level, Repair, counted, listed, percent};
use crate::examine::evenly;
use crate::hypothesis::{Hypothesis, PoseOrder, conventions};
use crate::likeness::poses_follow_likeness;
use neat_core::layout::{CameraAxes, PoseConvention, PoseDirection};
use neat_core::{Camera, Scene};
use rayon::prelude::*;

/// Another explanation has to score this many times as much as what is given.
const CLEARLY: f64 = 1.3;
/// Explanations whose scores differ less are equally good: the simpler holds.
const EQUALLY: f64 = 0.95;
/// Views among whose corners better cameras are searched for.
const SEARCHED_VIEWS: usize = 60;
/// A focal length further off than this, as a factor, spoils every result.
const BAD_FOCAL_FACTOR: f64 = 1.08;

/// A scene, what its images show, and how its poses were read.
pub(crate) struct Diagnosis<'a> {
    scene: &'a Scene,
    gathered: &'a Gathered,
    cameras: Vec<Camera>,
    names: Vec<&'a str>,
    read_with: Repair,
    /// The poses could only be read by mirroring the world.
    mirrored: bool,
}

/// A changed set of cameras, and how it does.
struct Candidate {
    hypothesis: Hypothesis,
    cameras: Vec<Camera>,
    agreement: Agreement,
}

/// What a kind of evidence can show.
struct Limits {
    /// Fewer pieces than this show nothing.
    min_total: usize,
    /// Shares from here on are those of right cameras.
    good_share: f64,
    /// Shares below are those of wrong cameras.
    bad_share: f64,
}

impl Limits {
    fn of(evidence: &Evidence, views: usize) -> Self {
        match evidence {
            Evidence::Tracks(_) => Self {
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

    fn read_as(&self) -> PoseConvention {
        self.read_with.pose_convention.unwrap_or_default()
    }

    fn evidence(&self) -> &Evidence {
        &self.gathered.evidence
    }

    /// Trusts all views whose images were looked at.
    fn all_trusted(&self) -> Vec<bool> {
        let mut trusted = vec![false; self.scene.views.len()];
        for &view in &self.gathered.views {
            trusted[view] = true;
        }
        trusted
    }

    /// Trusts as many of these as a search among hundreds of hypotheses needs.
    fn some_trusted(&self) -> Vec<bool> {
        let mut trusted = vec![false; self.scene.views.len()];
        for index in evenly(self.gathered.views.len(), SEARCHED_VIEWS) {
            trusted[self.gathered.views[index]] = true;
        }
        trusted
    }

    /// Whether the given cameras explain what they should, in all views and
    /// better than with other focal lengths: nothing has to be searched for.
    pub fn is_plainly_good(&self) -> bool {
        const FOCAL_SCALES: [f64; 6] = [0.8, 0.9, 0.95, 1.05, 1.1, 1.25];
        let trusted = self.all_trusted();
        let given = self.evidence().agreement(&self.cameras, &trusted);
        let limits = Limits::of(self.evidence(), self.gathered.views.len());
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
        let given = self
            .evidence()
            .agreement(&self.cameras, &self.all_trusted());
        vec![self.agreeing(&given, true)]
    }

    /// What is found about the poses.
    pub fn findings(&self) -> Vec<Finding> {
        let trusted = self.some_trusted();
        let given = self.evidence().agreement(&self.cameras, &trusted);
        let limits = Limits::of(self.evidence(), self.gathered.views.len());
        if given.all.total < limits.min_total {
            return vec![self.too_little(&given)];
        }
        if let Some(best) = self.better_explanation(&given, &trusted, limits.good_share) {
            return vec![self.explained_by(best, &given)];
        }
        if self.mirrored {
            return vec![self.mirrored_without_repair()];
        }
        let trusted = self.without_bad_views(self.all_trusted());
        let rest = self.evidence().agreement(&self.cameras, &trusted);
        if rest.share() < limits.bad_share {
            return vec![self.disagreement(&given)];
        }
        let bad: Vec<usize> = (self.gathered.views.iter().copied())
            .filter(|&view| !trusted[view])
            .collect();
        let mut findings = Vec::new();
        if !bad.is_empty() {
            findings.push(self.bad_views(&bad, &trusted, &rest));
        }
        findings.push(self.agreeing(&rest, rest.share() >= limits.good_share));
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

    /// Says what the candidates, each on top of the one before, repair.
    fn explained_by(&self, candidates: Vec<Candidate>, given: &Agreement) -> Finding {
        let Some(last) = candidates.last() else {
            return self.disagreement(given);
        };
        let after = last.agreement.share();
        let mut repair = self.read_with;
        let mut cause = None;
        let mut reasons = Vec::new();
        let mut remedy = None;
        let mut level = Level::Problem;
        for candidate in &candidates {
            let (why, reason) = self.reason(&candidate.hypothesis);
            cause = cause.or(Some(why));
            reasons.push(reason);
            match candidate.hypothesis {
                Hypothesis::Convention { is, .. } => repair.pose_convention = Some(is),
                Hypothesis::FocalScale(scale) => {
                    repair.focal_scale = Some(times(repair.focal_scale, scale));
                    if candidates.len() == 1 && scale.max(1.0 / scale) < BAD_FOCAL_FACTOR {
                        level = Level::Warning;
                    }
                }
                Hypothesis::IntrinsicsScale(scale) => {
                    repair.intrinsics_scale = Some(times(repair.intrinsics_scale, scale));
                }
                Hypothesis::CenteredPrincipalPoint => {
                    remedy = Some(
                        "give the principal point of these very images, \
                                   most often their middle"
                            .to_owned(),
                    );
                }
                Hypothesis::SwappedIntrinsics => {
                    remedy = Some("exchange fx with fy and cx with cy".to_owned());
                }
                Hypothesis::Order(_) => {
                    remedy = Some(
                        "give images names whose alphabetical order is that of the \
                                   poses, with leading zeros"
                            .to_owned(),
                    );
                }
            }
        }
        let remedy = remedy.unwrap_or_else(|| run_with(&repair));
        let message = format!(
            "{}: so read, the cameras explain {} of {} {} instead of {}",
            reasons.join(", and "),
            percent(after),
            last.agreement.all.total,
            self.evidence().noun(),
            percent(given.share()),
        );
        Finding {
            repair: (repair != self.read_with).then_some(repair),
            ..Finding::new(Check::Poses, level, message)
        }
        .because(cause.unwrap_or(Cause::PosesDisagree))
        .remedied_by(remedy)
    }

    fn reason(&self, hypothesis: &Hypothesis) -> (Cause, String) {
        match hypothesis {
            Hypothesis::Convention { is, .. } => self.convention_reason(is),
            Hypothesis::FocalScale(scale) => (
                Cause::FocalLength,
                format!(
                    "the focal lengths are {:.3} times what they should be",
                    1.0 / scale
                ),
            ),
            Hypothesis::IntrinsicsScale(scale) => (
                Cause::ResizedImages,
                format!(
                    "the images are {scale} times as large as those that the intrinsics are for"
                ),
            ),
            Hypothesis::CenteredPrincipalPoint => (
                Cause::PrincipalPoint,
                "the principal point should be the middle of the images".into(),
            ),
            Hypothesis::SwappedIntrinsics => (
                Cause::SwappedIntrinsics,
                "the intrinsics of x and y have changed places".into(),
            ),
            Hypothesis::Order(order) => {
                let how = match order {
                    PoseOrder::Shifted(by) => format!("are shifted by {by}"),
                    PoseOrder::Reversed => "are in reverse order".into(),
                    PoseOrder::ByNumber => {
                        "follow the numbers in the image names, the images the alphabet".into()
                    }
                    PoseOrder::ByText => {
                        "follow the alphabet, the images the numbers in their names".into()
                    }
                };
                (Cause::ImageOrder, format!("the poses {how}"))
            }
        }
    }

    fn convention_reason(&self, is: &PoseConvention) -> (Cause, String) {
        let read_as = self.read_as();
        let axes = (is.axes != read_as.axes).then(|| match is.axes {
            CameraAxes::OPENGL => "the camera axes are OpenGL's, x right, y up, z back".to_owned(),
            CameraAxes::OPENCV => "the camera axes are OpenCV's, x right, y down, z forward".into(),
            axes => format!("the camera axes are {axes}"),
        });
        let direction = (is.direction != read_as.direction).then(|| match is.direction {
            PoseDirection::CameraToWorld => "the poses are camera-to-world".to_owned(),
            PoseDirection::WorldToCamera => "the poses are inverted, world-to-camera".into(),
            PoseDirection::TransposedRotation => {
                "the rotations are transposed, world-to-camera beside the cameras' centres".into()
            }
            PoseDirection::WorldToCameraTranslation => {
                "the translations are world-to-camera beside camera-to-world rotations".into()
            }
        });
        let mirrored = (self.mirrored || is.mirrored_world != read_as.mirrored_world)
            .then(|| "the poses are mirrored".to_owned());
        let cause = if mirrored.is_some() {
            Cause::MirroredPoses
        } else if direction.is_none() {
            Cause::CameraAxes
        } else if is.direction == PoseDirection::WorldToCamera {
            Cause::InvertedPoses
        } else {
            Cause::TransposedRotations
        };
        let reasons: Vec<_> = [mirrored, direction, axes].into_iter().flatten().collect();
        (cause, reasons.join(", "))
    }

    fn mirrored_without_repair(&self) -> Finding {
        let given = self
            .evidence()
            .agreement(&self.cameras, &self.all_trusted());
        let limits = Limits::of(self.evidence(), self.gathered.views.len());
        let finding = Finding::new(
            Check::Poses,
            Level::Problem,
            format!(
                "the poses are mirrored: in a mirrored world the cameras explain {} of {} {}",
                percent(given.share()),
                given.all.total,
                self.evidence().noun()
            ),
        )
        .because(Cause::MirroredPoses);
        if given.share() < limits.good_share {
            return finding.remedied_by("convert them to right-handed OpenCV axes");
        }
        Finding {
            repair: Some(self.read_with),
            ..finding.remedied_by(run_with(&self.read_with))
        }
    }

    /// Takes trust from views, the worst first, that explain next to nothing
    /// while the others do.
    fn without_bad_views(&self, mut trusted: Vec<bool>) -> Vec<bool> {
        let views = self.gathered.views.len();
        for _ in 0..views / 2 {
            let agreement = self.evidence().agreement(&self.cameras, &trusted);
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

    fn bad_views(&self, bad: &[usize], trusted: &[bool], rest: &Agreement) -> Finding {
        let fits: Vec<Option<usize>> = (bad.par_iter())
            .map(|&view| self.fitting_pose(view, bad, trusted, rest))
            .collect();
        let names: Vec<String> = bad
            .iter()
            .map(|&view| self.names[view].to_owned())
            .collect();
        let exchanged = fits.iter().flatten().count();
        let message = format!(
            "the poses of {} do not fit their images, the other {} agree",
            listed(&names),
            counted(self.gathered.views.len() - bad.len(), "view"),
        );
        let finding = Finding::new(Check::Poses, Level::Problem, message).of_views(names);
        if 2 * exchanged <= bad.len() {
            return finding.because(Cause::BadPose).remedied_by(
                "estimate these poses again, or take the images with their poses out of the scene",
            );
        }
        let which: Vec<String> = (bad.iter().zip(&fits))
            .filter_map(|(&view, fit)| Some((view, (*fit)?)))
            .take(4)
            .map(|(view, fit)| {
                format!(
                    "`{}` fits the pose of `{}`",
                    self.names[view], self.names[fit]
                )
            })
            .collect();
        finding.because(Cause::ImageOrder).remedied_by(format!(
            "give these images their poses back: {}",
            which.join(", ")
        ))
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

    fn disagreement(&self, given: &Agreement) -> Finding {
        let explained = format!(
            "the cameras explain {} of {} {}",
            percent(given.share()),
            given.all.total,
            self.evidence().noun()
        );
        if poses_follow_likeness(self.gathered, &self.cameras) {
            let message = format!(
                "{explained}, although views that look alike have poses alike: \
                 the poses are wrong in a way that is not known"
            );
            return Finding::new(Check::Poses, Level::Problem, message)
                .because(Cause::PosesDisagree)
                .remedied_by("estimate the poses again, for example with COLMAP");
        }
        let message = format!(
            "{explained}, and views that look alike have nothing in common in their poses: \
             images and poses are not in the same order, or of different scenes"
        );
        Finding::new(Check::Poses, Level::Problem, message)
            .because(Cause::ImageOrder)
            .remedied_by(
                "give images names whose alphabetical order is that of the poses, or name the \
                 image of every pose in cameras.json or transforms.json",
            )
    }

    fn too_little(&self, given: &Agreement) -> Finding {
        let message = format!(
            "cannot tell whether the cameras agree with the images: only {} {} in {}",
            given.all.total,
            self.evidence().noun(),
            counted(self.gathered.views.len(), "view"),
        );
        Finding::new(Check::Poses, Level::Note, message).because(Cause::TooLittleEvidence)
    }

    fn agreeing(&self, agreement: &Agreement, good: bool) -> Finding {
        let message = format!(
            "the cameras explain {} of {} {}",
            percent(agreement.share()),
            agreement.all.total,
            self.evidence().noun()
        );
        if good {
            return Finding::new(Check::Poses, Level::Good, message);
        }
        Finding::new(
            Check::Poses,
            Level::Warning,
            format!("{message}, few for right cameras but many for wrong ones"),
        )
        .because(Cause::PosesDisagree)
        .remedied_by("look at a few views for moving things, lens distortion or bad poses")
    }
}

/// A factor on top of the one there was, with four digits.
fn times(before: Option<f64>, scale: f64) -> f64 {
    (before.unwrap_or(1.0) * scale * 1e4).round() / 1e4
}

fn run_with(repair: &Repair) -> String {
    match repair.to_string().as_str() {
        "" => "run it without flags that change poses or intrinsics".into(),
        flags => format!("run it with `{flags}`"),
    }
}

/// Hypotheses about intrinsics that do not suit the size of their images.
fn of_intrinsics(cameras: &[Camera]) -> Vec<Hypothesis> {
    let camera = &cameras[0];
    let k = &camera.intrinsics;
    let scale_x = f64::from(camera.width) / (2.0 * k.cx);
    let scale_y = f64::from(camera.height) / (2.0 * k.cy);
    let mut hypotheses = Vec::new();
    let off = |scale: f64| (scale - 1.0).abs() > 0.1;
    if off(scale_x) || off(scale_y) {
        hypotheses.push(Hypothesis::CenteredPrincipalPoint);
        if scale_x > 0.0 && (scale_x / scale_y - 1.0).abs() < 0.15 {
            // Images are scaled by simple factors, principal points are not
            // quite in the middle.
            let scale = 0.5 * (scale_x + scale_y);
            let simple = [
                0.125,
                0.25,
                1.0 / 3.0,
                0.5,
                2.0 / 3.0,
                0.75,
                1.5,
                2.0,
                3.0,
                4.0,
                8.0,
            ];
            let near = simple
                .into_iter()
                .find(|simple| (scale / simple - 1.0).abs() < 0.08);
            let rounded = (near.unwrap_or(scale) * 1e4).round() / 1e4;
            hypotheses.push(Hypothesis::IntrinsicsScale(rounded));
        }
    }
    if (k.fx / k.fy - 1.0).abs() > 0.02 || (k.cx - k.cy).abs() > 0.02 * k.fx {
        hypotheses.push(Hypothesis::SwappedIntrinsics);
    }
    hypotheses
}
