//! The examination of a scene, and of a folder that should hold one.

use crate::capture_checks::capture_findings;
use crate::evidence::{Gathered, evenly, gather, is_textured};
use crate::examination::{Cause, Check, Examination, Finding, Level, Repair};
use crate::image_checks::image_findings;
use crate::load_failure::{explain, size_factor};
use crate::point_looks::PointLooks;
use crate::pose_diagnosis::Diagnosis;
use crate::segment_checks::segment_findings;
use crate::working_copies::WorkingCopies;
use neat_core::layout::CameraAxes;
use neat_core::{
    CameraError, LoadOptions, LoadedScene, MemoryLimit, Scene, SceneError, ViewError, load_scene,
};
use std::path::Path;
use tracing::{debug, debug_span};

/// How thoroughly to look.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Depth {
    /// At some views; thoroughly only if their cameras do not agree with them.
    /// A second or two.
    Quick,
    /// At up to 60 photographs or 300 images of things without texture.
    #[default]
    Full,
}

/// How [`examine`] looks at a scene. There may be more of it one day: write
/// `..ExamineOptions::default()`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ExamineOptions {
    /// How thoroughly.
    pub depth: Depth,
    /// What the scene was read with: remedies name what to use instead.
    pub read_with: Repair,
    /// The axes that its cameras have in the files, which their reader turned into OpenCV's: what
    /// [`LoadedScene::file_axes`] says.
    pub file_axes: CameraAxes,
    /// How much memory may be used: views are looked at one after the other where it is
    /// little. What is found does not depend on it.
    pub memory_limit: MemoryLimit,
}

/// Views that are looked at: photographs, of which each is matched with all
/// others, and images without texture.
const FULL_PHOTOGRAPHS: usize = 60;
const FULL_VIEWS: usize = 300;
const QUICK_VIEWS: usize = 30;
/// Photographs take longer: two runs of neighbours, by their names.
const QUICK_RUN: usize = 6;

/// Examines a scene: its cameras against its images, and both by themselves.
///
/// The same scene gives the same examination, for any number of threads.
///
/// ```
/// use neat_core::synthetic::{SyntheticScene, generate};
/// use neat_doctor::{ExamineOptions, Level, examine};
///
/// let scene = generate(&SyntheticScene { views: 24, image_size: 256, ..Default::default() })?.scene;
/// let examination = examine(&scene, &ExamineOptions::default());
/// assert_eq!(examination.problems().count(), 0, "{examination}");
/// # Ok::<(), neat_core::synthetic::SyntheticError>(())
/// ```
pub fn examine(scene: &Scene, options: &ExamineOptions) -> Examination {
    examine_as(scene, options, false)
}

/// `mirrored` if the poses could only be read by mirroring their world.
fn examine_as(scene: &Scene, options: &ExamineOptions, mirrored: bool) -> Examination {
    if let Err(error) = scene.validate() {
        let findings = vec![explain(&error)];
        return Examination::new(&scene.name, scene.views.len(), findings);
    }
    let findings = findings(scene, options, mirrored).unwrap_or_else(|error| vec![explain(&error)]);
    Examination::new(&scene.name, scene.views.len(), findings)
}

fn findings(
    scene: &Scene,
    options: &ExamineOptions,
    mirrored: bool,
) -> Result<Vec<Finding>, SceneError> {
    let _span = debug_span!("examine", scene = scene.name, views = scene.views.len()).entered();
    let working = WorkingCopies::new(scene, options.memory_limit);
    let mut findings = pose_findings(scene, &working, options, mirrored)?;
    let of_images = image_findings(scene, &working)?;
    // Images that show nothing say nothing about poses.
    let before = of_images.iter().any(|f| f.level == Level::Problem);
    let at = if before { 0 } else { findings.len() };
    findings.splice(at..at, of_images);
    findings.extend(capture_findings(scene));
    findings.extend(segment_findings(scene, &working)?);
    for Finding { level, message, .. } in &findings {
        debug!(%level, "{message}");
    }
    Ok(findings)
}

fn pose_findings(
    scene: &Scene,
    working: &WorkingCopies<'_>,
    options: &ExamineOptions,
    mirrored: bool,
) -> Result<Vec<Finding>, SceneError> {
    let count = scene.views.len();
    let textured = is_textured(working, &evenly(count, QUICK_VIEWS))?;
    debug!(textured, "what the images show");
    if options.depth == Depth::Quick {
        let views = if textured && count > 2 * QUICK_RUN {
            let second = count / 2;
            (0..QUICK_RUN).chain(second..second + QUICK_RUN).collect()
        } else {
            evenly(count, QUICK_VIEWS)
        };
        let gathered = gather(scene, working, views, textured)?;
        let diagnosis = diagnosis(scene, &gathered, options, mirrored);
        if diagnosis.is_plainly_good() {
            return Ok(diagnosis.agreeing_findings());
        }
    }
    let limit = if textured {
        FULL_PHOTOGRAPHS
    } else {
        FULL_VIEWS
    };
    let diagnosed = |limit: usize, textured: bool| {
        let gathered = gather(scene, working, evenly(count, limit), textured)?;
        Ok(diagnosis(scene, &gathered, options, mirrored).findings())
    };
    let findings = diagnosed(limit, textured)?;
    if textured && findings.iter().any(Finding::is_unexplained) {
        // Things that look the same from several sides are matched wrongly, however often:
        // where corners without any match agree, or points of the files, they are right.
        let of_corners: Vec<Finding> = diagnosed(FULL_VIEWS, false)?;
        if of_corners
            .iter()
            .all(|finding| finding.level == Level::Good)
        {
            return Ok(of_corners);
        }
        if let Some(message) = PointLooks::new(scene, working, &[])?.for_all() {
            return Ok(vec![Finding::new(Check::Poses, Level::Good, message)]);
        }
    }
    without_views_that_points_speak_for(scene, working, findings)
}

