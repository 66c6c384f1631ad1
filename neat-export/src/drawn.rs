//! What is drawn by formats that know straight lines only: edges, and chains for arcs
//! and splines.

use crate::Confidence;
use neat_wireframe::Wireframe3d;
use neat_wireframe::export::WireframeDocument;

/// Name of the layers and groups that hold arcs …
pub const ARCS: &str = "arcs";
/// … and of those that hold splines.
pub const SPLINES: &str = "splines";
/// The colour of both, the bluish green of [`Confidence::color`]'s palette: no probability is known.
pub const CURVE_COLOR: [u8; 3] = [0x00, 0x9e, 0x73];

/// Straight pieces by what they are pieces of.
pub struct Drawn {
    /// See [`WireframeDocument::drawn`].
    pub wireframe: Wireframe3d,
    /// Name, colour and edges of the wireframe: a group per class of confidence, then the arcs
    /// and the splines.
    pub groups: Vec<(&'static str, [u8; 3], Vec<usize>)>,
}

impl Drawn {
    pub fn new(document: &WireframeDocument) -> Self {
        let wireframe = document.drawn();
        let pieces = |points: Vec<_>| points.len() - 1;
        let of_arcs = document.drawn_curves().take(document.arcs.len());
        let arcs = document.edges.len();
        let splines = arcs + of_arcs.map(pieces).sum::<usize>();
        let curves = [
            (ARCS, arcs..splines),
            (SPLINES, splines..wireframe.edges.len()),
        ];
        let mut groups: Vec<_> = (Confidence::groups(document).into_iter())
            .map(|(class, edges)| (class.name(), class.color(), edges))
            .collect();
        let curves = curves.into_iter().filter(|(_, edges)| !edges.is_empty());
        groups.extend(curves.map(|(name, edges)| (name, CURVE_COLOR, edges.collect())));
        Self { wireframe, groups }
    }
}
