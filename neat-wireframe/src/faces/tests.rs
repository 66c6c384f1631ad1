use super::*;
use crate::export::WireframeDocument;
use nalgebra::{Rotation3, Vector2, Vector3};
use neat_core::{CircularArc, Dome, Spline, Wireframe3d};
use std::f64::consts::{PI, TAU};
use std::path::Path;

#[derive(Clone, Default)]
pub(super) struct Model {
    pub wireframe: Wireframe3d,
    pub arcs: Vec<CircularArc>,
    pub splines: Vec<Spline>,
    pub domes: Vec<Dome>,
}

impl Model {
    /// The edges of a prism over a polygon, between two heights.
    pub fn prism(mut self, corners: &[[f64; 2]], heights: [f64; 2]) -> Self {
        let count = corners.len();
        let first = self.wireframe.junctions.len();
        for height in heights {
            let at_height = corners.iter().map(|[x, y]| Vector3::new(*x, *y, height));
            self.wireframe.junctions.extend(at_height);
        }
        for k in 0..count {
            let (here, next) = (first + k, first + (k + 1) % count);
            let edges = [
                [here, next],
                [count + here, count + next],
                [here, count + here],
            ];
            self.wireframe.edges.extend(edges);
        }
        self
    }

    pub fn circle(mut self, center: [f64; 3], radius: f64, angles: [f64; 2]) -> Self {
        self.arcs.push(CircularArc {
            center: center.into(),
            axes: [Vector3::x(), Vector3::y()],
            radius,
            angles,
        });
        self
    }

    /// Turned and moved, so that no axis is special.
    pub fn turned(mut self) -> Self {
        let turn = Rotation3::new(Vector3::new(0.3, -0.7, 0.5));
        let moved = |p: &Vector3<f64>| turn * p * 1.7 + Vector3::new(0.2, -4.0, 1.0);
        self.wireframe = self.wireframe.map(moved);
        self.arcs = self.arcs.iter().map(|arc| arc.map(moved)).collect();
        self.splines = self
            .splines
            .iter()
            .map(|spline| spline.map(moved))
            .collect();
        self.domes = self.domes.iter().map(|dome| dome.map(moved)).collect();
        self
    }

    pub fn shells(&self) -> Vec<Shell> {
        find_shells(&self.graph(), &[], &[])
    }

    pub fn graph(&self) -> MeasuredGraph<'_> {
        MeasuredGraph {
            arcs: &self.arcs,
            splines: &self.splines,
            domes: &self.domes,
            ..MeasuredGraph::of(&self.wireframe)
        }
    }

    /// Number of faces and volume of the one shell, which is closed.
    pub fn solid(&self) -> (usize, f64) {
        let shells = self.shells();
        assert_eq!(shells.len(), 1, "{shells:?}");
        assert!(shells[0].closed, "{shells:?}");
        let is_valid = |face: &Face| face.is_valid(&self.graph());
        assert!(shells[0].faces.iter().all(is_valid));
        let geometry = self.geometry(&shells[0]);
        (shells[0].faces.len(), geometry.volume(&shells[0]))
    }
}

impl Model {
    pub fn geometry(&self, shell: &Shell) -> ShellGeometry {
        ShellGeometry::new(shell, &self.graph())
    }
}

const SQUARE: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
const L_PROFILE: [[f64; 2]; 6] = [
    [0.0, 0.0],
    [1.0, 0.0],
    [1.0, 0.3],
    [0.3, 0.3],
    [0.3, 1.0],
    [0.0, 1.0],
];
pub(super) const WHOLE: [f64; 2] = [-1.0, -1.0 + TAU];
/// Volume of the unit cube of a model that is turned.
pub(super) const UNIT: f64 = 1.7 * 1.7 * 1.7;

pub(super) fn assert_solid(model: Model, faces: usize, volume: f64) {
    let (found, of_model) = model.turned().solid();
    assert_eq!(found, faces);
    assert!(
        (of_model / UNIT - volume).abs() < 1e-9,
        "{}",
        of_model / UNIT
    );
}

