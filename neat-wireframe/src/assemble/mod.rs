//! The assembler: from posed views with 2D segments and edgels to the wireframe that the
//! images show.
//!
//! The 2D segments propose lines in space, matched across views by the epipolar geometry
//! (Hofer, Maurer and Bischof, *Efficient 3D scene abstraction using line segments*,
//! Line3D++, 2017), or by a field that says which of them show one edge. The images decide:
//! the line that they speak for most is fitted to the edgels of all views at once, takes them,
//! and the next one is chosen by those that are left. Lines that bend are chords of curves, of
//! which arcs are followed, and those that move aside from view to view are outlines of round
//! things. Where photographs are at hand, lines are placed where the light changes, and edges
//! that run beside them are added. Lines turn to the directions that many have. Ends that meet
//! become corners, all corners are fitted to the edgels together, and edges are cut where others
//! end on them or cross them; the pieces, each by what shows it, are fitted once more.
//!
//! Edgels are so noisy as the scene's poses and images make them, which the first lines tell;
//! how near to a line is near are multiples of that. Along edges, ends have windows in
//! pixels. Unless a comment says so, no constant has been measured on its own.
//!
//! All steps work in a world whose scene ball is the unit ball around the origin.

mod arc_between_tangents;
mod arc_covariance;
mod arc_crossings;
mod arc_ends;
mod arc_joints;
mod arc_pieces;
mod arc_tubes;
mod arcs;
mod candidate_queue;
mod circle_fitting;
mod claimed_edgels;
mod coaxial_rims;
mod collinear_pieces;
mod common_directions;
mod config;
mod corner_ways;
mod corners;
mod curve_pieces;
mod curve_samples;
mod curved_edges;
mod curves;
mod depth_votes;
mod domes;
mod edge_completion;
mod edge_cutting;
mod edge_samples;
mod ellipses;
mod epipolar_matching;
mod field_partners;
mod fillets;
mod free_curves;
mod free_ends;
mod gaps;
mod graph_fitting;
mod graph_segmentation;
mod hypothesis_scoring;
mod known_tubes;
mod line3d;
mod line_continuation;
mod line_evidence;
mod line_extent;
mod line_fitting;
mod line_kind;
mod line_selection;
mod neighbours;
mod outlines;
mod pocket_depths;
mod pocket_floors;
mod pose_fitting;
mod profiles;
mod progress;
mod projected_line;
mod report;
mod rounded_corners;
mod slab_ends;
mod small_circles;
mod spline_fitting;
mod splines;
mod straightness;
mod swept_tubes;
mod tangent_ends;
mod touched_spheres;
mod turning;
mod view_segments;
mod wander;

#[cfg(test)]
mod test_views;

pub use config::AssembleConfig;
pub use line3d::{Line3dConfig, Line3dSegment, SegmentSupport, line3d, wireframe_of_segments};
pub use profiles::Photographs;
pub use progress::OnProgress;
pub use report::{AssembleReport, Assembled};

use crate::paper::NeatLine;
use crate::{ViewObservation, Wireframe3d};
use arc_crossings::cut_at_arcs;
use arc_ends::{end_at_junctions, junctions_of_edges};
use arc_joints::{end_on_arcs, join_tangents};
use arc_tubes::KnownArcs;
use circle_fitting::FoundArc;
use collinear_pieces::merge_pieces;
use common_directions::turn_to_common_directions;
use corners::find_corners;
use curved_edges::{add_as_arcs, take_curved_edges};
use curves::find_arcs;
use domes::{FoundDome, settled_domes, take_domes};
use edge_completion::complete_edges;
use edge_cutting::{cut_edges, in_order};
use edge_samples::Images;
use field_partners::FieldLines;
use fillets::round_corners;
use free_ends::move_free_ends;
use gaps::drop_gaps;
use graph_fitting::{fit_edges, fit_graph};
use hypothesis_scoring::{Alternatives, Scoring, score_hypotheses};
use line_continuation::{continue_lines, meet_in_slivers};
use line_selection::{Selection, select_lines, sure_lines};
use nalgebra::{Matrix4, Vector3};
use neat_core::{EdgelMap, LineSegment2, Spline};
use pocket_floors::add_floors;
use pose_fitting::fit_poses;
use profiles::place_curves;
use progress::part;
use rayon::prelude::*;
use slab_ends::{close_by_light, close_slabs};
use splines::take_splines;
use std::ops::ControlFlow;
use tangent_ends::cut_tangent_ends;
use view_segments::PreparedView;

