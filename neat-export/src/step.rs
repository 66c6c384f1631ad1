//! STEP (ISO 10303-21) with an edge-based wireframe of AP214.
//!
//! Every junction is one `VERTEX_POINT`, which its `EDGE_CURVE`s share. Arcs are `EDGE_CURVE`s of
//! `CIRCLE`s between vertices of their own; a whole circle begins and ends at one. Open CASCADE
//! joins the edges of a `CONNECTED_EDGE_SET` to one wire and moves vertices where
//! more than two edges meet; so every edge is a set of its own, and its reader keeps
//! positions and shared vertices.

use crate::target::Target;
use crate::{ExportError, LengthUnit};
use nalgebra::Vector3;
use neat_core::CircularArc;
use std::fmt::Write;

/// Writes a STEP file.
pub fn write(to: &mut Target) -> Result<(), ExportError> {
    let document = to.document;
    let mut step = Entities::default();
    let context = step.add("APPLICATION_CONTEXT('automotive design')");
    step.add(&format!(
        "APPLICATION_PROTOCOL_DEFINITION('international standard','automotive_design',2000,{context})"
    ));
    let shape = step.product(&string(to.title()), &context);
    let geometry = step.geometric_context(to.options.unit);
    let origin = step.point(&Vector3::zeros());
    let placement = step.add(&format!("AXIS2_PLACEMENT_3D('',{origin},$,$)"));

    let vertices: Vec<String> = document
        .junctions
        .iter()
        .map(|junction| {
            let point = step.point(junction);
            step.add(&format!("VERTEX_POINT('',{point})"))
        })
        .collect();
    let mut sets = Vec::new();
    let mut lonely = vec![true; vertices.len()];
    for &[a, b] in &document.edges {
        let [start, end] = [a, b].map(|junction| document.junctions[junction]);
        let Some(direction) = direction(&start, &end) else {
            continue;
        };
        let direction = step.add(&format!("DIRECTION('',{})", triple(&direction)));
        let vector = step.add(&format!("VECTOR('',{direction},1.0)"));
        let origin = step.point(&start);
        let line = step.add(&format!("LINE('',{origin},{vector})"));
        let (from, to) = (&vertices[a], &vertices[b]);
        let edge = step.add(&format!("EDGE_CURVE('',{from},{to},{line},.T.)"));
        sets.push(step.add(&format!("CONNECTED_EDGE_SET('',({edge}))")));
        (lonely[a], lonely[b]) = (false, false);
    }
    let lines = sets.len();
    sets.extend(document.arcs.iter().filter_map(|arc| step.arc(arc)));
    let arcs = sets.len() - lines;
    let representation = if sets.is_empty() {
        format!("SHAPE_REPRESENTATION('',({placement}),{geometry})")
    } else {
        let model = step.add(&format!(
            "EDGE_BASED_WIREFRAME_MODEL('',({}))",
            sets.join(",")
        ));
        format!("EDGE_BASED_WIREFRAME_SHAPE_REPRESENTATION('',({placement},{model}),{geometry})")
    };
    let representation = step.add(&representation);
    step.add(&format!(
        "SHAPE_DEFINITION_REPRESENTATION({shape},{representation})"
    ));
    // A line needs a direction, and a vertex an edge.
    let lonely = lonely.iter().filter(|lonely| **lonely).count();
    for (count, what) in [
        (document.edges.len() - lines, "edges without length"),
        (lonely, "junctions without edges"),
        (document.arcs.len() - arcs, "arcs without length"),
    ] {
        to.leave_out(count, &format!("a STEP wireframe has no {what}"));
    }
    to.write(step.file())
}

/// The unit vector between two points, if they differ. First scaled, so that no
/// square overflows or vanishes.
fn direction(start: &Vector3<f64>, end: &Vector3<f64>) -> Option<Vector3<f64>> {
    let halved = end / 2.0 - start / 2.0;
    let largest = halved.amax();
    (largest > 0.0).then(|| (halved / largest).normalize())
}

/// The numbered lines of a data section.
#[derive(Default)]
struct Entities {
    text: String,
    count: usize,
}

impl Entities {
    /// Appends an instance; returns its name.
    fn add(&mut self, entity: &str) -> String {
        self.count += 1;
        let _ = writeln!(self.text, "#{}={entity};", self.count);
        format!("#{}", self.count)
    }

    fn point(&mut self, point: &Vector3<f64>) -> String {
        self.add(&format!("CARTESIAN_POINT('',{})", triple(point)))
    }

