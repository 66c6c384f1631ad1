//! The zero set of a signed distance as a triangle mesh (Lorensen and Cline,
//! SIGGRAPH 1987).
//!
//! The grid is evaluated layer by layer: two layers are in memory, whatever the
//! resolution.

use crate::cube_case::{CORNERS, CubeEdge, cube_cases};
use crate::{ExportError, TriangleMesh};
use nalgebra::Vector3;
use neat_wireframe::SignedDistance;

/// Points per query of the signed distance.
const BATCH: usize = 1 << 16;
/// Points along a side of the blocks that one distance may answer for.
const BLOCK: usize = 8;
/// No cut.
const NONE: u32 = u32::MAX;

/// Where a surface is looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Region {
    /// All points between two corners.
    Box {
        /// The corner with the smallest coordinates.
        min: Vector3<f64>,
        /// The corner with the largest coordinates.
        max: Vector3<f64>,
    },
    /// All points within a radius.
    Ball {
        /// Its centre.
        center: Vector3<f64>,
        /// Its radius.
        radius: f64,
    },
}

impl Region {
    /// The corners of its bounding box.
    pub fn bounds(&self) -> [Vector3<f64>; 2] {
        match self {
            Self::Box { min, max } => [*min, *max],
            Self::Ball { center, radius } => {
                [center.add_scalar(-radius), center.add_scalar(*radius)]
            }
        }
    }

    /// Negative inside, zero on the border, positive outside. Outside of a box it is
    /// the largest excess along an axis.
    pub fn signed_distance(&self, point: &Vector3<f64>) -> f64 {
        match self {
            Self::Box { min, max } => (min - point).max().max((point - max).max()),
            Self::Ball { center, radius } => (point - center).norm() - radius,
        }
    }
}

/// How finely a surface is looked for, and where.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Where.
    pub region: Region,
    /// Number of cubes along the longest side of the region's bounding box, from 2
    /// to [`Grid::MAX_RESOLUTION`].
    pub resolution: usize,
    /// Whether the part of the inside that lies in the region is closed by the
    /// region's border. If not, the surface ends where it leaves the region.
    pub closed: bool,
    /// How much the distance changes at most over a unit of length, where that is
    /// known: 1 for an exact distance, somewhat more for a trained one. Blocks of 8³
    /// points that are too far away for the surface then cost one evaluation. With
    /// `None` every point is evaluated.
    pub max_slope: Option<f64>,
}

impl Grid {
    /// The finest grid: its two layers take 170 MB.
    pub const MAX_RESOLUTION: usize = 2048;

    fn check(&self) -> Result<(), ExportError> {
        if !(2..=Self::MAX_RESOLUTION).contains(&self.resolution) {
            return Err(ExportError::BadOption {
                option: "the resolution",
                value: self.resolution.to_string(),
                expected: "2 to 2048 cubes",
            });
        }
        if let Some(slope) = self.max_slope
            && !(slope.is_finite() && slope > 0.0)
        {
            return Err(ExportError::BadOption {
                option: "the largest slope",
                value: slope.to_string(),
                expected: "a positive number",
            });
        }
        let [min, max] = self.region.bounds();
        let extent = max - min;
        if !extent.iter().all(|x| x.is_finite() && *x > 0.0) {
            return Err(ExportError::BadOption {
                option: "the region",
                value: format!("{:?}", self.region),
                expected: "one with a finite, positive extent along every axis",
            });
        }
        Ok(())
    }
}