#[test]
fn prisms_are_solids() {
    let stairs = [
        [0.0, 0.0],
        [1.0, 0.0],
        [1.0, 0.3],
        [0.6, 0.3],
        [0.6, 0.6],
        [0.3, 0.6],
        [0.3, 1.0],
        [0.0, 1.0],
    ];
    assert_solid(Model::default().prism(&SQUARE, [0.0, 0.8]), 6, 0.8);
    assert_solid(Model::default().prism(&L_PROFILE, [0.0, 0.5]), 8, 0.255);
    assert_solid(
        Model::default().prism(&stairs, [0.0, 1.0]),
        10,
        0.3 + 0.18 + 0.12,
    );
}

#[test]
fn square_holes_have_walls_and_no_lids() {
    let inner = SQUARE.map(|p| p.map(|x| 0.3 + 0.4 * x));
    let through = Model::default()
        .prism(&SQUARE, [0.0, 0.8])
        .prism(&inner, [0.0, 0.8]);
    assert_solid(through, 10, 0.8 * 0.84);
    let blind = Model::default()
        .prism(&SQUARE, [0.0, 0.8])
        .prism(&inner, [0.3, 0.8]);
    assert_solid(blind, 11, 0.8 - 0.5 * 0.16);
}

#[test]
fn round_holes_and_pins_are_cylinders() {
    let block = || Model::default().prism(&SQUARE, [0.0, 0.8]);
    let [low, high] = [0.0, 0.8].map(|z| [0.4, 0.5, z]);
    let area = PI * 0.04;
    let through = block().circle(low, 0.2, WHOLE).circle(high, 0.2, WHOLE);
    assert_solid(through, 7, 0.8 * (1.0 - area));
    let blind = block()
        .circle(high, 0.2, WHOLE)
        .circle([0.4, 0.5, 0.3], 0.2, WHOLE);
    assert_solid(blind, 8, 0.8 - 0.5 * area);
    let pin = block()
        .circle(high, 0.2, WHOLE)
        .circle([0.4, 0.5, 1.2], 0.2, WHOLE);
    assert_solid(pin, 8, 0.8 + 0.4 * area);
    let disc = Model::default()
        .circle(low, 0.2, WHOLE)
        .circle(high, 0.2, WHOLE);
    assert_solid(disc, 3, 0.8 * area);
}

/// A block with a slot whose ends are half round.
fn slotted_block() -> Model {
    let corners = [[0.3, 0.4], [0.7, 0.4], [0.7, 0.6], [0.3, 0.6]];
    let mut slot = Model::default()
        .prism(&SQUARE, [0.0, 0.8])
        .prism(&corners, [0.0, 0.8]);
    let junctions = slot.wireframe.junctions.clone();
    slot.wireframe.edges.retain(|[a, b]| {
        let along = junctions[*b] - junctions[*a];
        *a < 8 || along.x.abs() > 1e-9 || along.z.abs() > 1e-9
    });
    for z in [0.0, 0.8] {
        slot = slot.circle([0.3, 0.5, z], 0.1, [0.5 * PI, 1.5 * PI]);
        slot = slot.circle([0.7, 0.5, z], 0.1, [-0.5 * PI, 0.5 * PI]);
    }
    slot
}

/// A cube with one rounded edge.
fn rounded_block() -> Model {
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.7], [0.7, 1.0], [0.0, 1.0]];
    let mut rounded = Model::default().prism(&corners, [0.0, 1.0]);
    let junctions = rounded.wireframe.junctions.clone();
    rounded.wireframe.edges.retain(|[a, b]| {
        let along = junctions[*b] - junctions[*a];
        along.x.abs() < 1e-9 || along.y.abs() < 1e-9
    });
    for z in [0.0, 1.0] {
        rounded = rounded.circle([0.7, 0.7, z], 0.3, [0.0, 0.5 * PI]);
    }
    rounded
}

#[test]
fn rounded_ends_are_parts_of_cylinders() {
    assert_solid(slotted_block(), 10, 0.8 * (1.0 - 0.08 - PI * 0.01));
    assert_solid(rounded_block(), 7, 1.0 - 0.09 + 0.25 * PI * 0.09);
}

/// Volume of a frustum.
fn frustum(height: f64, [r, s]: [f64; 2]) -> f64 {
    PI * height * (r * r + r * s + s * s) / 3.0
}

