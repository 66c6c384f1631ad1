//! What an examination found, for people and for programs.

use neat_core::layout::PoseConvention;
use neat_core::{LoadOptions, Scene};
use serde::Serialize;
use std::fmt;

/// How serious a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Level {
    /// As it should be.
    Good,
    /// Worth knowing.
    Note,
    /// The result may be worse for it.
    Warning,
    /// Hours spent on this scene are lost.
    Problem,
}

/// What was looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Check {
    /// Whether the scene can be read at all.
    Files,
    /// Poses and intrinsics against what the images show.
    Poses,
    /// Points of the reconstruction against their observations.
    SparsePoints,
    /// Intrinsics against the sizes of the images.
    Intrinsics,
    /// Sizes of the images.
    ImageSizes,
    /// Brightness of the images.
    Exposure,
    /// Blur.
    Sharpness,
    /// Images that occur twice.
    Duplicates,
    /// Where the cameras stand.
    Coverage,
    /// The ball that holds the scene, against the cameras.
    SceneSphere,
    /// 2D segments of the views.
    Segments,
}

/// Why something is not as it should be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Cause {
    /// A file or folder is not there.
    MissingFile,
    /// More or fewer images than poses.
    CountMismatch,
    /// A file that ends too early or breaks its format.
    DamagedFile,
    /// NaN or an infinite number.
    NotFinite,
    /// A 3×3 part that is no rotation.
    NotRigid,
    /// A left-handed world or left-handed cameras.
    MirroredPoses,
    /// World-to-camera matrices read as camera-to-world.
    InvertedPoses,
    /// Rotation and translation lead into different directions.
    TransposedRotations,
    /// Quaternions whose real part was taken for another one.
    QuaternionOrder,
    /// Camera axes other than x right, y down, z forward.
    CameraAxes,
    /// The focal length.
    FocalLength,
    /// fx or fy alone.
    PixelAspect,
    /// Photographs of a lens that bends straight lines, taken for those of a pinhole.
    LensDistortion,
    /// The principal point.
    PrincipalPoint,
    /// fx and fy, cx and cy stand in each other's place.
    SwappedIntrinsics,
    /// Images that were turned after the cameras were estimated, or before.
    TurnedImages,
    /// Images of another size than those that the intrinsics are for.
    ResizedImages,
    /// Images and poses that are not in the same order.
    ImageOrder,
    /// Single views whose poses are wrong.
    BadPose,
    /// Images and poses that do not agree, for no reason found.
    PosesDisagree,
    /// 2D wireframes that were made from other images.
    SegmentsOfOtherImages,
    /// Too little can be seen to judge.
    TooLittleEvidence,
    /// A fault of another kind.
    Other,
}

/// What to read a scene with so that a finding is repaired, as a whole: it takes
/// the place of what the scene was read with before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Repair {
    /// For [`LoadOptions::pose_convention`].
    pub pose_convention: Option<PoseConvention>,
    /// For [`LoadOptions::focal_scale`].
    pub focal_scale: Option<f64>,
    /// For [`LoadOptions::intrinsics_scale`].
    pub intrinsics_scale: Option<f64>,
}

impl Repair {
    /// What these options already correct.
    pub fn of(options: &LoadOptions) -> Self {
        Self {
            pose_convention: options.pose_convention,
            focal_scale: options.focal_scale,
            intrinsics_scale: options.intrinsics_scale,
        }
    }

    /// The options with this repair.
    pub fn apply(&self, options: &LoadOptions) -> LoadOptions {
        LoadOptions {
            pose_convention: self.pose_convention.or(options.pose_convention),
            focal_scale: self.focal_scale.or(options.focal_scale),
            intrinsics_scale: self.intrinsics_scale.or(options.intrinsics_scale),
            ..options.clone()
        }
    }
}

