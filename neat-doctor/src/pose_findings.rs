//! What is said about poses and intrinsics that disagree with the images.

use crate::agreement::Agreement;
use crate::examination::{Cause, Check, Finding, Level, Repair, counted, listed, percent};
use crate::hypothesis::{Hypothesis, PoseOrder};
use crate::likeness::poses_follow_likeness;
use crate::pose_diagnosis::{Candidate, Diagnosis};
use crate::view_faults::ViewFault;
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
                _ => remedy = Some(by_hand(&candidate.hypothesis).to_owned()),
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
            Hypothesis::Quaternions(order) => (
                Cause::QuaternionOrder,
                format!(
                    "the quaternions have their real part {}",
                    if order.real_first {
                        "first, as w x y z, and were read as x y z w"
                    } else {
                        "last, as x y z w, and were read as w x y z"
                    }
                ),
            ),
            Hypothesis::CentersAsTranslations => (
                Cause::TransposedRotations,
                "the cameras' centres stand where world-to-camera translations are read".into(),
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
            hypothesis => reason_of_images(hypothesis),
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

    /// That some views do not fit; `faults` says of each why, where that is known.
    pub fn bad_views(&self, bad: &[usize], faults: &[Option<ViewFault>]) -> Finding {
        let names: Vec<String> = bad
            .iter()
            .map(|&view| self.names[view].to_owned())
            .collect();
        let message = format!(
            "the poses of {} do not fit their images, the other {} agree",
            listed(&names),
            counted(self.gathered.views.len() - bad.len(), "view"),
        );
        let finding = |message| Finding::new(Check::Poses, Level::Problem, message);
        let known: Vec<(&str, &ViewFault)> = (bad.iter().zip(faults))
            .filter_map(|(&view, fault)| Some((self.names[view], fault.as_ref()?)))
            .collect();
        let exchanged: Vec<String> = (known.iter())
            .filter_map(|(name, fault)| match fault {
                ViewFault::PoseOf(other) => Some(format!(
                    "`{name}` fits the pose of `{}`",
                    self.names[*other]
                )),
                ViewFault::Camera(_) => None,
            })
            .collect();
        if 2 * exchanged.len() > bad.len() {
            return finding(message)
                .of_views(names)
                .because(Cause::ImageOrder)
                .remedied_by(format!(
                    "give these images their poses back: {}",
                    exchanged[..exchanged.len().min(4)].join(", ")
                ));
        }
        let of_camera = known.iter().find_map(|(name, fault)| match fault {
            ViewFault::Camera(hypothesis) => Some((name, hypothesis)),
            ViewFault::PoseOf(_) => None,
        });
        if let Some((name, hypothesis)) = of_camera
            && 2 * known.len() > bad.len()
        {
            let (cause, reason) = self.reason(hypothesis);
            return finding(format!("{message}: of `{name}` {reason}"))
                .of_views(names)
                .because(cause)
                .remedied_by(by_hand(hypothesis));
        }
        finding(message)
            .of_views(names)
            .because(Cause::BadPose)
            .remedied_by(
                "estimate these poses again, or take the images with their poses out of the scene",
            )
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

/// Why images do not suit their intrinsics, where neither a flag nor a swap repairs it.
fn reason_of_images(hypothesis: &Hypothesis) -> (Cause, String) {
    match hypothesis {
        Hypothesis::SquarePixels { by_fx } => (
            Cause::PixelAspect,
            format!(
                "the pixels are square, and {} is right for both axes",
                if *by_fx { "fx" } else { "fy" }
            ),
        ),
        Hypothesis::Lens(strength) => (
            Cause::LensDistortion,
            format!(
                "a lens bends straight lines: it moves the middles of the sides by {}",
                percent(strength.abs())
            ),
        ),
        Hypothesis::StretchedImages([x, y]) => (
            Cause::ResizedImages,
            format!(
                "the images are {x:.3} times as wide and {y:.3} times as high as those that \
                 the intrinsics are for"
            ),
        ),
        Hypothesis::CutImages([left, above]) => (
            Cause::PrincipalPoint,
            format!(
                "the images were cut: {left:.0} pixels are missing at their left and \
                 {above:.0} above"
            ),
        ),
        Hypothesis::TurnedImages(quarters) => (
            Cause::TurnedImages,
            format!("the images were turned clockwise by {}°", 90 * quarters),
        ),
        _ => (Cause::PosesDisagree, "the cameras are others".into()),
    }
}

/// What to do where no flag repairs it.
fn by_hand(hypothesis: &Hypothesis) -> &'static str {
    match hypothesis {
        Hypothesis::Quaternions(_) => "read or write the four numbers in the other order",
        Hypothesis::CentersAsTranslations => {
            "give −R times the centre as the translation beside a world-to-camera rotation R"
        }
        Hypothesis::SquarePixels { .. } => "give one focal length for both axes",
        Hypothesis::Lens(_) => {
            "undistort the images, or give the lens: COLMAP's models and transforms.json hold one"
        }
        Hypothesis::StretchedImages(_) => {
            "give intrinsics of these very images: fx and cx times the one factor, fy and cy \
             times the other"
        }
        Hypothesis::CutImages(_) => {
            "take the missing pixels off cx and cy, or give the images that were not cut"
        }
        Hypothesis::TurnedImages(_) => {
            "turn the images back: most often one program followed the orientation in their EXIF \
             data and another did not"
        }
        Hypothesis::CenteredPrincipalPoint => {
            "give the principal point of these very images, most often their middle"
        }
        Hypothesis::SwappedIntrinsics => "exchange fx with fy and cx with cy",
        Hypothesis::Order(_) => {
            "give images names whose alphabetical order is that of the poses, with leading zeros"
        }
        Hypothesis::FocalScale(_) | Hypothesis::IntrinsicsScale(_) => {
            "give the intrinsics of these very images"
        }
        Hypothesis::Convention { .. } => "convert the poses",
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
