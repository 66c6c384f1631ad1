//! How certain an edge is, in classes that layers and colours can show.

use crate::edge_filter::{PROBABILITY, SUPPORTING_VIEWS};
use neat_wireframe::export::WireframeDocument;

/// From this probability on, an edge is of high or medium confidence.
const PROBABILITIES: [f64; 2] = [0.9, 0.5];
/// The same in supporting views, where there is no probability.
const VIEWS: [f64; 2] = [5.0, 3.0];

/// How certain an edge is.
///
/// By its field `probability`: high from 0.9, medium from 0.5. Where the document
/// has none, by `supporting_views`: high from 5, medium from 3. Without either,
/// unknown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Confidence {
    /// Nothing is said about it.
    Unknown,
    /// Probability below 0.5, or at most two views.
    Low,
    /// Probability from 0.5, or three or four views.
    Medium,
    /// Probability from 0.9, or at least five views.
    High,
}

impl Confidence {
    /// All classes, in the order in which pictures draw them: the most certain
    /// last, on top.
    pub const ALL: [Self; 4] = [Self::Unknown, Self::Low, Self::Medium, Self::High];

    /// The class of every edge.
    pub fn of_edges(document: &WireframeDocument) -> Vec<Self> {
        let fields = document.edge_fields.named();
        let field = |name| fields.get(name);
        let (values, [high, medium]) = match (field(PROBABILITY), field(SUPPORTING_VIEWS)) {
            (Some(probabilities), _) => (probabilities, PROBABILITIES),
            (None, Some(views)) => (views, VIEWS),
            (None, None) => return vec![Self::Unknown; document.edges.len()],
        };
        let class = |value: &f64| match *value {
            value if value >= high => Self::High,
            value if value >= medium => Self::Medium,
            _ => Self::Low,
        };
        values.iter().map(class).collect()
    }

    /// The edges of every class that has some, in the order of [`Self::ALL`].
    pub(crate) fn groups(document: &WireframeDocument) -> Vec<(Self, Vec<usize>)> {
        let classes = Self::of_edges(document);
        let edges_of = |class| {
            (0..classes.len())
                .filter(|&e| classes[e] == class)
                .collect()
        };
        let groups = Self::ALL.map(|class| (class, edges_of(class)));
        let has_some = |(_, edges): &(Self, Vec<usize>)| !edges.is_empty();
        groups.into_iter().filter(has_some).collect()
    }

    /// Its name, for layers, classes and legends.
    pub fn name(self) -> &'static str {
        match self {
            Self::Unknown => "unknown",
            Self::Low => "low",
            Self::Medium => "medium",
            Self::High => "high",
        }
    }

    /// Its colour in pictures: red, green and blue of sRGB, told apart by colour-blind
    /// people too (Okabe and Ito).
    pub fn color(self) -> [u8; 3] {
        match self {
            Self::Unknown => [0x40, 0x40, 0x40],
            Self::Low => [0xd5, 0x5e, 0x00],
            Self::Medium => [0xe6, 0x9f, 0x00],
            Self::High => [0x00, 0x72, 0xb2],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probability_goes_before_views() {
        let mut document = WireframeDocument {
            edges: vec![[0, 0]; 4],
            ..WireframeDocument::default()
        };
        let names = |document: &WireframeDocument| -> Vec<_> {
            let classes = Confidence::of_edges(document);
            classes.into_iter().map(Confidence::name).collect()
        };
        assert_eq!(names(&document), ["unknown"; 4]);
        let mut set = |name: &str, values| {
            let mut fields = document.edge_fields.named();
            fields.insert(name.into(), values);
            document.edge_fields = fields.into();
            names(&document)
        };
        let by_views = set(SUPPORTING_VIEWS, vec![2.0, 3.0, 4.0, 5.0]);
        assert_eq!(by_views, ["low", "medium", "medium", "high"]);
        let by_probability = set(PROBABILITY, vec![0.0, 0.9, 0.5, 0.49]);
        assert_eq!(by_probability, ["low", "high", "medium", "low"]);
    }
}
