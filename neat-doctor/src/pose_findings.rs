//! What is said about poses and intrinsics that disagree with the images.

use crate::agreement::Agreement;
use crate::examination::{Cause, Check, Finding, Level, Repair, counted, listed, percent};
use crate::hypothesis::{Hypothesis, PoseOrder};
use crate::likeness::poses_follow_likeness;
use crate::pose_diagnosis::{Candidate, Diagnosis};
use neat_core::layout::{CameraAxes, PoseConvention, PoseDirection};

/// A focal length further off than this, as a factor, spoils every result.
const BAD_FOCAL_FACTOR: f64 = 1.08;

impl Diagnosis<'_> {
    /// Says what the candidates, each on top of the one before, repair.
    pub fn explained_by(&self, candidates: Vec<Candidate>, given: &Agreement) -> Finding {
        let Some(last) = candidates.last() else {
            return self.disagreement(given);
        };
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
            "{}: so read, {} instead of {}",
            reasons.join(", and "),
            self.explained(&last.agreement),
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

    /// That mirroring the world, as was done to read the poses, repairs them, or
    /// that nothing does.
    pub fn mirrored_as_read(&self) -> Finding {
        let given = self.all_given();
        let message = format!(
            "the poses are mirrored: in a mirrored world {}",
            self.explained(&given)
        );
        let finding = Finding::new(Check::Poses, Level::Problem, message);
        let finding = finding.because(Cause::MirroredPoses);
        if given.share() < self.limits().bad_share {
            return finding.remedied_by("convert them to right-handed OpenCV axes");
        }
        Finding {
            repair: Some(self.read_with),
            ..finding.remedied_by(run_with(&self.read_with))
        }
    }

    /// That some views do not fit; `fits` says of each the view whose pose it
    /// fits instead, if there is one.
    pub fn bad_views(&self, bad: &[usize], fits: &[Option<usize>]) -> Finding {
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
        let which: Vec<String> = (bad.iter().zip(fits))
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

    /// That nothing is known to explain the images.
    pub fn disagreement(&self, given: &Agreement) -> Finding {
        let explained = self.explained(given);
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

    /// That the images show too little.
    pub fn too_little(&self, given: &Agreement) -> Finding {
        let message = format!(
            "cannot tell whether the cameras agree with the images: only {} {} in {}",
            given.all.total,
            self.evidence().noun(),
            counted(self.gathered.views.len(), "view"),
        );
        Finding::new(Check::Poses, Level::Note, message).because(Cause::TooLittleEvidence)
    }

    /// How well the cameras agree; `good` if that is enough.
    pub fn agreeing(&self, agreement: &Agreement, good: bool) -> Finding {
        let explained = self.explained(agreement);
        if good {
            return Finding::new(Check::Poses, Level::Good, explained);
        }
        let message = format!("{explained}, few for right cameras but many for wrong ones");
        Finding::new(Check::Poses, Level::Warning, message)
            .because(Cause::PosesDisagree)
            .remedied_by("look at a few views for moving things, lens distortion or bad poses")
    }

    fn explained(&self, agreement: &Agreement) -> String {
        format!(
            "the cameras explain {} of {} {}",
            percent(agreement.share()),
            agreement.all.total,
            self.evidence().noun()
        )
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