impl fmt::Display for Repair {
    /// As flags of the command line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut flags = Vec::new();
        if let Some(convention) = self.pose_convention {
            let standard = PoseConvention::default();
            if convention.direction != standard.direction {
                flags.push(format!("--poses {}", convention.direction));
            }
            if convention.axes != standard.axes {
                flags.push(format!("--camera-axes {}", convention.axes));
            }
            if convention.mirrored_world {
                flags.push("--mirrored-world".into());
            }
        }
        if let Some(scale) = self.focal_scale {
            flags.push(format!("--focal-scale {scale}"));
        }
        if let Some(scale) = self.intrinsics_scale {
            flags.push(format!("--intrinsics-scale {scale}"));
        }
        f.write_str(&flags.join(" "))
    }
}

/// One result of a check.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// What was looked at.
    pub check: Check,
    /// How serious it is.
    pub level: Level,
    /// Why, where something is wrong.
    pub cause: Option<Cause>,
    /// One sentence with the numbers.
    pub message: String,
    /// What to do about it.
    pub remedy: Option<String>,
    /// The flags that repair it, where there are any.
    pub repair: Option<Repair>,
    /// Names of the views that it is about, where it is not about all.
    pub views: Vec<String>,
}

impl Finding {
    pub(crate) fn new(check: Check, level: Level, message: impl Into<String>) -> Self {
        Self {
            check,
            level,
            cause: None,
            message: message.into(),
            remedy: None,
            repair: None,
            views: Vec::new(),
        }
    }

    /// A warning for none of the causes that have a name.
    pub(crate) fn warning(check: Check, message: String, remedy: &str) -> Self {
        Self::new(check, Level::Warning, message)
            .because(Cause::Other)
            .remedied_by(remedy)
    }

    /// Whether nothing, or nothing but another order of the images, explains what they show.
    pub(crate) fn is_unexplained(&self) -> bool {
        let cause = matches!(self.cause, Some(Cause::PosesDisagree | Cause::ImageOrder));
        self.level == Level::Problem && self.views.is_empty() && cause
    }

    pub(crate) fn because(mut self, cause: Cause) -> Self {
        self.cause = Some(cause);
        self
    }

    pub(crate) fn remedied_by(mut self, remedy: impl Into<String>) -> Self {
        self.remedy = Some(remedy.into());
        self
    }

    pub(crate) fn of_views(mut self, views: Vec<String>) -> Self {
        self.views = views;
        self
    }
}

/// What to do with the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Nothing stands against a run.
    Ready,
    /// A run makes sense; the warnings may improve it.
    ReadyWithWarnings,
    /// A run is lost time before the problems are solved.
    NotReady,
}

/// Everything that was found about a scene.
///
/// Its [`Display`](fmt::Display) is a plain text of aligned lines that ends with
/// the verdict.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Examination {
    /// Name of the scene.
    pub scene: String,
    /// How many views it has; 0 if it cannot be read.
    pub views: usize,
    /// In the order of the checks.
    pub findings: Vec<Finding>,
    /// What follows from them.
    pub verdict: Verdict,
}

impl Examination {
    /// With the verdict that follows from the findings.
    pub fn new(scene: impl Into<String>, views: usize, findings: Vec<Finding>) -> Self {
        let worst = findings.iter().map(|finding| finding.level).max();
        let verdict = match worst {
            Some(Level::Problem) => Verdict::NotReady,
            Some(Level::Warning) => Verdict::ReadyWithWarnings,
            _ => Verdict::Ready,
        };
        Self {
            scene: scene.into(),
            views,
            findings,
            verdict,
        }
    }

    /// The problems.
    pub fn problems(&self) -> impl Iterator<Item = &Finding> {
        self.at(Level::Problem)
    }

    /// The findings of one level.
    pub fn at(&self, level: Level) -> impl Iterator<Item = &Finding> {
        self.findings.iter().filter(move |f| f.level == level)
    }
}

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Good => "good",
            Self::Note => "note",
            Self::Warning => "warning",
            Self::Problem => "PROBLEM",
        })
    }
}

