//! Faces and solids from a wireframe: planes, cylinders and cones between its edges and arcs,
//! closed to shells where they close.
//!
//! Curves that lie in one plane within their covariances divide it into cells, and two coaxial
//! circles are the rims of a cylinder or a cone: each is a face that may be there
//! (`candidates.rs`), and what outlines have shown of spheres are caps (`domes.rs`). Where a round face
//! goes on without a crease, the line between them is
//! inferred (`rulings.rs`), and so is an edge that is missing where two planes meet
//! (`creases.rs`). Images speak against a face through which they show what lies behind it
//! (`visibility.rs`); among the others those are chosen that give the most edges two faces
//! (`selection.rs`), and what is open between them may be a smooth patch (`free_faces.rs`). What hangs
//! together is a shell; it bounds a solid if each of its curves has a face on both sides
//! (`shells.rs`), and if images show the outlines of its round faces (`outlines.rs`).
//!
//! Where there are points of surfaces, planes are found that explain edges and points together
//! (`explained_planes.rs`), and the parts of them that points say are surface (`sheets.rs`), also
//! where edges are missing. Solids stay as they are.
//!
//! ```
//! use neat_core::Wireframe3d;
//! use neat_wireframe::faces::{MeasuredGraph, ShellGeometry, find_shells};
//! use nalgebra::Vector3;
//!
//! let corner = |i: usize| Vector3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64);
//! let cube = Wireframe3d {
//!     junctions: (0..8).map(corner).collect(),
//!     edges: (0..8)
//!         .flat_map(|i| [1, 2, 4].map(|bit| [i, i | bit]))
//!         .filter(|[a, b]| a != b)
//!         .collect(),
//! };
//! let graph = MeasuredGraph::of(&cube);
//! let shells = find_shells(&graph, &[], &[]);
//! assert!(shells[0].closed && shells[0].faces.len() == 6);
//! let geometry = ShellGeometry::new(&shells[0], &graph);
//! assert!((geometry.volume(&shells[0]) - 1.0).abs() < 1e-9);
//! ```

mod bounds;
mod candidates;
mod cap;
mod cells;
mod chain;
mod completion;
mod creases;
mod curves;
mod divided_arcs;
mod domes;
mod explained_planes;
mod extrusion;
mod face;
mod free_faces;
mod geometry;
mod groups;
mod loose_lines;
mod min_cut;
mod outlines;
mod patch;
mod patch_triangulation;
mod plane_fit;
mod plane_mesh;
mod planes;
mod point_evidence;
mod polygon;
mod quadrature;
mod region;
mod round_cells;
mod round_triangulation;
mod rulings;
mod selection;
mod sheets;
mod shells;
mod surface;
mod surface_points;
mod triangulation;
mod unrolled;
mod visibility;
mod walls;

#[cfg(test)]
mod completion_tests;
#[cfg(test)]
mod round_tests;
#[cfg(test)]
mod sheet_tests;
#[cfg(test)]
mod tests;

pub use completion::{Completed, completed, creases_of_solids};
pub use curves::MeasuredGraph;
pub(crate) use curves::{ends_of_arc, ends_of_spline, nearest_junctions};
pub use divided_arcs::divided_arcs;
pub use face::{CurveIndex, Face, Shell, Step};
pub use loose_lines::{closed_faces, loose_lines_on_solids};
pub(crate) use triangulation::{points_within, triangles};

pub(crate) use cap::Cap;
pub(crate) use extrusion::moments_of_wall;
pub(crate) use geometry::{FINE, area_vector_of_spline, goes_around, twice_segment};
pub use geometry::{ShellCurve, ShellGeometry};
pub(crate) use patch::PatchFace;
pub use surface::Surface;
pub use surface_points::{SurfacePoint, surface_points};
pub(crate) use unrolled::{Chain, Unrolled};

use crate::ViewObservation;
use curves::Curves;
use nalgebra::Vector3;
use outlines::Outlines;
use rayon::prelude::*;
use region::Region;
use std::collections::BTreeSet;
use visibility::{DetectedView, Sightings};

