//! What is drawn by formats that know straight lines only: edges, and chains for arcs.

use crate::Confidence;
use neat_wireframe::Wireframe3d;
use neat_wireframe::export::WireframeDocument;

/// Name of the layers and groups that hold arcs.
pub const ARCS: &str = "arcs";
/// Their colour, the bluish green of [`Confidence::color`]'s palette: no probability is known.
pub const ARC_COLOR: [u8; 3] = [0x00, 0x9e, 0x73];

/// Straight pieces by what they are pieces of.
pub struct Drawn {
    /// See [`WireframeDocument::drawn`].
    pub wireframe: Wireframe3d,
    /// Name, colour and edges of the wireframe: a group per class of confidence, then the arcs.
    pub groups: Vec<(&'static str, [u8; 3], Vec<usize>)>,
}

impl Drawn {
    pub fn new(document: &WireframeDocument) -> Self {
        let wireframe = document.drawn();
        let of_arcs: Vec<usize> = (document.edges.len()..wireframe.edges.len()).collect();
        let mut groups: Vec<_> = (Confidence::groups(document).into_iter())
            .map(|(class, edges)| (class.name(), class.color(), edges))
            .collect();
        if !of_arcs.is_empty() {
            groups.push((ARCS, ARC_COLOR, of_arcs));
        }
        Self { wireframe, groups }
    }
}