/// Views that must agree on a position for it to be proposed; the images decide.
const MIN_VIEWS: usize = 2;

/// Shares of the time after which lines are proposed, the sure ones known, all selected and arcs
/// followed: about those of a house.
const PROPOSED: f64 = 0.01;
const SURE: f64 = 0.08;
const SELECTED: f64 = 0.37;
const FOLLOWED: f64 = 0.45;
/// Likewise, of the time for the graph, after which lines are cut where arcs begin, continued, and
/// placed by profiles, and floors of pockets are found.
const ENDED: f64 = 0.01;
const CONTINUED: f64 = 0.02;
const PLACED: f64 = 0.43;
const WITH_FLOORS: f64 = 0.91;

/// What is known of a structure. All but the views may be missing.
#[derive(Clone, Copy, Default)]
pub struct Witnesses<'a> {
    /// Cameras and detected segments. Views without a valid camera do not count.
    pub views: &'a [ViewObservation],
    /// The edgels of each image, as `neat_detect::edgel_map` finds them. Without any, the
    /// segments stand for them.
    pub edgels: &'a [EdgelMap],
    /// The images themselves, by which lines are placed. Without them edgels say where lines are.
    pub photographs: Option<Photographs<'a>>,
    /// The NEAT lines of each view: 2D segments are partners if these lie near each other, and
    /// are not matched otherwise.
    pub field_lines: Option<&'a [Vec<NeatLine>]>,
}

/// Builds the wireframe of views and [their edgels](Witnesses::edgels).
///
/// - `scene_radius`: radius of the ball around the world's origin in which the structure
///   lies.
///
/// The result is empty where nothing can be built: too few usable views, a radius that is
/// not a positive number, edgels or lines of another number of views. It does not depend on the
/// number of threads.
pub fn assemble(
    views: &[ViewObservation],
    edgels: &[EdgelMap],
    scene_radius: f64,
    config: &AssembleConfig,
) -> Assembled {
    let witnesses = Witnesses {
        views,
        edgels,
        ..Witnesses::default()
    };
    let go_on = &mut |_| ControlFlow::Continue(());
    match assemble_with_progress(&witnesses, scene_radius, config, go_on) {
        ControlFlow::Continue(assembled) => assembled,
        ControlFlow::Break(()) => Assembled::default(),
    }
}

