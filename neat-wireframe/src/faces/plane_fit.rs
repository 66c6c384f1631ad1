//! A plane through measured points, and whether more points belong to it.

use nalgebra::{Matrix3, Vector2, Vector3};

/// Square of the distance in standard deviations up to which a point belongs to a plane: exceeded
/// by one point of a thousand (chi-square of one degree of freedom).
pub(super) const CHI_SQUARE: f64 = 10.83;

/// Weighted least squares for the height of a plane over a reference plane near it.
#[derive(Clone, Debug)]
pub(super) struct PlaneFit {
    origin: Vector3<f64>,
    /// Along the reference plane, and its normal.
    axes: [Vector3<f64>; 3],
    /// Unit of lengths in the plane, so that tilts and heights have like numbers.
    scale: f64,
    information: Matrix3<f64>,
    right: Vector3<f64>,
}

impl PlaneFit {
    /// Without points yet, over the plane through `origin` with this normal.
    pub fn over(origin: Vector3<f64>, normal: Vector3<f64>, scale: f64) -> Self {
        let [u, v] = across(&normal);
        Self {
            origin,
            axes: [u, v, normal],
            scale,
            information: Matrix3::zeros(),
            right: Vector3::zeros(),
        }
    }

    /// Through points that roughly lie in a plane; `None` if they lie on a line.
    pub fn through<'a>(
        points: impl Iterator<Item = &'a (Vector3<f64>, Matrix3<f64>)> + Clone,
        scale: f64,
    ) -> Option<Self> {
        let count = points.clone().count() as f64;
        let mean = points.clone().map(|(p, _)| p).sum::<Vector3<f64>>() / count;
        let moments = points.clone().fold(Matrix3::zeros(), |sum, (p, _)| {
            sum + (p - mean) * (p - mean).transpose()
        });
        let eigen = moments.symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
        if eigen.eigenvalues[order[1]] <= 1e-12 * eigen.eigenvalues[order[2]] {
            return None;
        }
        let normal = eigen.eigenvectors.column(order[0]).into_owned();
        let mut fit = Self::over(mean, normal, scale);
        points.for_each(|(point, covariance)| fit.add(point, covariance));
        Some(fit)
    }

    fn row(&self, point: &Vector3<f64>) -> Vector3<f64> {
        let offset = (point - self.origin) / self.scale;
        Vector3::new(1.0, offset.dot(&self.axes[0]), offset.dot(&self.axes[1]))
    }

    fn variance(&self, covariance: &Matrix3<f64>) -> f64 {
        self.axes[2].dot(&(covariance * self.axes[2]))
    }

    pub fn add(&mut self, point: &Vector3<f64>, covariance: &Matrix3<f64>) {
        let row = self.row(point);
        let weight = self.variance(covariance).recip();
        self.information += row * row.transpose() * weight;
        self.right += row * weight * (point - self.origin).dot(&self.axes[2]);
    }

    /// The fitted plane; `None` if the points do not determine it.
    pub fn solved(&self) -> Option<FittedPlane<'_>> {
        let covariance = self.information.try_inverse()?;
        Some(FittedPlane {
            fit: self,
            height: covariance * self.right,
            covariance,
        })
    }
}

/// The solution of a [`PlaneFit`].
pub(super) struct FittedPlane<'a> {
    fit: &'a PlaneFit,
    /// Over the reference plane: at its origin, and how much it grows along its axes.
    height: Vector3<f64>,
    covariance: Matrix3<f64>,
}

impl FittedPlane<'_> {
    /// Variance of the height of the plane at a point.
    pub fn variance(&self, point: &Vector3<f64>) -> f64 {
        let row = self.fit.row(point);
        row.dot(&(self.covariance * row))
    }

    /// Whether a point may lie in the plane.
    pub fn holds(&self, point: &Vector3<f64>, covariance: &Matrix3<f64>) -> bool {
        let off = self.height_of(point);
        off * off <= CHI_SQUARE * (self.variance(point) + self.fit.variance(covariance))
    }

    /// Distance of a point from the plane, by that up to which it may lie in it.
    pub fn relative_distance(&self, point: &Vector3<f64>, covariance: &Matrix3<f64>) -> f64 {
        let variance = self.variance(point) + self.fit.variance(covariance);
        self.height_of(point).abs() / (CHI_SQUARE * variance).sqrt()
    }

    fn height_of(&self, point: &Vector3<f64>) -> f64 {
        let over = (point - self.fit.origin).dot(&self.fit.axes[2]);
        over - self.fit.row(point).dot(&self.height)
    }

    /// Normal and offset of the plane.
    pub fn plane(&self) -> (Vector3<f64>, f64) {
        let [u, v, n] = self.fit.axes;
        let slope = (u * self.height.y + v * self.height.z) / self.fit.scale;
        let normal = (n - slope).normalize();
        (normal, normal.dot(&(self.fit.origin + n * self.height.x)))
    }
}

/// Two unit vectors perpendicular to a third and to each other: right-handed in this order.
pub(super) fn across(normal: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let axis = Vector3::ith(normal.iamin(), 1.0);
    let u = axis.cross(normal).normalize();
    [u, normal.cross(&u)]
}

/// A plane with coordinates in it.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlaneFrame {
    pub normal: Vector3<f64>,
    pub offset: f64,
    axes: [Vector3<f64>; 2],
}

impl PlaneFrame {
    pub fn new(normal: Vector3<f64>, offset: f64) -> Self {
        let axes = across(&normal);
        Self {
            normal,
            offset,
            axes,
        }
    }

    pub fn point(&self, coordinates: &Vector2<f64>) -> Vector3<f64> {
        self.axes[0] * coordinates.x + self.axes[1] * coordinates.y + self.normal * self.offset
    }

    pub fn coordinates(&self, point: &Vector3<f64>) -> Vector2<f64> {
        Vector2::new(self.axes[0].dot(point), self.axes[1].dot(point))
    }
}