impl fmt::Display for Check {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Files => "files",
            Self::Poses => "poses",
            Self::SparsePoints => "sparse points",
            Self::Intrinsics => "intrinsics",
            Self::ImageSizes => "image sizes",
            Self::Exposure => "exposure",
            Self::Sharpness => "sharpness",
            Self::Duplicates => "duplicates",
            Self::Coverage => "coverage",
            Self::SceneSphere => "scene sphere",
            Self::Segments => "2D segments",
        })
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:<8} {:<13} {}", self.level, self.check, self.message)?;
        if let Some(remedy) = &self.remedy {
            write!(f, "\n{:<8} {:<13} → {remedy}", "", "")?;
        }
        Ok(())
    }
}

impl fmt::Display for Examination {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.views {
            0 => writeln!(f, "{} cannot be read", self.scene)?,
            views => writeln!(f, "{} has {views} views", self.scene)?,
        }
        for finding in &self.findings {
            writeln!(f, "{finding}")?;
        }
        let warnings = self.at(Level::Warning).count();
        match self.verdict {
            Verdict::Ready => f.write_str("Verdict: ready."),
            Verdict::ReadyWithWarnings => {
                write!(f, "Verdict: ready, with {}.", counted(warnings, "warning"))
            }
            Verdict::NotReady => write!(
                f,
                "Verdict: not ready, {} to solve first.",
                counted(self.problems().count(), "problem")
            ),
        }
    }
}

/// `1 view`, `2 views`.
pub(crate) fn counted(count: usize, noun: &str) -> String {
    let ending = if count == 1 { "" } else { "s" };
    format!("{count} {noun}{ending}")
}

/// The upper median; 0 of nothing.
pub(crate) fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Names of the views for which `holds` does.
pub(crate) fn views_where(scene: &Scene, holds: impl Fn(usize) -> bool) -> Vec<String> {
    let views = scene.views.iter().enumerate();
    let chosen = views.filter(|(view, _)| holds(*view));
    chosen.map(|(_, view)| view.name.clone()).collect()
}

/// Names in backticks, the first few of many.
pub(crate) fn listed(names: &[String]) -> String {
    const SHOWN: usize = 5;
    let mut text: Vec<String> = names.iter().take(SHOWN).map(|n| format!("`{n}`")).collect();
    if names.len() > SHOWN {
        text.push(format!("{} more", names.len() - SHOWN));
    }
    text.join(", ")
}

/// A share as a percentage without digits that mean nothing.
pub(crate) fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    if (0.05..9.95).contains(&percent) {
        format!("{percent:.1} %")
    } else {
        format!("{percent:.0} %")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_finding_decides_and_the_text_ends_with_the_verdict() {
        let warning =
            Finding::new(Check::Exposure, Level::Warning, "it is dark").remedied_by("light it");
        let problem = Finding::new(Check::Poses, Level::Problem, "they are wrong");
        let examination = Examination::new("box", 3, vec![warning.clone()]);
        assert_eq!(examination.verdict, Verdict::ReadyWithWarnings);
        let text = examination.to_string();
        assert!(
            text.contains("warning  exposure      it is dark\n"),
            "{text}"
        );
        assert!(
            text.ends_with("→ light it\nVerdict: ready, with 1 warning."),
            "{text}"
        );
        let examination = Examination::new("box", 3, vec![warning, problem]);
        assert_eq!(examination.verdict, Verdict::NotReady);
        let json = serde_json::to_value(&examination).unwrap();
        assert_eq!(json["verdict"], "not-ready");
        assert_eq!(json["findings"][1]["check"], "poses");
    }

    #[test]
    fn repairs_read_as_flags() {
        let repair = Repair {
            pose_convention: Some(PoseConvention {
                direction: neat_core::layout::PoseDirection::WorldToCamera,
                axes: neat_core::layout::CameraAxes::OPENGL,
                mirrored_world: false,
            }),
            focal_scale: Some(0.5),
            intrinsics_scale: None,
        };
        assert_eq!(
            repair.to_string(),
            "--poses world-to-camera --camera-axes right-up-back --focal-scale 0.5"
        );
    }
}