/// Drops what is said against the poses of some views, if sparse points look as they should in all
/// of these.
fn without_views_that_points_speak_for(
    scene: &Scene,
    working: &WorkingCopies<'_>,
    mut findings: Vec<Finding>,
) -> Result<Vec<Finding>, SceneError> {
    let accused = |finding: &Finding| finding.cause == Some(Cause::BadPose);
    if let Some(at) = findings.iter().position(accused) {
        let named = |name: &String| scene.views.iter().position(|view| view.name == *name);
        let views: Vec<usize> = findings[at].views.iter().filter_map(named).collect();
        let looks = PointLooks::new(scene, working, &views)?;
        if !views.is_empty() && views.iter().all(|view| looks.for_view(*view)) {
            findings.remove(at);
        }
    }
    Ok(findings)
}

fn diagnosis<'a>(
    scene: &'a Scene,
    gathered: &'a Gathered,
    options: &ExamineOptions,
    mirrored: bool,
) -> Diagnosis<'a> {
    let (read_with, file_axes) = (options.read_with, options.file_axes);
    Diagnosis::new(scene, gathered, read_with, file_axes, mirrored)
}

/// Reads the scene in the folder `dir` and examines it. A scene that cannot be
/// read is explained; where its poses are mirrored or its images scaled, it is
/// read in spite of that to find the repair. What `load` already corrects takes
/// the place of [`ExamineOptions::read_with`].
pub fn examine_folder(
    dir: impl AsRef<Path>,
    load: &LoadOptions,
    options: &ExamineOptions,
) -> Examination {
    let dir = dir.as_ref();
    let error = match load_scene(dir, load) {
        Ok(loaded) => return examine_loaded(&loaded, load, options),
        Err(error) => error,
    };
    let unreadable = |finding| {
        let name = dir.file_name().unwrap_or(dir.as_os_str());
        Examination::new(name.to_string_lossy(), 0, vec![finding])
    };
    let mirrored = matches!(
        &error,
        SceneError::View {
            problem: ViewError::Camera(CameraError::Mirrored { .. }),
            ..
        }
    );
    if mirrored {
        let mut convention = load.pose_convention.unwrap_or_default();
        convention.mirrored_world = !convention.mirrored_world;
        let again = LoadOptions {
            pose_convention: Some(convention),
            ..load.clone()
        };
        // If only some poses are mirrored, others fail now: the first error holds.
        if let Ok(loaded) = load_scene(dir, &again) {
            return examine_loaded_as(&loaded, &again, options, true);
        }
    }
    if let Some(scale) = size_factor(&error) {
        let scale = scale * load.intrinsics_scale.unwrap_or(1.0);
        let repair = Repair {
            intrinsics_scale: Some(scale),
            ..Repair::default()
        };
        let again = repair.apply(load);
        if let Ok(loaded) = load_scene(dir, &again) {
            let repair = Repair::of(&again);
            let mut finding = explain(&error);
            finding.repair = Some(repair);
            finding.remedy = Some(format!("run it with `{repair}`"));
            let rest = examine_loaded(&loaded, &again, options);
            let findings = [vec![finding], rest.findings].concat();
            return Examination::new(rest.scene, rest.views, findings);
        }
    }
    unreadable(explain(&error))
}

/// [`examine_folder`] of a scene that has been read, with `load`.
pub fn examine_loaded(
    loaded: &LoadedScene,
    load: &LoadOptions,
    options: &ExamineOptions,
) -> Examination {
    examine_loaded_as(loaded, load, options, false)
}

/// What was noticed while reading comes before the other findings.
fn examine_loaded_as(
    loaded: &LoadedScene,
    load: &LoadOptions,
    options: &ExamineOptions,
    mirrored: bool,
) -> Examination {
    let options = ExamineOptions {
        read_with: Repair::of(load),
        file_axes: loaded.file_axes,
        ..*options
    };
    let examination = examine_as(&loaded.scene, &options, mirrored);
    let notes = (loaded.warnings.iter())
        .map(|warning| Finding::new(Check::Files, Level::Note, warning.to_string()));
    let findings = notes.chain(examination.findings).collect();
    Examination::new(examination.scene, examination.views, findings)
}
