//! An arc in an orthographic view: a part of an ellipse.

use crate::orthographic::Drawing;
use neat_core::CircularArc;
use std::f64::consts::FRAC_PI_2;
use std::fmt::Write;

/// Thinner than so many pixels an ellipse is a line there and back: its arcs by their ends are
/// not determined by numbers of a millionth of a pixel.
const MIN_RADIUS: f64 = 0.01;

/// Shorter pieces, in radians, join the piece beside them: of numbers of a millionth of a pixel
/// some programs make the whole ellipse instead.
const MIN_PIECE: f64 = 1e-5;

/// The commands of an SVG path that draw it, by elliptical arcs from one end of the ellipse's
/// axes to the next.
pub fn elliptical_path(arc: &CircularArc, drawing: &Drawing) -> String {
    let center = drawing.project(&arc.center);
    let [x, y] = [0.0, FRAC_PI_2].map(|angle| drawing.project(&arc.point_at(angle)) - center);
    // Turned by this angle, the images of both axes are perpendicular, the longer one first.
    let turn = 0.5 * (2.0 * x.dot(&y)).atan2(x.norm_squared() - y.norm_squared());
    let (sine, cosine) = turn.sin_cos();
    let (major, minor) = (cosine * x + sine * y, cosine * y - sine * x);
    let rotation = major.y.atan2(major.x).to_degrees();
    let thin = minor.norm();
    let thin = if thin < MIN_RADIUS { 0.0 } else { thin };
    let sweep = u8::from(major.perp(&minor) > 0.0);

    let at = |angle: f64| center + angle.cos() * major + angle.sin() * minor;
    let [mut angle, last] = arc.angles.map(|angle| angle - turn);
    let start = at(angle);
    let mut path = format!("M{:.6} {:.6}", start.x, start.y);
    while angle < last {
        let next = (((angle + MIN_PIECE) / FRAC_PI_2).floor() + 1.0) * FRAC_PI_2;
        angle = if next < last - MIN_PIECE { next } else { last };
        let end = at(angle);
        let _ = write!(
            path,
            "A{:.6} {thin:.6} {rotation:.9} 0 {sweep} {:.6} {:.6}",
            major.norm(),
            end.x,
            end.y
        );
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ViewDirection;
    use crate::orthographic::Frame;
    use nalgebra::Vector3;

    #[test]
    fn no_piece_is_too_short_to_be_told() {
        // From above it is an ellipse whose longer axis is that of x.
        for (ends, pieces) in [
            ([0.0, FRAC_PI_2 + 1e-8], 1),
            ([-1e-8, FRAC_PI_2], 1),
            ([0.0, FRAC_PI_2 + 0.01], 2),
            ([0.0, 4.0 * FRAC_PI_2], 4),
        ] {
            let arc = CircularArc {
                center: Vector3::zeros(),
                axes: [Vector3::x(), Vector3::new(0.0, 0.6, 0.8)],
                radius: 1.0,
                angles: ends,
            };
            let drawing =
                Drawing::new(&arc.points(0.1), Frame::All, ViewDirection::Top, 1000).unwrap();
            let path = elliptical_path(&arc, &drawing);
            assert_eq!(path.matches('A').count(), pieces, "{path}");
        }
    }
}
