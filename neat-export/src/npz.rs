//! NumPy arrays: `lines3d` as the published NEAT code saves it, and the graph.

use crate::ExportError;
use crate::target::Target;
use nalgebra::Vector3;
use neat_core::npz::{NpyArray, NpyIntegers, write_npz_with_integers};
use neat_core::{CircularArc, Spline};
use std::collections::BTreeMap;

/// Writes `lines3d` `[E, 2, 3]`, the one array of the published code's
/// `…-wfi_checked.npz` (`neat-final-parsing.py`), and beside it `junctions` `[J, 3]`
/// and `edges` `[E, 2]`, by which lines share their ends; of arcs `arc_centers` `[A, 3]`,
/// `arc_axes` `[A, 2, 3]`, `arc_radii` `[A]` and `arc_angles` `[A, 2]`; of splines `spline_controls`
/// `[C, 3]`, the control points of one behind those of the other, and of each `spline_sizes` `[S]`,
/// how many are its own, and `spline_closed` `[S]`, 1 if it runs around, else 0. All numbers have
/// 64 bits.
pub fn write(to: &mut Target) -> Result<(), ExportError> {
    let document = to.document;
    let ends = document.edges.iter().flatten();
    let lines3d = NpyArray {
        shape: vec![document.edges.len(), 2, 3],
        values: ends
            .clone()
            .flat_map(|end| document.junctions[*end].iter().copied())
            .collect(),
    };
    let junctions = NpyArray {
        shape: vec![document.junctions.len(), 3],
        values: document.junctions.iter().flatten().copied().collect(),
    };
    let edges = NpyIntegers {
        shape: vec![document.edges.len(), 2],
        values: ends.map(|end| *end as i64).collect(),
    };
    let of_arcs = |shape: &[usize], values: &dyn Fn(&CircularArc) -> Vec<f64>| NpyArray {
        shape: [&[document.arcs.len()], shape].concat(),
        values: document.arcs.iter().flat_map(values).collect(),
    };
    let controls = document.splines.iter().flat_map(|spline| &spline.controls);
    let controls: Vec<f64> = controls.flatten().copied().collect();
    let spline_controls = NpyArray {
        shape: vec![controls.len() / 3, 3],
        values: controls,
    };
    let of_splines = |value: &dyn Fn(&Spline) -> i64| NpyIntegers {
        shape: vec![document.splines.len()],
        values: document.splines.iter().map(value).collect(),
    };
    let numbers = |points: &[Vector3<f64>]| points.iter().flatten().copied().collect();
    Ok(write_npz_with_integers(
        to.path,
        &BTreeMap::from([
            ("junctions", junctions),
            ("lines3d", lines3d),
            ("arc_centers", of_arcs(&[3], &|arc| numbers(&[arc.center]))),
            ("arc_axes", of_arcs(&[2, 3], &|arc| numbers(&arc.axes))),
            ("arc_radii", of_arcs(&[], &|arc| vec![arc.radius])),
            ("arc_angles", of_arcs(&[2], &|arc| arc.angles.to_vec())),
            ("spline_controls", spline_controls),
        ]),
        &BTreeMap::from([
            ("edges", edges),
            (
                "spline_sizes",
                of_splines(&|spline| spline.controls.len() as i64),
            ),
            (
                "spline_closed",
                of_splines(&|spline| i64::from(spline.closed)),
            ),
        ]),
    )?)
}
