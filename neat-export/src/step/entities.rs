//! The numbered lines of a STEP file, and what of them any file needs.

use crate::LengthUnit;
use nalgebra::Vector3;
use neat_core::{CircularArc, Spline};
use std::fmt::Write;

/// The unit vector between two points, if they differ. First scaled, so that no
/// square overflows or vanishes.
fn direction(start: &Vector3<f64>, end: &Vector3<f64>) -> Option<Vector3<f64>> {
    let halved = end / 2.0 - start / 2.0;
    let largest = halved.amax();
    (largest > 0.0).then(|| (halved / largest).normalize())
}

/// The numbered lines of a data section.
#[derive(Default)]
pub(super) struct Entities {
    text: String,
    count: usize,
}

impl Entities {
    /// Appends an instance; returns its name.
    pub fn add(&mut self, entity: &str) -> String {
        self.count += 1;
        let _ = writeln!(self.text, "#{}={entity};", self.count);
        format!("#{}", self.count)
    }

    pub fn point(&mut self, point: &Vector3<f64>) -> String {
        self.add(&format!("CARTESIAN_POINT('',{})", triple(point)))
    }

    /// A place with its z axis and its x axis.
    pub fn placement(
        &mut self,
        origin: &Vector3<f64>,
        z: &Vector3<f64>,
        x: &Vector3<f64>,
    ) -> String {
        let origin = self.point(origin);
        let [z, x] = [z, x].map(|axis| self.add(&format!("DIRECTION('',{})", triple(axis))));
        self.add(&format!("AXIS2_PLACEMENT_3D('',{origin},{z},{x})"))
    }

    pub fn vertex(&mut self, point: &Vector3<f64>) -> String {
        let point = self.point(point);
        self.add(&format!("VERTEX_POINT('',{point})"))
    }

    /// The edge along a straight line between two vertices; `None` if these are one point.
    pub fn straight_edge(
        &mut self,
        [from, to]: [&String; 2],
        [start, end]: [&Vector3<f64>; 2],
    ) -> Option<String> {
        self.named_edge("", [from, to], [start, end])
    }

    /// The same with a name.
    pub fn named_edge(
        &mut self,
        name: &str,
        [from, to]: [&String; 2],
        [start, end]: [&Vector3<f64>; 2],
    ) -> Option<String> {
        let direction = direction(start, end)?;
        let vector = self.vector(&direction);
        let origin = self.point(start);
        let line = self.add(&format!("LINE('',{origin},{vector})"));
        Some(self.add(&format!("EDGE_CURVE('{name}',{from},{to},{line},.T.)")))
    }

    /// Of length 1.
    pub fn vector(&mut self, direction: &Vector3<f64>) -> String {
        let direction = self.add(&format!("DIRECTION('',{})", triple(direction)));
        self.add(&format!("VECTOR('',{direction},1.0)"))
    }

    /// The edge along an arc between two vertices.
    pub fn arc_edge(&mut self, name: &str, [from, to]: [&String; 2], arc: &CircularArc) -> String {
        let placement = self.placement(&arc.center, &arc.normal().normalize(), &arc.axes[0]);
        let circle = self.add(&format!("CIRCLE('',{placement},{})", real(arc.radius)));
        self.add(&format!("EDGE_CURVE('{name}',{from},{to},{circle},.T.)"))
    }

    /// The edge along a spline between two vertices, which are one if it runs around.
    pub fn spline_edge(&mut self, [from, to]: [&String; 2], spline: &Spline) -> String {
        let curve = self.spline(spline);
        self.add(&format!("EDGE_CURVE('',{from},{to},{curve},.T.)"))
    }

    /// A spline as a curve.
    pub fn spline(&mut self, spline: &Spline) -> String {
        let controls = clamped_controls(spline);
        let controls: Vec<String> = controls.iter().map(|point| self.point(point)).collect();
        let [multiplicities, knots] = clamped_knots(spline.pieces());
        let closed = if spline.closed { ".T." } else { ".F." };
        self.add(&format!(
            "B_SPLINE_CURVE_WITH_KNOTS('',3,({}),.UNSPECIFIED.,{closed},.F.,({multiplicities}),({knots}),.UNSPECIFIED.)",
            controls.join(","),
        ))
    }

    /// A bicubic B-spline with uniform knots that are repeated at the ends, by its rows of control
    /// points.
    pub fn spline_surface(&mut self, rows: &[Vec<Vector3<f64>>]) -> String {
        let counts = [rows.len(), rows.first().map_or(0, Vec::len)];
        let [of_rows, of_columns] = counts.map(|count| clamped_knots(count.saturating_sub(3)));
        let row = |row: &Vec<Vector3<f64>>| {
            let points: Vec<String> = row.iter().map(|point| self.point(point)).collect();
            format!("({})", points.join(","))
        };
        let rows: Vec<String> = rows.iter().map(row).collect();
        self.add(&format!(
            "B_SPLINE_SURFACE_WITH_KNOTS('',3,3,({}),.UNSPECIFIED.,.F.,.F.,.F.,({}),({}),({}),({}),.UNSPECIFIED.)",
            rows.join(","),
            of_rows[0],
            of_columns[0],
            of_rows[1],
            of_columns[1],
        ))
    }

    /// The product whose shape the wireframe is.
    pub fn product(&mut self, name: &str, context: &str) -> String {
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

    pub fn geometric_context(&mut self, unit: LengthUnit) -> String {
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
    pub fn file(self) -> String {
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

/// The control points by which a spline is one whose first and last knots are repeated, so that it
/// begins and ends at the first and the last of them.
pub(super) fn clamped_controls(spline: &Spline) -> Vec<Vector3<f64>> {
    let beziers = spline.beziers();
    match (spline.closed, &beziers[..]) {
        // Repeated knots leave the control points alone that depend on none of them.
        (true, [first, .., last]) => {
            let between = spline.controls[2..].iter().chain([&spline.controls[0]]);
            let mut controls = vec![first[0], first[1]];
            controls.extend(between);
            controls.extend([last[2], first[0]]);
            controls
        }
        _ => spline.controls.clone(),
    }
}

/// The multiplicities of uniform knots for so many cubic pieces that are repeated at the ends, and the
/// knots.
fn clamped_knots(pieces: usize) -> [String; 2] {
    let multiplicity = |knot: usize| {
        if knot == 0 || knot == pieces {
            "4"
        } else {
            "1"
        }
    };
    let multiplicities: Vec<&str> = (0..=pieces).map(multiplicity).collect();
    let knots: Vec<String> = (0..=pieces).map(|knot| real(knot as f64)).collect();
    [multiplicities.join(","), knots.join(",")]
}

fn triple(point: &Vector3<f64>) -> String {
    format!("({},{},{})", real(point.x), real(point.y), real(point.z))
}

/// A number that reads back as the same one. STEP demands a decimal point and a
/// capital E.
pub(super) fn real(value: f64) -> String {
    let text = format!("{value:?}");
    match text.split_once('e') {
        None => text,
        Some((mantissa, exponent)) if mantissa.contains('.') => format!("{mantissa}E{exponent}"),
        Some((mantissa, exponent)) => format!("{mantissa}.0E{exponent}"),
    }
}

/// A quoted string. Quotes and backslashes are doubled, control characters become
/// spaces, and what is not ASCII is encoded (ISO 10303-21, 6.4.3).
pub(super) fn string(text: &str) -> String {
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
