//! What a surface of a building is, by CityGML's definitions.

use super::polygon::{Polygon, sides};
use nalgebra::Vector3;

/// Sine of 10°: walls lean by less. Roofs are hardly steeper than 80°, spires among them, and the
/// planes of walls that are short or seen from afar are some degrees off.
const WALL: f64 = 0.173_648_177_666_930_33;
/// Surfaces lie at the bottom of a building, or above another one, by more than this share of its
/// extent, as points lie on faces of shells.
const MARGIN: f64 = 0.02;

/// What a surface of a building is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SurfaceType {
    /// The ground plate.
    Ground,
    /// Upright.
    Wall,
    /// Upward, below the sky.
    Roof,
    /// Downward above the ground: of a passage, say, or the eaves.
    OuterCeiling,
    /// Upward, and most of it below another surface: of a loggia, say.
    OuterFloor,
}

impl SurfaceType {
    /// The name in the file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ground => "GroundSurface",
            Self::Wall => "WallSurface",
            Self::Roof => "RoofSurface",
            Self::OuterCeiling => "OuterCeilingSurface",
            Self::OuterFloor => "OuterFloorSurface",
        }
    }
}

/// What each surface of a building is that stands at the height `bottom`. +z is up.
pub(super) fn surface_types(polygons: &[Polygon], bottom: f64) -> Vec<SurfaceType> {
    let points = || (polygons.iter()).flat_map(|polygon| polygon.rings.iter().flatten());
    let bound = |axis: usize, pick: fn(f64, f64) -> f64| points().map(|p| p[axis]).reduce(pick);
    let length = |axis| bound(axis, f64::max).zip(bound(axis, f64::min));
    let lengths = (0..3).filter_map(|axis| length(axis).map(|(high, low)| high - low));
    let margin = MARGIN * lengths.fold(0.0, f64::max);
    let flat: Vec<Flat> = polygons.iter().filter_map(Flat::new).collect();
    let of_polygon = |polygon: &Polygon| {
        let Some(this) = Flat::new(polygon) else {
            return SurfaceType::Wall;
        };
        let outer = &polygon.rings[0];
        if this.normal.z < 0.0 {
            return match outer.iter().all(|point| point.z <= bottom + margin) {
                true => SurfaceType::Ground,
                false => SurfaceType::OuterCeiling,
            };
        }
        let is_below = |at: &Vector3<f64>| flat.iter().any(|above| above.is_above(at, margin));
        let (mut covered, mut all) = (0.0, 0.0);
        for (point, area) in this.samples() {
            all += area;
            covered += if is_below(&point) { area } else { 0.0 };
        }
        match 2.0 * covered > all {
            true => SurfaceType::OuterFloor,
            false => SurfaceType::Roof,
        }
    };
    polygons.iter().map(of_polygon).collect()
}

/// A polygon that is no wall, as one looks down on it.
struct Flat<'a> {
    polygon: &'a Polygon,
    normal: Vector3<f64>,
}

impl<'a> Flat<'a> {
    /// `None` of walls and of what has no area.
    fn new(polygon: &'a Polygon) -> Option<Self> {
        let normal = polygon.area_vector().try_normalize(0.0)?;
        (normal.z.abs() > WALL).then_some(Self { polygon, normal })
    }

    /// Height of its plane.
    fn height(&self, x: f64, y: f64) -> f64 {
        let at = self.polygon.rings[0][0];
        at.z - (self.normal.x * (x - at.x) + self.normal.y * (y - at.y)) / self.normal.z
    }

    /// Where its sides cross the line of one y, ascending: it reaches from the first to the
    /// second, from the third to the fourth, and so on.
    fn crossings(&self, y: f64) -> Vec<f64> {
        let sides = self.polygon.rings.iter().flat_map(|ring| sides(ring));
        let crossing = sides.filter(|[a, b]| (a.y > y) != (b.y > y));
        let mut crossings: Vec<f64> = crossing
            .map(|[a, b]| a.x + (b.x - a.x) * (y - a.y) / (b.y - a.y))
            .collect();
        crossings.sort_by(f64::total_cmp);
        crossings
    }

    /// Whether it covers a point from more than `margin` above it.
    fn is_above(&self, at: &Vector3<f64>, margin: f64) -> bool {
        self.height(at.x, at.y) > at.z + margin
            && self.crossings(at.y).iter().filter(|x| **x > at.x).count() % 2 == 1
    }

    /// The middles of trapezoids that are all of it, and their areas.
    fn samples(&self) -> Vec<(Vector3<f64>, f64)> {
        let corners = self.polygon.rings.iter().flatten();
        let mut levels: Vec<f64> = corners.map(|point| point.y).collect();
        levels.sort_by(f64::total_cmp);
        let mut samples = Vec::new();
        for level in levels.windows(2) {
            let y = level[0] + (level[1] - level[0]) / 2.0;
            for pair in self.crossings(y).chunks_exact(2) {
                let x = pair[0] + (pair[1] - pair[0]) / 2.0;
                let area = (pair[1] - pair[0]) * (level[1] - level[0]);
                samples.push((Vector3::new(x, y, self.height(x, y)), area));
            }
        }
        samples
    }
}