    /// An arc as a set of its own; `None` if its ends are the same numbers.
    fn arc(&mut self, arc: &CircularArc) -> Option<String> {
        let [start, end] = arc.angles.map(|angle| arc.point_at(angle));
        if start == end && !arc.is_closed() {
            return None;
        }
        let center = self.point(&arc.center);
        let [normal, x] = [arc.normal().normalize(), arc.axes[0]]
            .map(|axis| self.add(&format!("DIRECTION('',{})", triple(&axis))));
        let placement = self.add(&format!("AXIS2_PLACEMENT_3D('',{center},{normal},{x})"));
        let circle = self.add(&format!("CIRCLE('',{placement},{})", real(arc.radius)));
        let mut vertex = |point| {
            let point = self.point(point);
            self.add(&format!("VERTEX_POINT('',{point})"))
        };
        let from = vertex(&start);
        let to = if arc.is_closed() {
            from.clone()
        } else {
            vertex(&end)
        };
        let edge = self.add(&format!("EDGE_CURVE('',{from},{to},{circle},.T.)"));
        Some(self.add(&format!("CONNECTED_EDGE_SET('',({edge}))")))
    }

    /// The product whose shape the wireframe is.
    fn product(&mut self, name: &str, context: &str) -> String {
        let of_product = self.add(&format!("PRODUCT_CONTEXT('',{context},'mechanical')"));
        let product = self.add(&format!("PRODUCT({name},{name},'',({of_product}))"));
        self.add(&format!(
            "PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,({product}))"
        ));
        let formation = self.add(&format!("PRODUCT_DEFINITION_FORMATION('','',{product})"));
        let of_definition = self.add(&format!(
            "PRODUCT_DEFINITION_CONTEXT('part definition',{context},'design')"
        ));
        let definition = self.add(&format!(
            "PRODUCT_DEFINITION('design','',{formation},{of_definition})"
        ));
        self.add(&format!("PRODUCT_DEFINITION_SHAPE('','',{definition})"))
    }

    fn geometric_context(&mut self, unit: LengthUnit) -> String {
        let prefix = match unit {
            LengthUnit::Millimetre => ".MILLI.",
            LengthUnit::Centimetre => ".CENTI.",
            LengthUnit::Metre => "$",
        };
        let length = self.add(&format!(
            "(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT({prefix},.METRE.))"
        ));
        let angle = self.add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))");
        let solid = self.add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())");
        let uncertainty = self.add(&format!(
            "UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.0E-7),{length},'distance_accuracy_value','')"
        ));
        self.add(&format!(
            "(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT(({uncertainty}))GLOBAL_UNIT_ASSIGNED_CONTEXT(({length},{angle},{solid}))REPRESENTATION_CONTEXT('',''))"
        ))
    }

    /// The whole file. It states no time, so that the same wireframe is the same
    /// file.
    fn file(self) -> String {
        format!(
            "ISO-10303-21;\n\
             HEADER;\n\
             FILE_DESCRIPTION(('3D wireframe'),'2;1');\n\
             FILE_NAME('','',(''),(''),'neat','neat','');\n\
             FILE_SCHEMA(('AUTOMOTIVE_DESIGN {{ 1 0 10303 214 1 1 1 1 }}'));\n\
             ENDSEC;\n\
             DATA;\n\
             {}\
             ENDSEC;\n\
             END-ISO-10303-21;\n",
            self.text
        )
    }
}

fn triple(point: &Vector3<f64>) -> String {
    format!("({},{},{})", real(point.x), real(point.y), real(point.z))
}

/// A number that reads back as the same one. STEP demands a decimal point and a
/// capital E.
fn real(value: f64) -> String {
    let text = format!("{value:?}");
    match text.split_once('e') {
        None => text,
        Some((mantissa, exponent)) if mantissa.contains('.') => format!("{mantissa}E{exponent}"),
        Some((mantissa, exponent)) => format!("{mantissa}.0E{exponent}"),
    }
}

/// A quoted string. Quotes and backslashes are doubled, control characters become
/// spaces, and what is not ASCII is encoded (ISO 10303-21, 6.4.3).
fn string(text: &str) -> String {
    let mut quoted = String::from("'");
    for character in text.chars() {
        match character {
            '\'' => quoted.push_str("''"),
            '\\' => quoted.push_str("\\\\"),
            ' '..='~' => quoted.push(character),
            _ if character.is_control() => quoted.push(' '),
            _ if u32::from(character) <= 0xffff => {
                let _ = write!(quoted, "\\X2\\{:04X}\\X0\\", u32::from(character));
            }
            _ => {
                let _ = write!(quoted, "\\X4\\{:08X}\\X0\\", u32::from(character));
            }
        }
    }
    quoted.push('\'');
    quoted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reals_have_a_point_and_read_back() {
        for (value, text) in [
            (0.1, "0.1"),
            (-3.0, "-3.0"),
            (-0.0, "-0.0"),
            (1e300, "1.0E300"),
            (1.5e-7, "1.5E-7"),
            (5e-324, "5.0E-324"),
        ] {
            assert_eq!(real(value), text);
            assert_eq!(text.parse::<f64>().unwrap().to_bits(), value.to_bits());
        }
    }

    #[test]
    fn strings_cannot_break_out() {
        assert_eq!(string("it's \\ ok"), "'it''s \\\\ ok'");
        assert_eq!(string("a\nb\u{7f}"), "'a b '");
        assert_eq!(
            string("ä€😀"),
            "'\\X2\\00E4\\X0\\\\X2\\20AC\\X0\\\\X4\\0001F600\\X0\\'"
        );
    }
}