#[test]
fn rims_of_different_radii_bound_cones() {
    let block = || Model::default().prism(&SQUARE, [0.0, 0.8]);
    let at = |z: f64| [0.4, 0.5, z];
    let pin = Model::default()
        .circle(at(0.0), 0.3, WHOLE)
        .circle(at(0.5), 0.1, WHOLE);
    assert_solid(pin, 3, frustum(0.5, [0.3, 0.1]));
    // A countersunk hole, and a cone on a block.
    let hole = block()
        .circle(at(0.0), 0.1, WHOLE)
        .circle(at(0.6), 0.1, WHOLE)
        .circle(at(0.8), 0.3, WHOLE);
    let volume = 0.8 - 0.6 * PI * 0.01 - frustum(0.2, [0.1, 0.3]);
    assert_solid(hole, 8, volume);
    let cone = block()
        .circle(at(0.8), 0.3, WHOLE)
        .circle(at(1.1), 0.2, WHOLE);
    assert_solid(cone, 8, 0.8 + frustum(0.3, [0.3, 0.2]));
    // A quarter of one, between flat sides.
    let mut quarter = Model::default();
    let (radii, heights) = ([0.5, 0.2], [0.0, 0.4]);
    for (radius, z) in radii.into_iter().zip(heights) {
        let corners = [[0.0, 0.0, z], [radius, 0.0, z], [0.0, radius, z]];
        quarter
            .wireframe
            .junctions
            .extend(corners.map(Vector3::from));
        quarter = quarter.circle([0.0, 0.0, z], radius, [0.0, 0.5 * PI]);
    }
    quarter.wireframe.edges = vec![[0, 1], [0, 2], [3, 4], [3, 5], [0, 3], [1, 4], [2, 5]];
    assert_solid(quarter, 5, 0.25 * frustum(0.4, radii));
}

#[test]
fn steps_are_no_cones_and_chamfers_are() {
    let shaft = |rims: [(f64, f64); 4]| {
        rims.into_iter()
            .fold(Model::default(), |model, (radius, z)| {
                model.circle([0.0, 0.0, z], radius, WHOLE)
            })
    };
    let stepped = shaft([(0.3, 0.0), (0.3, 0.4), (0.2, 0.4), (0.2, 0.8)]);
    assert_solid(stepped, 5, PI * (0.4 * 0.09 + 0.4 * 0.04));
    let chamfered = shaft([(0.25, 0.0), (0.3, 0.05), (0.3, 0.75), (0.25, 0.8)]);
    let volume = 2.0 * frustum(0.05, [0.25, 0.3]) + 0.7 * PI * 0.09;
    assert_solid(chamfered, 5, volume);
}

#[test]
fn missing_creases_are_inferred_between_corners() {
    let instead = |ends: &[[f64; 3]]| {
        let mut model = Model::default().prism(&L_PROFILE, [0.0, 0.5]);
        model.wireframe.edges.retain(|edge| *edge != [3, 9]);
        for end in ends {
            model
                .wireframe
                .edges
                .push([3, model.wireframe.junctions.len()]);
            model.wireframe.junctions.push(Vector3::from(*end));
        }
        model
    };
    // The edge in the inner corner is missing, stops short, or runs past its end.
    assert_solid(instead(&[]), 8, 0.255);
    assert_solid(instead(&[[0.3, 0.3, 0.2]]), 8, 0.255);
    assert_solid(instead(&[[0.3, 0.3, 0.7]]), 8, 0.255);
    // Of two edges of a thin strip only pieces at both ends are left, which no plane joins.
    let mut bar = Model::default().prism(
        &[[0.0, 0.0], [1.0, 0.0], [1.0, 0.05], [0.0, 0.05]],
        [0.0, 1.0],
    );
    for [start, end] in [[4, 5], [6, 7]] {
        bar.wireframe.edges.retain(|edge| *edge != [start, end]);
        for (from, to) in [(start, end), (end, start)] {
            let [a, b] = [from, to].map(|k| bar.wireframe.junctions[k]);
            bar.wireframe
                .edges
                .push([from, bar.wireframe.junctions.len()]);
            bar.wireframe.junctions.push(a + 0.2 * (b - a));
        }
    }
    assert_solid(bar, 6, 0.05);
}