/// [`assemble`] by all that is known, which ends as soon as `progress` says so.
pub fn assemble_with_progress(
    witnesses: &Witnesses<'_>,
    scene_radius: f64,
    config: &AssembleConfig,
    progress: OnProgress<'_>,
) -> ControlFlow<(), Assembled> {
    let Witnesses {
        views: observations,
        edgels,
        photographs,
        field_lines,
    } = *witnesses;
    if !is_usable(witnesses, scene_radius) {
        return ControlFlow::Continue(Assembled::default());
    }
    let _span = tracing::debug_span!("assemble", views = observations.len()).entered();
    let views = prepared_views(observations, scene_radius, config);
    let of_segments: Vec<EdgelMap>;
    let maps = if edgels.is_empty() {
        of_segments = views.iter().map(edgels_of_segments).collect();
        &of_segments
    } else {
        edgels
    };
    let field = field_lines.map(|lines| FieldLines::new(&views, lines, scene_radius.recip()));
    let alternatives = proposals(&views, field.as_ref(), config);
    progress(PROPOSED)?;
    let mut report = counted(&views, maps, &alternatives);
    let mut images = Images::new(&views, maps);
    let mut sure = {
        let progress = &mut part(progress, [PROPOSED, SURE]);
        sure_lines(images, &alternatives, config, progress)?
    };
    let poses = (config.refine_poses)
        .then(|| fit_poses(&images, &mut sure))
        .flatten();
    if let Some(poses) = &poses {
        images.views = &poses.views;
        report.poses_moved_in_pixels = poses.pixels;
        report.pose_reliability = poses.reliability;
    }
    let mut selection = {
        let progress = &mut part(progress, [SURE, SELECTED]);
        select_lines(images, &alternatives, &sure, config, progress)?
    };
    drop(alternatives);
    let arcs = &mut {
        let progress = &mut part(progress, [SELECTED, FOLLOWED]);
        find_arcs(&mut selection, config, progress)?
    };
    note_selection(&selection, &mut report);
    let images = selection.images;
    let progress = &mut part(progress, [FOLLOWED, 1.0]);
    let domes = take_domes(&images, arcs, config.min_evidence);
    let found = (&mut *arcs, &domes[..]);
    let (wireframe, splines) =
        graph_of(selection, found, photographs, config, &mut report, progress)?;
    let domes = settled_domes(&domes, arcs);
    report.arcs = arcs.len();
    report.splines = splines.len();
    report.domes = domes.len();
    let arc_covariances = covariances_of_arcs(&images, arcs, scene_radius);
    let in_world = |point: &Vector3<f64>| point * scene_radius;
    let wireframe = wireframe.map(in_world);
    report.junctions = wireframe.junctions.len();
    report.edges = wireframe.edges.len();
    tracing::debug!(?report, "assembled");
    let refined_cameras = poses.map(|poses| poses.cameras(scene_radius));
    ControlFlow::Continue(Assembled {
        wireframe,
        arcs: (arcs.iter()).map(|found| found.arc.map(in_world)).collect(),
        arc_covariances,
        splines: splines.iter().map(|spline| spline.map(in_world)).collect(),
        domes: domes.iter().map(|dome| dome.map(in_world)).collect(),
        report,
        refined_cameras,
    })
}

fn is_usable(witnesses: &Witnesses<'_>, scene_radius: f64) -> bool {
    let fits = |views: usize| views == witnesses.views.len();
    let edgels = witnesses.edgels.len();
    scene_radius.is_normal()
        && scene_radius > 0.0
        && (edgels == 0 || fits(edgels))
        && witnesses.field_lines.is_none_or(|lines| fits(lines.len()))
}

/// What there is to go by.
fn counted(
    views: &[PreparedView],
    maps: &[EdgelMap],
    alternatives: &Alternatives,
) -> AssembleReport {
    AssembleReport {
        usable_views: views
            .iter()
            .filter(|view| !view.segments.is_empty())
            .count(),
        usable_segments: views.iter().map(|view| view.segments.len()).sum(),
        edgels: maps.iter().map(EdgelMap::len).sum(),
        segments_with_hypotheses: (alternatives.iter().flatten())
            .filter(|list| !list.is_empty())
            .count(),
        ..AssembleReport::default()
    }
}

/// Of centre and radius: by profiles where these have placed an arc, else by edgels.
fn covariances_of_arcs(
    images: &Images,
    arcs: &[FoundArc],
    scene_radius: f64,
) -> Vec<Option<Matrix4<f64>>> {
    let covariance = |found: &FoundArc| {
        let by_edgels = || images.covariance_of_arc(found);
        Some(found.covariance.or_else(by_edgels)? * scene_radius.powi(2))
    };
    arcs.iter().map(covariance).collect()
}

fn note_selection(selection: &Selection, report: &mut AssembleReport) {
    report.noise_in_pixels = selection.noise;
    report.lines = selection.lines.len();
    report.curved_lines = selection.curved;
    report.outlines = selection.outlines;
}

/// The views in a world whose scene ball is the unit ball.
fn prepared_views(
    observations: &[ViewObservation],
    scene_radius: f64,
    config: &AssembleConfig,
) -> Vec<PreparedView> {
    let min_length = config.min_segment_length_in_pixels;
    (observations.par_iter())
        .map(|observation| PreparedView::new(observation, scene_radius.recip(), min_length))
        .collect()
}

/// The positions in space of all 2D segments that some pair of views agrees on.
fn proposals(
    views: &[PreparedView],
    field: Option<&FieldLines>,
    config: &AssembleConfig,
) -> Alternatives {
    let margin = config.ball_margin;
    let neighbours = neighbours::neighbours(views, margin, config.neighbours);
    let scoring = Scoring::default();
    score_hypotheses(views, &neighbours, field, margin, MIN_VIEWS, &scoring)
}