/// Cuts the surface where `surface` is zero inside a region into triangles.
///
/// Cubes share the vertices on their edges, where linear interpolation of the
/// distances is zero. Triangles are counter-clockwise as seen from outside. With
/// [`Grid::closed`] every edge of the mesh belongs to exactly two triangles.
/// `on_progress` is told the finished share after every layer.
///
/// # Errors
/// If the region or the resolution is out of range, or a distance is no number.
pub fn marching_cubes(
    surface: &dyn SignedDistance,
    grid: &Grid,
    on_progress: &mut dyn FnMut(f64),
) -> Result<TriangleMesh, ExportError> {
    grid.check()?;
    let lattice = Lattice::new(grid);
    let cases = cube_cases();
    let mut mesh = TriangleMesh::default();
    let mut far = lattice.far_blocks(0, surface)?;
    let mut lower = lattice.layer(0, surface, &far)?;
    lattice.cut_inside(&mut lower, &mut mesh);
    for z in 1..lattice.counts[2] {
        if z % BLOCK == 0 {
            far = lattice.far_blocks(z, surface)?;
        }
        let mut upper = lattice.layer(z, surface, &far)?;
        lattice.cut_between(&mut lower, &upper, &mut mesh);
        lattice.cut_inside(&mut upper, &mut mesh);
        lattice.add_triangles([&lower, &upper], &cases, &mut mesh);
        lower = upper;
        on_progress(z as f64 / (lattice.counts[2] - 1) as f64);
    }
    if !grid.closed {
        // Cut edges that only incomplete cubes have.
        mesh.drop_unused_vertices();
    }
    Ok(mesh)
}

/// The points of the grid: cubes with a margin of one around the region, so that its
/// border lies inside.
struct Lattice<'a> {
    grid: &'a Grid,
    origin: Vector3<f64>,
    spacing: f64,
    /// Number of points along each axis.
    counts: [usize; 3],
}

/// The distances at points, all of them numbers.
fn finite(surface: &dyn SignedDistance, points: &[Vector3<f64>]) -> Result<Vec<f64>, ExportError> {
    if points.is_empty() {
        return Ok(Vec::new());
    }
    let distances = surface.sdf(points);
    match distances.iter().position(|distance| !distance.is_finite()) {
        Some(bad) => Err(ExportError::BadDistance {
            point: points[bad].into(),
            value: distances[bad],
        }),
        None => Ok(distances),
    }
}

/// The points of one z.
struct Layer {
    z: usize,
    /// The distance; NaN where the surface is not wanted.
    values: Vec<f64>,
    /// Index of the vertex on the edge that starts at each point, along each axis.
    cuts: [Vec<u32>; 3],
}

impl<'a> Lattice<'a> {
    fn new(grid: &'a Grid) -> Self {
        let [min, max] = grid.region.bounds();
        let extent = max - min;
        let spacing = extent.max() / grid.resolution as f64;
        let counts = [0, 1, 2].map(|axis| (extent[axis] / spacing).ceil() as usize + 3);
        let covered = Vector3::from(counts).map(|n| (n - 1) as f64 * spacing);
        Self {
            grid,
            // Centred: symmetric regions give symmetric meshes.
            origin: (min + max - covered) / 2.0,
            spacing,
            counts,
        }
    }

    fn point(&self, index: [usize; 3]) -> Vector3<f64> {
        self.origin + Vector3::from(index).map(|i| i as f64) * self.spacing
    }

    /// For every block of 8³ points that begins at layer `z`: the distance in its
    /// centre, if the surface is farther away than all its points, else NaN.
    fn far_blocks(&self, z: usize, surface: &dyn SignedDistance) -> Result<Vec<f64>, ExportError> {
        let [columns, rows] = [self.counts[0], self.counts[1]].map(|n| n.div_ceil(BLOCK));
        let mut far = vec![f64::NAN; columns * rows];
        let Some(slope) = self.grid.max_slope else {
            return Ok(far);
        };
        let to_center = Vector3::repeat((BLOCK - 1) as f64 / 2.0 * self.spacing);
        let mut blocks = Vec::new();
        let mut centers = Vec::new();
        for block in 0..far.len() {
            let corner = [block % columns * BLOCK, block / columns * BLOCK, z];
            let center = self.point(corner) + to_center;
            if self.grid.region.signed_distance(&center) < 0.0 {
                blocks.push(block);
                centers.push(center);
            }
        }
        // One step more than the corners, so that no edge to a neighbour is cut.
        let reach = slope * (to_center.norm() + self.spacing);
        for (block, distance) in blocks.into_iter().zip(finite(surface, &centers)?) {
            if distance.abs() > reach {
                far[block] = distance;
            }
        }
        Ok(far)
    }

    fn layer(
        &self,
        z: usize,
        surface: &dyn SignedDistance,
        far: &[f64],
    ) -> Result<Layer, ExportError> {
        let [columns, rows, _] = self.counts;
        let mut values = Vec::with_capacity(columns * rows);
        while values.len() < columns * rows {
            let batch = BATCH.min(columns * rows - values.len());
            self.add_values(z, batch, surface, far, &mut values)?;
        }
        let cuts = [0, 1, 2].map(|_| vec![NONE; values.len()]);
        Ok(Layer { z, values, cuts })
    }

