//! What a report shows.

use crate::photograph::{Photograph, PhotographConfig, photographs};
use crate::{ReportError, check, page};
use nalgebra::Vector3;
use neat_core::{Camera, LineSegment2, Scene, file};
use neat_wireframe::export::WireframeDocument;
use std::path::Path;

/// Everything that a report shows. Positions and poses are in the frame and unit of
/// the user's files.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// What was reconstructed: the name of the scene.
    pub title: String,
    /// The wireframe with what is known about its parts. `edge_fields` can colour
    /// it: `probability`, `supporting_views` and `residual_in_pixels` have words of
    /// their own, other fields appear under their names. `edge_support` shows in
    /// which photographs a segment was seen.
    pub document: WireframeDocument,
    /// The cameras.
    pub views: Vec<ReportView>,
    /// Image coordinates of the centre of pixel (0, 0), see
    /// [`Scene::pixel_center`].
    pub pixel_center: f64,
    /// Where the junctions were during training, by step. At most
    /// [`Self::MAX_SNAPSHOTS`] of them are shown, spread evenly.
    pub junction_evolution: Vec<JunctionSnapshot>,
    /// Losses and other figures over the steps of the training. At most
    /// [`Self::MAX_CURVE_POINTS`] points of each are shown.
    pub curves: Vec<Curve>,
    /// The configuration as TOML.
    pub configuration: String,
    /// Facts such as device, seed, times and scores, in the order to be shown.
    pub facts: Vec<FactGroup>,
    /// What a person should know before they trust the result; whole sentences.
    pub warnings: Vec<String>,
}

/// A camera of a report.
#[derive(Clone, Debug)]
pub struct ReportView {
    /// Its name, as in [`WireframeDocument::views`].
    pub name: String,
    /// Intrinsics, image size, and pose in the frame of the user's files.
    pub camera: Camera,
    /// The photograph, undistorted; `None` to show 2D segments on grey instead.
    pub photograph: Option<Photograph>,
    /// The 2D wireframe, in image coordinates of the whole image; may be empty.
    pub segments: Vec<LineSegment2>,
}

/// Where the junctions were at one step of the training.
#[derive(Clone, Debug, PartialEq)]
pub struct JunctionSnapshot {
    /// The step.
    pub step: u64,
    /// Positions. Those that are not finite are not shown.
    pub junctions: Vec<[f32; 3]>,
}

/// A figure over the steps of the training.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// What it is, such as "colour loss".
    pub name: String,
    /// (step, value), by step. Values that are not finite leave a gap.
    pub points: Vec<(u64, f64)>,
}

/// Facts under a common heading.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FactGroup {
    /// The heading, such as "Run" or "Seconds".
    pub heading: String,
    /// (label, value) in the order to be shown.
    pub facts: Vec<(String, String)>,
}

impl Report {
    /// So many snapshots of the junctions are embedded.
    pub const MAX_SNAPSHOTS: usize = 60;
    /// So many points of every curve are embedded.
    pub const MAX_CURVE_POINTS: usize = 600;

    /// A report on a scene and its wireframe, which is in the frame of the user's
    /// files already. 2D segments with a score above `min_segment_score` are shown.
    /// Curves, facts, warnings and configuration are left to be filled.
    ///
    /// # Errors
    /// If a photograph cannot be encoded.
    pub fn of_scene(
        scene: &Scene,
        document: WireframeDocument,
        min_segment_score: f64,
        config: &PhotographConfig,
    ) -> Result<Self, ReportError> {
        let views = (scene.views.iter().zip(photographs(scene, config)?))
            .map(|(view, photograph)| ReportView {
                name: view.name.clone(),
                camera: scene.original_from_world.apply_to_camera(&view.camera),
                photograph,
                segments: (view.wireframe.segments(min_segment_score).iter())
                    .map(|scored| scored.segment)
                    .collect(),
            })
            .collect();
        Ok(Self {
            title: scene.name.clone(),
            document,
            views,
            pixel_center: scene.pixel_center,
            ..Self::default()
        })
    }

    /// The page.
    ///
    /// # Errors
    /// If a number is not finite, an index or a field does not fit the wireframe, an
    /// edge is supported by a view that is not there, or a camera makes no sense.
    pub fn render(&self) -> Result<String, ReportError> {
        check::check(self)?;
        page::render(self)
    }

    /// The script and the style that are in every page, as sources of a content security
    /// policy: who shows a report in a frame that it fills itself has to allow them.
    ///
    /// ```
    /// let [script, style] = neat_report::Report::policy_sources();
    /// assert!(script.starts_with("sha256-") && style.starts_with("sha256-"));
    /// ```
    pub fn policy_sources() -> [String; 2] {
        page::sources()
    }

    /// Writes the page, completely or not at all.
    ///
    /// # Errors
    /// As [`Self::render`], or if the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), ReportError> {
        Ok(file::write_atomically(path, self.render()?.as_bytes())?)
    }
}

impl JunctionSnapshot {
    /// The positions of `junctions` after `step` steps.
    pub fn new<'a>(step: u64, junctions: impl IntoIterator<Item = &'a Vector3<f64>>) -> Self {
        let single = |point: &Vector3<f64>| [point.x, point.y, point.z].map(|x| x as f32);
        Self {
            step,
            junctions: junctions.into_iter().map(single).collect(),
        }
    }
}
