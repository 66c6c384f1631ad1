//! SVG 1.1: an orthographic view with a group per class of confidence, one of arcs, which are
//! elliptical arcs, and one of splines, which are cubic Bézier curves.
//!
//! Coordinates are pixels, to a millionth; the attributes `data-scale` and
//! `data-center` of the root lead back to the units of the document:
//! right = center₀ + (x − width / 2) / scale, up = center₁ − (y − height / 2) / scale.

use crate::drawn::{ARCS, CURVE_COLOR, SPLINES};
use crate::orthographic::{Drawing, Frame};
use crate::projected_arc::elliptical_path;
use crate::target::Target;
use crate::{Confidence, ExportError};
use neat_core::Spline;
use std::fmt::Write;

/// Writes an SVG file.
pub fn write(to: &mut Target) -> Result<(), ExportError> {
    let (document, drawing) = (to.document, to.drawing(Frame::All)?);
    let (width, height) = (drawing.width, drawing.height);
    let [right, up] = drawing.direction.right_and_up();
    let line_width = drawing.line_width(document.edges.len());
    let mut svg = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\" \
         data-direction=\"{}\" data-right=\"{:?} {:?} {:?}\" data-up=\"{:?} {:?} {:?}\" \
         data-scale=\"{:?}\" data-center=\"{:?} {:?}\">\n\
         <title>{}</title>\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n",
        drawing.direction.name(),
        right.x,
        right.y,
        right.z,
        up.x,
        up.y,
        up.z,
        drawing.scale,
        drawing.center.x,
        drawing.center.y,
        escaped(to.title()),
    );
    let group = |id: &str, title: &str, [red, green, blue]: [u8; 3]| {
        format!(
            "<g id=\"{id}\" fill=\"none\" stroke=\"#{red:02x}{green:02x}{blue:02x}\" \
             stroke-width=\"{line_width:.3}\" stroke-linecap=\"round\">\n\
             <title>{title}</title>\n"
        )
    };
    for (class, edges) in Confidence::groups(document) {
        let (id, title) = (
            ["confidence-", class.name()],
            ["confidence: ", class.name()],
        );
        svg.push_str(&group(&id.concat(), &title.concat(), class.color()));
        for edge in edges {
            let [a, b] = document.edges[edge];
            let [start, end] = [a, b].map(|end| drawing.project(&document.junctions[end]));
            let _ = writeln!(
                svg,
                "<line data-edge=\"{edge}\" data-junctions=\"{a} {b}\" \
                 x1=\"{:.6}\" y1=\"{:.6}\" x2=\"{:.6}\" y2=\"{:.6}\"/>",
                start.x, start.y, end.x, end.y
            );
        }
        svg.push_str("</g>\n");
    }
    if !document.arcs.is_empty() {
        svg.push_str(&group(ARCS, ARCS, CURVE_COLOR));
        for (index, arc) in document.arcs.iter().enumerate() {
            let path = elliptical_path(arc, &drawing);
            let _ = writeln!(svg, "<path data-arc=\"{index}\" d=\"{path}\"/>");
        }
        svg.push_str("</g>\n");
    }
    if !document.splines.is_empty() {
        svg.push_str(&group(SPLINES, SPLINES, CURVE_COLOR));
        for (index, spline) in document.splines.iter().enumerate() {
            let path = cubic_path(spline, &drawing);
            let _ = writeln!(svg, "<path data-spline=\"{index}\" d=\"{path}\"/>");
        }
        svg.push_str("</g>\n");
    }
    svg.push_str("<g id=\"junctions\" fill=\"#111111\">\n");
    for point in document.junctions.iter().map(|p| drawing.project(p)) {
        let _ = writeln!(
            svg,
            "<circle cx=\"{:.6}\" cy=\"{:.6}\" r=\"{line_width:.3}\"/>",
            point.x, point.y
        );
    }
    svg.push_str("</g>\n</svg>\n");
    to.write(svg)
}

/// The commands of a path that draw a spline: parallel projection takes the control points of its
/// cubic pieces to those of theirs.
fn cubic_path(spline: &Spline, drawing: &Drawing) -> String {
    let mut path = String::new();
    for (piece, controls) in spline.beziers().iter().enumerate() {
        let [a, b, c, d] = controls.map(|point| drawing.project(&point));
        if piece == 0 {
            let _ = write!(path, "M{:.6} {:.6}", a.x, a.y);
        }
        let _ = write!(
            path,
            "C{:.6} {:.6} {:.6} {:.6} {:.6} {:.6}",
            b.x, b.y, c.x, c.y, d.x, d.y
        );
    }
    path
}

/// Text as XML content. What XML 1.0 cannot hold at all becomes U+FFFD.
fn escaped(text: &str) -> String {
    let mut escaped = String::new();
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '\t' | '\n' | '\r' => escaped.push(' '),
            '\0'..='\u{1f}' | '\u{fffe}' | '\u{ffff}' => escaped.push('\u{fffd}'),
            _ => escaped.push(character),
        }
    }
    escaped
}