    /// Appends the values of the next `batch` points of a layer.
    fn add_values(
        &self,
        z: usize,
        batch: usize,
        surface: &dyn SignedDistance,
        far: &[f64],
        values: &mut Vec<f64>,
    ) -> Result<(), ExportError> {
        let columns = self.counts[0];
        let block_columns = columns.div_ceil(BLOCK);
        let mut indices = Vec::new();
        let mut points = Vec::new();
        for index in values.len()..values.len() + batch {
            let [x, y] = [index % columns, index / columns];
            let point = self.point([x, y, z]);
            let of_region = self.grid.region.signed_distance(&point);
            let border = if self.grid.closed {
                of_region
            } else {
                f64::NAN
            };
            let of_block = far[y / BLOCK * block_columns + x / BLOCK];
            // The intersection of two solids; `max` ignores a border that is NaN.
            if of_region < 0.0 && of_block.is_nan() {
                indices.push(index);
                points.push(point);
                values.push(border);
            } else if of_region < 0.0 {
                values.push(of_block.max(border));
            } else {
                values.push(border);
            }
        }
        for (index, distance) in indices.into_iter().zip(finite(surface, &points)?) {
            values[index] = distance.max(values[index]);
        }
        Ok(())
    }

    /// Vertices on the edges along x and y.
    fn cut_inside(&self, layer: &mut Layer, mesh: &mut TriangleMesh) {
        let [columns, rows, _] = self.counts;
        for y in 0..rows {
            for x in 0..columns {
                let index = y * columns + x;
                let start = (self.point([x, y, layer.z]), layer.values[index]);
                for (axis, exists, step) in [(0, x + 1 < columns, 1), (1, y + 1 < rows, columns)] {
                    if exists {
                        let value = layer.values[index + step];
                        layer.cuts[axis][index] = self.cut(start, axis, value, mesh);
                    }
                }
            }
        }
    }

    /// Vertices on the edges along z, which belong to the lower layer.
    fn cut_between(&self, lower: &mut Layer, upper: &Layer, mesh: &mut TriangleMesh) {
        let columns = self.counts[0];
        for index in 0..lower.values.len() {
            let point = self.point([index % columns, index / columns, lower.z]);
            let start = (point, lower.values[index]);
            lower.cuts[2][index] = self.cut(start, 2, upper.values[index], mesh);
        }
    }

    /// Adds the vertex on an edge, if the surface crosses it.
    fn cut(
        &self,
        (start, from): (Vector3<f64>, f64),
        axis: usize,
        to: f64,
        mesh: &mut TriangleMesh,
    ) -> u32 {
        if from.is_nan() || to.is_nan() || (from < 0.0) == (to < 0.0) {
            return NONE;
        }
        let mut vertex = start;
        vertex[axis] += self.spacing * (from / (from - to));
        mesh.vertices.push(vertex);
        (mesh.vertices.len() - 1) as u32
    }

    fn add_triangles(
        &self,
        layers: [&Layer; 2],
        cases: &[Vec<[CubeEdge; 3]>],
        mesh: &mut TriangleMesh,
    ) {
        let [columns, rows, _] = self.counts;
        for y in 0..rows - 1 {
            for x in 0..columns - 1 {
                let at = |corner: usize| {
                    let index = (y + (corner >> 1 & 1)) * columns + x + (corner & 1);
                    (layers[corner >> 2], index)
                };
                let mut pattern = 0;
                let mut unwanted = false;
                for corner in 0..CORNERS {
                    let (layer, index) = at(corner);
                    pattern |= usize::from(layer.values[index] < 0.0) << corner;
                    unwanted |= layer.values[index].is_nan();
                }
                if unwanted {
                    continue;
                }
                let vertex = |edge: CubeEdge| {
                    let (layer, index) = at(edge.corner);
                    layer.cuts[edge.axis][index]
                };
                let triangles = cases[pattern].iter();
                mesh.triangles
                    .extend(triangles.map(|triangle| triangle.map(vertex)));
            }
        }
    }
}