#[test]
fn small_solids_far_apart_have_planes_of_their_own() {
    // At the noise of so large a scene, each side may lie in a plane with those of others.
    let mut model = Model::default();
    let count = 40;
    for k in 0..count {
        let number = |step: usize| f64::from((k * step % 1000) as u32) * 0.1;
        let [x, y, z] = [7919, 104_729, 1_299_709].map(number);
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let corners = square.map(|[u, v]| [x + u, y + v]);
        model = model.prism(&corners, [z, z + 1.0]);
    }
    let shells = model.turned().shells();
    let is_box = |shell: &Shell| shell.closed && shell.faces.len() == 6;
    assert_eq!(shells.len(), count);
    assert!(shells.iter().all(is_box));
}

#[test]
fn what_does_not_close_is_a_sheet() {
    // A box without the edges at one corner has three faces, or a hole whose bottom is missing.
    let mut open = Model::default().prism(&SQUARE, [0.0, 1.0]);
    (open.wireframe.edges).retain(|edge| !edge.contains(&0));
    let shells = open.shells();
    assert_eq!(
        (shells.len(), shells[0].closed, shells[0].faces.len()),
        (1, false, 3)
    );
    let half = Model::default()
        .prism(&SQUARE, [0.0, 0.8])
        .circle([0.4, 0.5, 0.8], 0.2, WHOLE);
    let shells = half.shells();
    assert_eq!(
        (shells.len(), shells[0].closed, shells[0].faces.len()),
        (1, false, 6)
    );
    assert!(Model::default().shells().is_empty());
}

#[test]
fn nothing_is_seen_within_a_solid() {
    let mut hollow = Model::default().prism(&SQUARE, [0.0, 1.0]);
    hollow
        .wireframe
        .junctions
        .extend([[0.4, 0.4, 0.4], [0.6, 0.5, 0.6]].map(Vector3::from));
    hollow.wireframe.edges.push([8, 9]);
    assert!(!hollow.shells()[0].closed);
    // Nor is there a face without a hole where the rim of one is, …
    let mut put = |ends: [[f64; 3]; 2]| {
        hollow.wireframe.junctions[8..].copy_from_slice(&ends.map(Vector3::from));
        hollow.shells()[0].closed
    };
    assert!(!put([[0.4, 0.4, 1.0], [0.6, 0.5, 1.0]]));
    // … but what lies outside, or is an edge once more, is none of the solid's business.
    assert!(put([[0.4, 0.4, 1.4], [0.6, 0.5, 1.6]]));
    assert!(put([[0.1, 0.005, 1.0], [0.7, 0.005, 1.0]]));
}

#[test]
fn a_shell_that_falls_apart_is_several() {
    // Something ends on the side of a pin: its two ends are left.
    let pin = Model::default().circle([0.0, 0.0, 0.0], 0.2, WHOLE);
    let mut pin = pin.circle([0.0, 0.0, 1.0], 0.2, WHOLE);
    let on_side = [[0.2, 0.0, 0.3], [0.2, 0.0, 0.7]].map(Vector3::from);
    pin.wireframe.junctions.extend(on_side);
    pin.wireframe.edges.push([0, 1]);
    let shells = pin.shells();
    let faces: Vec<(bool, usize)> = shells
        .iter()
        .map(|shell| (shell.closed, shell.faces.len()))
        .collect();
    assert_eq!(faces, [(false, 1), (false, 1)]);
}

#[test]
fn geometry_lies_on_the_surfaces() {
    let mut noise = crate::test_scenes::Noise(5);
    let block = Model::default().prism(&SQUARE, [0.0, 0.8]);
    let mut block = block
        .circle([0.4, 0.5, 0.0], 0.2, WHOLE)
        .circle([0.4, 0.5, 0.8], 0.2, WHOLE);
    for junction in &mut block.wireframe.junctions {
        *junction += 5e-4 * noise.vector();
    }
    block.arcs[0].radius *= 1.01;
    let (faces, volume) = block.solid();
    assert_eq!(faces, 7);
    assert!((volume - 0.8 * (1.0 - PI * 0.04)).abs() < 3e-3, "{volume}");
    let shell = &block.shells()[0];
    let geometry = ShellGeometry::new(shell, &block.graph());
    for face in &shell.faces {
        for point in face.steps().flat_map(|step| geometry.points(step, 0.1)) {
            let (off, _) = face.surface.height_of(&point);
            assert!(off.abs() < 1e-5, "{off} {:?}", face.surface);
        }
    }
}