/// The shells of a wireframe, closed ones first.
///
/// - `graph`: valid, see [`check_wireframe`](crate::validity::check_wireframe), with edges cut
///   where others meet them.
/// - `views`: cameras and 2D segments, in the same frame. Without any, only the wireframe speaks.
/// - `points`: in the same frame; see [`surface_points`]. Where there are some, sheets are sought
///   on the planes of the scene, and open faces that are hidden or seen through are left out. They
///   say nothing without views, as nobody knows then what is hidden.
///
/// The result does not depend on the number of threads.
pub fn find_shells(
    graph: &MeasuredGraph,
    views: &[ViewObservation],
    points: &[SurfacePoint],
) -> Vec<Shell> {
    let observed = Curves::new(graph);
    let rulings = rulings::missing_rulings(&observed);
    let curves = observed.with_inferred(rulings);
    let mut inferred = creases::continued_ends(&curves);
    let domes = domes::domes(&curves, graph.domes);
    inferred.extend(domes.rims);
    let (curves, faces) = candidates::candidates(curves.with_inferred(inferred), domes.caps);
    let _span = tracing::debug_span!("find_shells", faces = faces.len()).entered();
    let detected = DetectedView::all(views);
    let sightings = Sightings::new(&curves, &detected);
    let (regions, mut against): (Vec<Option<Region>>, Vec<f64>) = (faces.par_iter())
        .map(|face| {
            let region = Region::new(&curves, face);
            let against = (region.as_ref()).map_or(f64::MAX, |region| {
                sightings.against(region, &outline(&curves, face, region))
            });
            (region, against)
        })
        .unzip();
    let outlines = Outlines { views: &detected };
    let shells = loop {
        let chosen = selection::select(&curves, &faces, &regions, &against);
        let patches = patches(&curves, &faces, &regions, &chosen, &sightings);
        let mut chosen: Vec<Face> = chosen.into_iter().map(|face| faces[face].clone()).collect();
        chosen.extend(patches);
        let shells = shells::shells(graph, &curves, chosen, views);
        let unseen = outlines.unseen(&curves, &shells);
        if unseen.is_empty() {
            break shells;
        }
        // Each of them was chosen, and will not be again.
        let mut left_out = 0;
        for (face, against) in faces.iter().zip(&mut against) {
            if *against < f64::MAX && unseen.contains(&face.boundary()) {
                *against = f64::MAX;
                left_out += 1;
            }
        }
        assert!(
            left_out > 0,
            "find_shells: a face that was none of those asked"
        );
    };
    if points.is_empty() || views.is_empty() {
        return shells;
    }
    let (mut shells, open): (Vec<Shell>, Vec<Shell>) =
        shells.into_iter().partition(|shell| shell.closed);
    let region = |face: &Face| Region::new(&curves, face);
    let solid: Vec<Region> = (shells.iter())
        .flat_map(|shell| shell.faces.iter().filter_map(region))
        .collect();
    let mut open: Vec<_> = (open.into_iter().flat_map(|shell| shell.faces))
        .filter_map(|face| Some((face.clone(), region(&face)?)))
        .collect();
    let witnesses = point_evidence::witnesses(points, curves.junction_floor());
    let cameras: Vec<_> = views.iter().map(|view| view.camera).collect();
    let mut faces = sheets::sheets(&curves, &solid, &mut open, &cameras, &witnesses);
    faces.extend(open.into_iter().map(|(face, _)| face));
    // Inferred lines may close them, but what is inside nobody has asked.
    let sheets = shells::shells(graph, &curves, faces, views).into_iter();
    shells.extend(sheets.map(|shell| Shell {
        closed: false,
        ..shell
    }));
    shells
}

/// The patches between chosen faces that images do not speak against, that pass through none of these
/// and on which hardly any other curve lies.
fn patches(
    curves: &Curves,
    faces: &[Face],
    regions: &[Option<Region>],
    chosen: &[usize],
    sightings: &Sightings,
) -> Vec<Face> {
    let beside: Vec<&Region> = (chosen.iter())
        .filter_map(|face| regions[*face].as_ref())
        .collect();
    let chosen: Vec<&Face> = chosen.iter().map(|face| &faces[*face]).collect();
    let of_faces = chosen.iter().flat_map(|face| face.steps());
    let used: BTreeSet<CurveIndex> = of_faces.map(|step| step.curve).collect();
    free_faces::free_faces(curves, &chosen, |face, region| {
        let Region::Patch { face: patch, .. } = region else {
            return false;
        };
        let area = patch.moments(&Vector3::zeros())[0];
        let passes = |other: &&Region| region.passes_through(other) || other.passes_through(region);
        patch.off <= curves.arc_sigma()
            && sightings.against(region, &outline(curves, face, region)) <= selection::MOST_AGAINST
            && shells::is_mostly_free(curves, face, &used, (region, area))
            && !beside.iter().any(passes)
    })
}

/// The points along the boundary of a face, and within it if it reaches beyond that.
fn outline(curves: &Curves, face: &Face, region: &Region) -> Vec<Vector3<f64>> {
    (face.steps().flat_map(|step| curves.points_along(step)))
        .chain(region.inner_points())
        .collect()
}