/// From lines to a graph: merged, continued, joined at corners, completed, cut and fitted.
fn graph_of(
    mut selection: Selection<'_>,
    (arcs, domes): (&mut Vec<FoundArc>, &[FoundDome]),
    photographs: Option<Photographs<'_>>,
    config: &AssembleConfig,
    report: &mut AssembleReport,
    progress: OnProgress<'_>,
) -> ControlFlow<(), (Wireframe3d, Vec<Spline>)> {
    let images = selection.images;
    let least = config.min_evidence;
    let known = &KnownArcs::new(arcs, domes);
    selection.lines.retain_mut(|found| {
        let left = known.left_of(&images, &found.line, least);
        found.line = left.unwrap_or(found.line);
        left.is_some()
    });
    report.outlines += report.lines - selection.lines.len();
    report.lines = selection.lines.len();
    cut_tangent_ends(&images, &mut selection.lines, selection.noise);
    progress(ENDED)?;
    turn_to_common_directions(&images, selection.noise, &mut selection.lines);
    let mut lines = merge_pieces(&images, selection.lines);
    let taken = &mut selection.taken;
    known.claim_outlines(&images, taken);
    continue_lines(&images, &mut lines, arcs, taken, least);
    lines = merge_pieces(&images, lines);
    progress(CONTINUED)?;
    report.merged_pieces = report.lines - lines.len();
    let mut response = None;
    if let Some(photographs) = photographs {
        let progress = &mut part(progress, [CONTINUED, PLACED]);
        response = place_curves(&images, photographs, &mut lines, arcs, progress)?;
    }
    progress(PLACED)?;
    images.retain_own(&lines, arcs);
    report.common_directions = turn_to_common_directions(&images, selection.noise, &mut lines);
    round_corners(&images, &lines, arcs);
    let known = &KnownArcs::new(arcs, domes);
    lines.retain(|found| !known.is_outline(&images, &found.line, least));
    let joined = join_tangents(&images, &mut lines, arcs);
    meet_in_slivers(&images, &mut lines);
    let mut corners = find_corners(&images, &lines, (arcs, &joined));
    report.ends = corners.junctions.len();
    fit_graph(&images, &lines, &corners.ends, &mut corners.junctions);
    move_free_ends(&images, &lines, &mut corners);
    end_on_arcs(&images, &mut corners, arcs);
    report.completed_edges = complete_edges(&images, &mut corners, taken, (least, known));
    report.completed_edges += add_floors(&images, &mut corners, taken, arcs);
    progress(WITH_FLOORS)?;
    report.completed_edges += close_slabs(&images, &mut corners, taken, (least, known));
    if let Some(light) = photographs.zip(response) {
        report.completed_edges += close_by_light(&images, light, &lines, &mut corners);
    }
    let (mut wireframe, mut sources) = cut_edges(&images, corners);
    if let Some(light) = photographs.zip(response) {
        drop_gaps(&images, light, &lines, &mut wireframe, &mut sources);
    }
    let mut curved = take_curved_edges(&images, &mut wireframe, &mut sources);
    report.curved_lines += curved.len();
    cut_at_arcs(&images, &mut wireframe, &mut sources, arcs);
    end_at_junctions(&images, &mut wireframe, &mut sources, &mut curved, arcs);
    fit_edges(&images, &lines, &sources, &mut wireframe);
    let junctions = junctions_of_edges(&wireframe, &curved);
    let splines = take_splines(&images, &junctions, arcs);
    add_as_arcs(&curved, &wireframe.junctions, arcs);
    let ends_of_curves = curved.iter().flat_map(|edge| edge.ends).collect();
    ControlFlow::Continue((in_order(&wireframe, ends_of_curves), splines))
}

/// The edgels of a view that is known by its segments only.
fn edgels_of_segments(view: &PreparedView) -> EdgelMap {
    let segments: Vec<LineSegment2> = view.segments.iter().map(|s| s.segment).collect();
    EdgelMap::of_segments(&segments, view.camera.width, view.camera.height)
}