#[test]
fn normals_point_out_and_loops_keep_the_face_on_their_left() {
    let model = Model::default().prism(&SQUARE, [0.0, 1.0]);
    for face in &model.shells()[0].faces {
        let Surface::Plane { normal, offset } = face.surface else {
            panic!("a cube has planes only");
        };
        assert!(normal.dot(&Vector3::repeat(0.5)) < offset);
        let frame = plane_fit::PlaneFrame::new(normal, offset);
        let geometry = ShellGeometry::new(&model.shells()[0], &model.graph());
        let polygon: Vec<Vector2<f64>> = (face.loops[0].iter())
            .map(|step| frame.coordinates(&geometry.points(step, 0.1)[0]))
            .collect();
        assert!((polygon::signed_area(&polygon) - 1.0).abs() < 1e-9);
    }
}

#[test]
fn a_similarity_moves_faces() {
    let model = Model::default().prism(&SQUARE, [0.0, 0.8]);
    let model = model
        .circle([0.4, 0.5, 0.0], 0.2, WHOLE)
        .circle([0.4, 0.5, 0.8], 0.2, WHOLE);
    for scale in [3.0, -3.0] {
        let moved = |p: &Vector3<f64>| p * scale + Vector3::new(5.0, -1.0, 2.0);
        let shell = model.shells()[0].map(moved);
        let wireframe = model.wireframe.map(moved);
        let arcs: Vec<CircularArc> = model.arcs.iter().map(|arc| arc.map(moved)).collect();
        let graph = MeasuredGraph {
            arcs: &arcs,
            ..MeasuredGraph::of(&wireframe)
        };
        let geometry = ShellGeometry::new(&shell, &graph);
        let volume = 27.0 * 0.8 * (1.0 - PI * 0.04);
        assert!((geometry.volume(&shell) - volume).abs() < 1e-9 * volume);
        assert!(shell.faces.iter().all(|face| geometry.area(face) > 0.0));
        assert!(shell.faces.iter().all(|face| face.is_valid(&graph)));
    }
}

/// Volume between triangles and origin, and whether each side of one is a side of another.
pub(super) fn of_triangles(model: &Model) -> (f64, bool) {
    let document = crate::export::WireframeDocument {
        arcs: model.arcs.clone(),
        splines: model.splines.clone(),
        domes: model.domes.clone(),
        shells: model.shells(),
        ..crate::export::WireframeDocument::from(&model.wireframe)
    };
    let points = document.drawn().junctions;
    let triangles = document.drawn_triangles();
    let volume = |[a, b, c]: &[usize; 3]| points[*a].dot(&points[*b].cross(&points[*c])) / 6.0;
    let sides = |[a, b, c]: &[usize; 3]| [[*a, *b], [*b, *c], [*c, *a]];
    let mut all: Vec<[usize; 2]> = triangles.iter().flat_map(sides).collect();
    let mut back: Vec<[usize; 2]> = all.iter().map(|[a, b]| [*b, *a]).collect();
    all.sort_unstable();
    back.sort_unstable();
    (triangles.iter().map(volume).sum(), all == back)
}

#[test]
fn triangles_of_a_solid_are_watertight() {
    let block = || Model::default().prism(&SQUARE, [0.0, 0.8]);
    let through =
        block()
            .circle([0.4, 0.5, 0.0], 0.2, WHOLE)
            .circle([0.4, 0.5, 0.8], 0.2, [2.0, 2.0 + TAU]);
    let pin = block()
        .circle([0.4, 0.5, 0.8], 0.2, WHOLE)
        .circle([0.4, 0.5, 1.2], 0.2, WHOLE);
    for model in [
        block(),
        through,
        pin,
        rounded_block(),
        slotted_block(),
        lens(),
    ] {
        let model = model.turned();
        let (volume, watertight) = of_triangles(&model);
        assert!(watertight);
        let exact = model.solid().1;
        assert!((volume / exact - 1.0).abs() < 2e-3, "{volume} {exact}");
    }
}

