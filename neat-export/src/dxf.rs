//! DXF of AutoCAD Release 12: `LINE` entities on layers by confidence, `ARC`s and `CIRCLE`s,
//! and splines as `POLYLINE`s, as this version has no others.
//!
//! Release 12 is the version that every CAD program reads. It states no unit and
//! shares no vertices; lines that meet have the same numbers at their ends, and all
//! junctions are `POINT`s on a layer of their own.

use crate::target::Target;
use crate::{Confidence, ExportError};
use nalgebra::Vector3;
use neat_core::CircularArc;
use neat_wireframe::export::WireframeDocument;
use std::fmt::{Display, Write};

/// Layer of the junctions …
const JUNCTIONS: &str = "JUNCTIONS";
/// … and of the arcs, whose confidence nobody knows …
const ARCS: &str = "ARCS";
/// … and of the splines, likewise.
const SPLINES: &str = "SPLINES";

/// A flag of a polyline: its last vertex is joined to its first …
const CLOSED: u32 = 1;
/// … and that it is one in space.
const IN_SPACE: u32 = 8;
/// The flag of a vertex of a polyline in space.
const VERTEX_IN_SPACE: u32 = 32;

/// Writes a DXF file.
pub fn write(to: &mut Target) -> Result<(), ExportError> {
    to.write(text(to.document))
}

fn text(document: &WireframeDocument) -> String {
    let mut dxf = Dxf::default();
    dxf.section("HEADER", |dxf| {
        dxf.group(9, "$ACADVER");
        dxf.group(1, "AC1009");
    });
    dxf.section("TABLES", |dxf| {
        dxf.table("LTYPE", 1, |dxf| {
            dxf.group(0, "LTYPE");
            dxf.group(2, "CONTINUOUS");
            dxf.group(70, 0);
            dxf.group(3, "Solid line");
            dxf.group(72, 65);
            dxf.group(73, 0);
            dxf.number(40, 0.0);
        });
        dxf.table("LAYER", Confidence::ALL.len() + 4, |dxf| {
            dxf.layer("0", 7);
            dxf.layer(JUNCTIONS, 8);
            dxf.layer(ARCS, 3);
            dxf.layer(SPLINES, 3);
            for class in Confidence::ALL {
                dxf.layer(layer(class), color_number(class));
            }
        });
    });
    dxf.section("ENTITIES", |dxf| {
        for ([a, b], class) in document.edges.iter().zip(Confidence::of_edges(document)) {
            dxf.group(0, "LINE");
            dxf.group(8, layer(class));
            dxf.point(10, &document.junctions[*a]);
            dxf.point(11, &document.junctions[*b]);
        }
        for arc in &document.arcs {
            dxf.arc(arc);
        }
        for spline in &document.splines {
            dxf.polyline(spline.points(WireframeDocument::TURN_OF_DRAWN_ARCS));
        }
        for junction in &document.junctions {
            dxf.group(0, "POINT");
            dxf.group(8, JUNCTIONS);
            dxf.point(10, junction);
        }
    });
    dxf.group(0, "EOF");
    dxf.text
}

fn layer(class: Confidence) -> &'static str {
    match class {
        Confidence::Unknown => "CONFIDENCE_UNKNOWN",
        Confidence::Low => "CONFIDENCE_LOW",
        Confidence::Medium => "CONFIDENCE_MEDIUM",
        Confidence::High => "CONFIDENCE_HIGH",
    }
}

/// AutoCAD colour index nearest to [`Confidence::color`]; 7 is black on white and
/// white on black.
fn color_number(class: Confidence) -> u8 {
    match class {
        Confidence::Unknown => 7,
        Confidence::Low => 1,
        Confidence::Medium => 40,
        Confidence::High => 5,
    }
}

/// A growing file: pairs of a group code and a value, a line each.
#[derive(Default)]
struct Dxf {
    text: String,
}

impl Dxf {
    /// Floats are written as `{:?}`, the shortest text that reads back as the same
    /// number.
    fn number(&mut self, code: u32, value: f64) {
        let _ = writeln!(self.text, "{code}\n{value:?}");
    }

    fn group(&mut self, code: u32, value: impl Display) {
        let _ = writeln!(self.text, "{code}\n{value}");
    }

    fn point(&mut self, code: u32, point: &Vector3<f64>) {
        self.number(code, point.x);
        self.number(code + 10, point.y);
        self.number(code + 20, point.z);
    }

    /// Centre and angles are in the *object coordinate system*, whose third axis is the normal and
    /// whose first one is that of the format's arbitrary axis algorithm.
    fn arc(&mut self, arc: &CircularArc) {
        let normal = arc.normal().normalize();
        let is_along_z = normal.x.abs().max(normal.y.abs()) < 1.0 / 64.0;
        let beside = if is_along_z {
            Vector3::y()
        } else {
            Vector3::z()
        };
        let x = beside.cross(&normal).normalize();
        let y = normal.cross(&x);
        let center = [x, y, normal].map(|axis| axis.dot(&arc.center));
        self.group(0, if arc.is_closed() { "CIRCLE" } else { "ARC" });
        self.group(8, ARCS);
        self.point(10, &center.into());
        self.number(40, arc.radius);
        if !arc.is_closed() {
            let turn = arc.axes[0].dot(&y).atan2(arc.axes[0].dot(&x));
            for (code, angle) in [(50, arc.angles[0]), (51, arc.angles[1])] {
                self.number(code, (turn + angle).to_degrees().rem_euclid(360.0));
            }
        }
        self.point(210, &normal);
    }

    /// Points along a spline; the first and the last of a closed one are the same.
    fn polyline(&mut self, mut points: Vec<Vector3<f64>>) {
        let closed = points.first() == points.last();
        if closed {
            points.pop();
        }
        self.group(0, "POLYLINE");
        self.group(8, SPLINES);
        self.group(66, 1);
        self.point(10, &Vector3::zeros());
        self.group(70, if closed { IN_SPACE | CLOSED } else { IN_SPACE });
        for point in &points {
            self.group(0, "VERTEX");
            self.group(8, SPLINES);
            self.point(10, point);
            self.group(70, VERTEX_IN_SPACE);
        }
        self.group(0, "SEQEND");
        self.group(8, SPLINES);
    }

    fn layer(&mut self, name: &str, color: u8) {
        self.group(0, "LAYER");
        self.group(2, name);
        self.group(70, 0);
        self.group(62, color);
        self.group(6, "CONTINUOUS");
    }

    fn section(&mut self, name: &str, fill: impl FnOnce(&mut Self)) {
        self.group(0, "SECTION");
        self.group(2, name);
        fill(self);
        self.group(0, "ENDSEC");
    }

    fn table(&mut self, name: &str, entries: usize, fill: impl FnOnce(&mut Self)) {
        self.group(0, "TABLE");
        self.group(2, name);
        self.group(70, entries);
        fill(self);
        self.group(0, "ENDTAB");
    }
}
