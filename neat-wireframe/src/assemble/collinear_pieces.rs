//! Lines that are pieces of one become one: what hides an edge in many views cuts it.

use super::edge_samples::Images;
use super::line_selection::ChosenLine;
use neat_core::LineSegment3;

/// Pieces of one line lie within so many reaches of it …
const REACHES: f64 = 3.0;
/// … and no farther apart along it than this, in pixels.
pub(super) const MAX_GAP: f64 = 8.0;

/// Merges pieces, those that most views show first.
pub(super) fn merge_pieces(images: &Images, mut lines: Vec<ChosenLine>) -> Vec<ChosenLine> {
    lines.sort_by(|a, b| {
        let views = |line: &ChosenLine| line.evidence.showing.len();
        (views(b).cmp(&views(a))).then(b.line.length().total_cmp(&a.line.length()))
    });
    let size = |line: &ChosenLine| images.pixel_size(&line.line, line.evidence.views());
    // With the size of a pixel.
    let mut merged: Vec<(f64, ChosenLine)> = Vec::new();
    for piece in lines {
        let pixel = size(&piece);
        let same = merged.iter_mut().find(|(other_pixel, other)| {
            continues(
                &other.line,
                &piece.line,
                pixel.min(*other_pixel),
                images.reach,
            )
        });
        match same {
            None => merged.push((pixel, piece)),
            Some((pixel, line)) => {
                join(images, line, piece);
                *pixel = size(line);
            }
        }
    }
    merged.into_iter().map(|(_, line)| line).collect()
}

/// Whether `piece` lies on `line`, beside or next to it.
fn continues(line: &LineSegment3, piece: &LineSegment3, pixel: f64, reach: f64) -> bool {
    let places = piece.ends().map(|end| line.line_parameter(&end));
    let near =
        (piece.ends().iter()).all(|end| line.distance_to_line(end) <= REACHES * reach * pixel);
    let [low, high] = [places[0].min(places[1]), places[0].max(places[1])];
    near && (low - 1.0).max(-high) * line.length() <= MAX_GAP * pixel
}

fn join(images: &Images, line: &mut ChosenLine, piece: ChosenLine) {
    let places = piece.line.ends().map(|end| line.line.line_parameter(&end));
    let [low, high] = [places[0].min(places[1]), places[0].max(places[1])];
    let whole = LineSegment3::new(
        line.line.point_at(low.min(0.0)),
        line.line.point_at(high.max(1.0)),
    );
    for showing in piece.evidence.showing {
        if line.evidence.views().all(|view| view != showing.view) {
            line.evidence.showing.push(showing);
        }
    }
    line.evidence.showing.sort_by_key(|showing| showing.view);
    line.line = images.fit(&whole, line.evidence.views(), images.reach);
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn pieces_continue_a_line_and_parallels_do_not() {
        let piece = |from: f64, to: f64, beside: f64| {
            LineSegment3::new(
                Vector3::new(from, beside, 0.0),
                Vector3::new(to, beside, 0.0),
            )
        };
        let line = piece(0.0, 1.0, 0.0);
        let is_same = |other: &LineSegment3| continues(&line, other, 0.01, 0.5);
        assert!(is_same(&piece(1.05, 2.0, 0.01)));
        assert!(is_same(&piece(2.0, 1.05, 0.01)));
        assert!(is_same(&piece(-0.5, 0.5, 0.0)));
        assert!(!is_same(&piece(1.2, 2.0, 0.0)));
        assert!(!is_same(&piece(-1.0, -0.2, 0.0)));
        assert!(!is_same(&piece(0.0, 1.0, 0.03)));
    }
}