/// A prism of height 0.8 over two arcs that meet at two junctions, each a little beside them.
fn lens() -> Model {
    let mut model = Model::default().prism(&[[0.0, 0.0], [1.0, 0.0]], [0.0, 0.8]);
    model.wireframe.edges = vec![[0, 2], [1, 3]];
    let half = 1.4_f64;
    let (radius, depth) = (0.5 / half.sin(), 0.5 / half.tan());
    for height in [0.0, 0.8] {
        for (center, middle) in [(-depth, 0.25 * TAU), (depth, 0.75 * TAU)] {
            // Shorter than from junction to junction by a thousandth of a radian at each end.
            let angles = [-1.0, 1.0].map(|sign| middle + sign * (half - 1e-3));
            model = model.circle([0.5, center, height], radius, angles);
        }
    }
    model
}

/// A prism of height 0.8 over the unit square with one corner cut by an arc around this point of
/// the diagonal; no edge runs up where the arc begins and ends.
fn filleted(center: f64) -> Model {
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.7], [0.7, 1.0], [0.0, 1.0]];
    let start = (0.7 - center).atan2(1.0 - center);
    let radius = (1.0 - center).hypot(0.7 - center);
    let mut model = Model::default().prism(&corners, [0.0, 0.8]);
    let is_straight = |[a, b]: &[usize; 2]| {
        let [low, high] = [a.min(b), a.max(b)];
        ![[2, 3], [7, 8], [2, 7], [3, 8]].contains(&[*low, *high])
    };
    model.wireframe.edges.retain(is_straight);
    let angles = [start, PI / 2.0 - start];
    model.circle([center, center, 0.0], radius, angles).circle(
        [center, center, 0.8],
        radius,
        angles,
    )
}

fn inferred(shells: &[Shell]) -> usize {
    let faces = shells.iter().flat_map(|shell| &shell.faces);
    let steps = faces.flat_map(Face::steps);
    steps
        .filter(|step| matches!(step.curve, CurveIndex::Smooth(_)))
        .count()
}

#[test]
fn fillets_and_slots_close_by_inferred_lines() {
    let corner = (1.0 - PI / 4.0) * 0.09;
    assert_solid(filleted(0.7), 7, 0.8 * (1.0 - corner));
    // Each of the two lines bounds two faces.
    assert_eq!(inferred(&filleted(0.7).turned().shells()), 4);
    let slot = [[0.3, 0.4], [0.6, 0.4], [0.6, 0.6], [0.3, 0.6]];
    let mut model = Model::default()
        .prism(&SQUARE, [0.0, 0.8])
        .prism(&slot, [0.0, 0.8]);
    // Of the slot its long sides are left, at both ends of the block.
    let [low, high] = [8, 12].map(|k| [[k, k + 1], [k + 2, k + 3]]);
    let is_side = |edge: &[usize; 2]| edge[0] < 8 || low.contains(edge) || high.contains(edge);
    model.wireframe.edges.retain(is_side);
    for z in [0.0, 0.8] {
        let [left, right] = [[0.3, 0.5, z], [0.6, 0.5, z]];
        model =
            model
                .circle(left, 0.1, [PI / 2.0, 1.5 * PI])
                .circle(right, 0.1, [-PI / 2.0, PI / 2.0]);
    }
    let hole = 0.3 * 0.2 + PI * 0.01;
    assert_solid(model, 10, 0.8 * (1.0 - hole));
}

