//! The triangles of a marching cube for each of its 256 sign patterns.
//!
//! Instead of a table by hand, the surface is traced: on each face of the cube it
//! separates the inside corners from the outside ones, and where both diagonals
//! compete (the ambiguous faces of Lorensen and Cline's cases) it always separates the
//! *inside* corners from each other. The rule looks at nothing but the face's own four
//! signs, so the two cubes at a face agree, and a surface cannot have holes. The
//! traces around a cube close to loops, which are cut into triangles.

/// The corners of a cube: bit 0 of the index is x, bit 1 is y, bit 2 is z.
pub const CORNERS: usize = 8;

/// An edge of a cube: its corner with the smaller index, and its axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CubeEdge {
    /// The corner at its lower end.
    pub corner: usize,
    /// 0, 1, 2: along x, y, z.
    pub axis: usize,
}

impl CubeEdge {
    /// The edge between two corners that differ in one bit.
    fn between(a: usize, b: usize) -> Self {
        Self {
            corner: a & b,
            axis: (a ^ b).trailing_zeros() as usize,
        }
    }

    /// Whether some face of the cube holds both edges.
    fn shares_face_with(self, other: Self) -> bool {
        (0..3).any(|axis| {
            let side = 1 << axis;
            self.axis != axis && other.axis != axis && self.corner & side == other.corner & side
        })
    }
}

/// The corners of each face, counter-clockwise as seen from outside the cube.
const FACES: [[usize; 4]; 6] = [
    [0, 4, 6, 2],
    [1, 3, 7, 5],
    [0, 1, 5, 4],
    [2, 6, 7, 3],
    [0, 2, 3, 1],
    [4, 5, 7, 6],
];

/// The triangles of every sign pattern. Bit `i` of the index is set where corner `i`
/// is inside. Triangles are counter-clockwise as seen from outside the surface.
pub fn cube_cases() -> Vec<Vec<[CubeEdge; 3]>> {
    let triangles = |pattern| loops(pattern).iter().flat_map(|l| triangulate(l)).collect();
    (0..1 << CORNERS).map(triangles).collect()
}

/// The closed polygons in which the surface cuts the edges of a cube.
fn loops(pattern: usize) -> Vec<Vec<CubeEdge>> {
    let mut segments: Vec<[CubeEdge; 2]> = FACES.iter().flat_map(|f| on_face(pattern, f)).collect();
    let mut loops = Vec::new();
    while let Some([start, mut end]) = segments.pop() {
        let mut polygon = vec![start];
        while end != start {
            polygon.push(end);
            // Every cut edge lies on two faces: one segment arrives, one leaves.
            let next = segments.iter().position(|[from, _]| *from == end);
            let next = next.expect("cube_case: every trace continues");
            end = segments.swap_remove(next)[1];
        }
        loops.push(polygon);
    }
    loops
}

/// The traces of the surface on a face. Around each run of inside corners the trace
/// goes from the edge where the run begins to the edge where it ends: the inside is
/// on its right, seen from outside the cube.
fn on_face(pattern: usize, corners: &[usize; 4]) -> Vec<[CubeEdge; 2]> {
    let inside = |i: usize| pattern >> corners[i % 4] & 1 == 1;
    let edge = |i: usize| CubeEdge::between(corners[i % 4], corners[(i + 1) % 4]);
    let begins = (0..4).filter(|&i| !inside(i) && inside(i + 1));
    begins
        .map(|begin| {
            let length = (1..4).take_while(|n| inside(begin + n)).count();
            [edge(begin), edge(begin + length)]
        })
        .collect()
}

/// Cuts a polygon into triangles without a diagonal on a face of the cube: the cube
/// behind the face could have the same one, and four triangles would meet there.
///
/// # Panics
/// If there is no such cut; there is one for every sign pattern.
fn triangulate(polygon: &[CubeEdge]) -> Vec<[CubeEdge; 3]> {
    fn cut(polygon: &[CubeEdge]) -> Option<Vec<[CubeEdge; 3]>> {
        let n = polygon.len();
        if n == 3 {
            return Some(vec![[polygon[0], polygon[1], polygon[2]]]);
        }
        // Cut off one corner after the other, and go back where that fails.
        (0..n).find_map(|ear| {
            let [before, after] = [polygon[(ear + n - 1) % n], polygon[(ear + 1) % n]];
            if before.shares_face_with(after) {
                return None;
            }
            let rest: Vec<_> = (0..n).filter(|i| *i != ear).map(|i| polygon[i]).collect();
            let mut triangles = cut(&rest)?;
            triangles.push([before, polygon[ear], after]);
            Some(triangles)
        })
    }
    cut(polygon).expect("cube_case: every polygon can be cut inside the cube")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pattern_cuts_exactly_its_crossed_edges() {
        let cases = cube_cases();
        assert_eq!(cases.len(), 256);
        for (pattern, triangles) in cases.iter().enumerate() {
            let inside = |corner: usize| pattern >> corner & 1 == 1;
            let mut crossed = 0;
            for corner in 0..CORNERS {
                for axis in (0..3).filter(|axis| corner >> axis & 1 == 0) {
                    let edge = CubeEdge { corner, axis };
                    let used = triangles.iter().any(|triangle| triangle.contains(&edge));
                    let crosses = inside(corner) != inside(corner | 1 << axis);
                    assert_eq!(used, crosses, "{pattern:08b} {edge:?}");
                    crossed += usize::from(crosses);
                }
            }
            let loops = loops(pattern).len();
            assert_eq!(triangles.len(), crossed - 2 * loops);
        }
    }

    #[test]
    fn one_corner_is_cut_off_facing_outward() {
        let [triangle] = cube_cases()[1][..] else {
            panic!("one corner inside is one triangle");
        };
        // The three cuts at +x, +y, +z of corner 0: outward is (1, 1, 1).
        let axes = triangle.map(|edge| edge.axis);
        let even = [[0, 1, 2], [1, 2, 0], [2, 0, 1]];
        assert!(even.contains(&axes), "{axes:?}");
    }
}
