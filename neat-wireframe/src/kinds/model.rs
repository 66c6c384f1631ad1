//! From witnesses to probabilities.
//!
//! The log-odds that an edge is structure are a sum: the prior, and what each witness adds.
//! A witness that knows nothing is 0 and adds nothing. The weights are those of a logistic
//! regression whose signs are given, each edge counted by its length and each scene as much as
//! the others, on the edges of 16 rendered scenes with exact truth: five houses, six façades, five
//! tables with things on them (`house_1`, `facade_1`, `objects_1`, and 13 of
//! `scripts/make_photographs.py`). Edges that lie on no surface count as false. In parentheses the
//! weights with one scene left out.

/// Where no witness knows anything (0.5 to 0.8, all but this and evenness rounded from the middle:
/// with 0.7 and -2.1, no worse on photographs, facets of a round CAD part stay).
const PRIOR: f64 = 0.6;
/// Neighbours that leave the plane of the edge (0.7 to 1.0).
const LEAVES_PLANE: f64 = 0.85;
/// Sides of two colours: two materials, mostly two faces (2.0 to 2.4).
const CHROMA: f64 = 2.1;
/// One plane on both sides (-3.3 to -2.9).
const COPLANARITY: f64 = -3.1;
/// Darker than both its sides: a joint, or a line that is drawn (-1.2 to -0.8).
const DARKNESS: f64 = -1.0;
/// Brighter than both: a bar before panes, or a crease that catches light (3.4 to 3.8).
const BRIGHTNESS: f64 = 3.6;
/// Both sides as bright as each other, from all views: two faces hardly are (-2.4 to -1.7).
const EVENNESS: f64 = -2.3;
/// Few of the views that ought to show it do: leaves, and lines between things that are none
/// (-4.4 to -3.8).
const RARITY: f64 = -4.1;

/// Logarithm of the ratio of colours at which a difference is clear: ten percent.
const CLEAR_CHROMA: f64 = 0.1;
/// Logarithm of the ratio at which darkness says all it can: a third darker.
const CLEAR_DARKNESS: f64 = 0.4;
/// Added to brightnesses before they are compared: less is noise.
const FAINT: f64 = 0.03;

/// What is known about an edge; all zero where nothing is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Witnesses {
    /// 0 to 1, see `leaves_plane`.
    pub leaves_plane: f64,
    /// 0 to 1: few of many views show it.
    pub rarity: f64,
    /// 0 to 1, see `coplanarity`.
    pub coplanarity: f64,
    /// 0 to 1: its sides look alike.
    pub evenness: f64,
    /// The others as in `SideColours`.
    pub chroma: f64,
    pub step: f64,
    pub darkness: f64,
    pub instability: f64,
}

/// What an edge can be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EdgeKind {
    /// Two faces meet.
    Crease,
    /// A surface ends before what lies behind it, or turns away.
    Boundary,
    /// Paint, a joint, a change of material within a face.
    Texture,
    /// The border of a shadow, or a reflection.
    Shadow,
}

/// The probabilities of the kinds of an edge; their sum is 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeKinds {
    /// Of [`EdgeKind::Crease`].
    pub crease: f64,
    /// Of [`EdgeKind::Boundary`].
    pub boundary: f64,
    /// Of [`EdgeKind::Texture`].
    pub texture: f64,
    /// Of [`EdgeKind::Shadow`].
    pub shadow: f64,
}

impl EdgeKinds {
    /// Of an edge at which two faces are known to meet.
    pub const CREASE: Self = Self {
        crease: 1.0,
        boundary: 0.0,
        texture: 0.0,
        shadow: 0.0,
    };
    /// Of a line on a face that is known to have no edge there.
    pub const TEXTURE: Self = Self {
        crease: 0.0,
        boundary: 0.0,
        texture: 1.0,
        shadow: 0.0,
    };

    /// Probability that the edge belongs to the shape of things: a crease or a boundary.
    pub fn structure(&self) -> f64 {
        self.crease + self.boundary
    }

    /// Of an edge of two pieces, of which this is of so much of the length.
    pub(super) fn mixed(&self, other: &Self, share: f64) -> Self {
        let mix = |of: fn(&Self) -> f64| share * of(self) + (1.0 - share) * of(other);
        Self {
            crease: mix(|kinds| kinds.crease),
            boundary: mix(|kinds| kinds.boundary),
            texture: mix(|kinds| kinds.texture),
            shadow: mix(|kinds| kinds.shadow),
        }
    }

    /// The most likely kind and its probability; of structure, if that is more likely than
    /// not, else of the rest.
    pub fn most_likely(&self) -> (EdgeKind, f64) {
        let pair = if self.structure() >= 0.5 {
            [
                (EdgeKind::Crease, self.crease),
                (EdgeKind::Boundary, self.boundary),
            ]
        } else {
            [
                (EdgeKind::Texture, self.texture),
                (EdgeKind::Shadow, self.shadow),
            ]
        };
        if pair[1].1 > pair[0].1 {
            pair[1]
        } else {
            pair[0]
        }
    }
}

impl Witnesses {
    pub(super) fn kinds(&self) -> EdgeKinds {
        let clear = |difference: f64| 1.0 - (-difference / CLEAR_CHROMA).exp();
        let chroma = clear(self.chroma);
        let log_odds = PRIOR
            + LEAVES_PLANE * self.leaves_plane
            + RARITY * self.rarity
            + CHROMA * chroma
            + COPLANARITY * self.coplanarity
            + EVENNESS * self.evenness
            + DARKNESS * (self.darkness / CLEAR_DARKNESS).clamp(0.0, 1.0)
            + BRIGHTNESS * (-self.darkness / CLEAR_DARKNESS).clamp(0.0, 1.0);
        let structure = (1.0 + (-log_odds).exp()).recip();
        // One side that changes its colours from view to view is background.
        let boundary = clear(self.instability);
        // A shadow is a step within one material, paint a line or another colour.
        let step = (self.step + FAINT) / (self.step + self.darkness.abs() + 2.0 * FAINT);
        let shadow = step * (1.0 - chroma);
        EdgeKinds {
            crease: structure * (1.0 - boundary),
            boundary: structure * boundary,
            texture: (1.0 - structure) * (1.0 - shadow),
            shadow: (1.0 - structure) * shadow,
        }
    }
}