#[test]
fn nothing_is_inferred_where_an_arc_ends_at_a_corner_or_alone() {
    // The arc meets the sides at 27°: there must be an edge, and it is missing.
    let mut corner = filleted(0.4);
    let cornered = corner.clone().turned().shells();
    assert!(!cornered.is_empty() && cornered.iter().all(|shell| !shell.closed));
    assert_eq!(inferred(&cornered), 0);
    // With pieces of both edges there is a solid.
    for [x, y] in [[1.0, 0.7], [0.7, 1.0]] {
        let count = corner.wireframe.junctions.len();
        let places = [0.0, 0.3].map(|z| Vector3::new(x, y, z));
        let from = (0..count).find(|j| corner.wireframe.junctions[*j] == places[0]);
        corner.wireframe.junctions.push(places[1]);
        corner.wireframe.edges.push([from.unwrap(), count]);
    }
    let shells = corner.turned().shells();
    assert!(shells.len() == 1 && shells[0].closed && inferred(&shells) == 4);
    // Two arcs that go on straight, and nothing that the lines between them bound.
    let mut bare = filleted(0.7);
    let at_arc = |edge: &[usize; 2]| edge.iter().any(|end| [2, 3, 7, 8].contains(end));
    bare.wireframe.edges.retain(at_arc);
    assert_eq!(inferred(&bare.turned().shells()), 0);
}

/// An ellipse with half axes of .3 and .2 about a point, by so many control points.
fn oval([x, y, z]: [f64; 3], controls: usize) -> Spline {
    let control = |k: usize| {
        let (sine, cosine) = (TAU * k as f64 / controls as f64).sin_cos();
        Vector3::new(x + 0.3 * cosine, y + 0.2 * sine, z)
    };
    Spline {
        controls: (0..controls).map(control).collect(),
        closed: true,
    }
}

#[test]
fn splines_are_holes_and_borders_of_planes() {
    // A box with an oval hole in its top, and half of another one upright beside it.
    let mut model = Model::default().prism(&SQUARE, [0.0, 1.0]);
    let around = oval([2.0, 0.0, 0.0], 16);
    let upright = |p: &Vector3<f64>| Vector3::new(p.x, 0.0, p.y);
    let half = Spline {
        controls: around.controls[..9].iter().map(upright).collect(),
        closed: false,
    };
    let first = model.wireframe.junctions.len();
    (model.wireframe.junctions).extend([half.controls[8], half.controls[0]]);
    model.wireframe.edges.push([first, first + 1]);
    let splines = [oval([0.5, 0.5, 1.0], 16), half];
    let graph = MeasuredGraph {
        splines: &splines,
        ..MeasuredGraph::of(&model.wireframe)
    };
    let shells = find_shells(&graph, &[], &[]);
    let document = WireframeDocument {
        shells: shells.clone(),
        splines: splines.to_vec(),
        ..WireframeDocument::from(&model.wireframe)
    };
    document.check(Path::new("")).unwrap();
    let triangles = document.triangles_of_faces();
    let points = document.drawn().junctions;
    let cut = |[a, b, c]: &[usize; 3]| {
        let [a, b, c] = [a, b, c].map(|corner| points[*corner]);
        0.5 * (b - a).cross(&(c - a)).norm()
    };
    let (mut face, mut with_splines) = (0, Vec::new());
    for shell in &shells {
        assert!(!shell.closed);
        let geometry = ShellGeometry::new(shell, &graph);
        for bounded in &shell.faces {
            let is_spline = |step: &Step| matches!(step.curve, CurveIndex::Spline(_));
            if bounded.steps().any(is_spline) {
                let area: f64 = triangles[face].iter().map(cut).sum();
                with_splines.push((bounded.loops.len(), geometry.area(bounded).abs(), area));
            }
            face += 1;
        }
    }
    assert_eq!(face, 7);
    with_splines.sort_by_key(|(loops, ..)| *loops);
    let [(1, half, half_cut), (2, top, top_cut)] = with_splines[..] else {
        panic!("{with_splines:?}");
    };
    // What the curves enclose, by many points.
    let enclosed = |spline: &Spline| {
        let points = spline.points(1e-3);
        let pairs = points.windows(2).map(|ends| ends[0].cross(&ends[1]));
        0.5 * pairs.sum::<Vector3<f64>>()
    };
    assert!((top - (1.0 - enclosed(&splines[0]).z.abs())).abs() < 1e-5);
    assert!((half - enclosed(&splines[1]).y.abs()).abs() < 1e-5);
    assert!((top_cut - top).abs() < 1e-3 && (half_cut - half).abs() < 1e-3);
}
