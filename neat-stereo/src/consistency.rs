//! Which planes of a view other views confirm (as in the fusion of Schönberger et al. 2016).

use crate::SurfacePoint;
use crate::depth_map::DepthMap;
use crate::view::StereoView;
use nalgebra::Vector3;

/// Views that have to confirm a point: one more than agree on many a wrong one.
const MIN_CONFIRMING: usize = 2;
/// How far a confirming surface may lie off, in pixels of its view.
const MAX_OFFSET: f64 = 1.0;
/// Cosine of the largest angle between normals of one surface: 37°.
const MIN_COSINE: f64 = 0.8;

/// All views with what they see.
#[derive(Clone, Copy)]
pub(crate) struct Maps<'a> {
    pub views: &'a [StereoView],
    pub maps: &'a [DepthMap],
}

/// A plane of one view at a pixel.
struct Seen<'a> {
    view: &'a StereoView,
    /// Unit direction from the camera.
    sight: Vector3<f64>,
    distance: f64,
    normal: Vector3<f64>,
}

impl Maps<'_> {
    /// The points of `view` within the ball that at least two of `others` confirm.
    pub fn confirmed(self, view: usize, others: &[usize], ball_radius: f64) -> Vec<SurfacePoint> {
        let map = &self.maps[view];
        let found = map.planes.iter().enumerate();
        found
            .filter_map(|(index, plane)| {
                let seen = Seen::new(&self.views[view], map.pixel(index), &(*plane)?.cast());
                let point = self.confirm(&seen, view, others)?;
                (point.position_in_world.norm() < ball_radius).then_some(point)
            })
            .collect()
    }

    /// The mean of the surface that is seen and those that confirm it.
    fn confirm(self, seen: &Seen<'_>, view: usize, others: &[usize]) -> Option<SurfacePoint> {
        let mut views = vec![view];
        let mut offsets = vec![0.0];
        for &other in others {
            if let Some(offset) = seen.offset_in(&self.views[other], &self.maps[other]) {
                views.push(other);
                offsets.push(offset);
            }
        }
        if views.len() <= MIN_CONFIRMING {
            return None;
        }
        let mean = offsets.iter().sum::<f64>() / offsets.len() as f64;
        let squares: f64 = offsets.iter().map(|offset| (offset - mean).powi(2)).sum();
        views.sort_unstable();
        Some(SurfacePoint {
            position_in_world: seen.position(mean),
            normal_in_world: seen.normal,
            deviation: (squares / (offsets.len() - 1) as f64).sqrt(),
            views,
        })
    }
}

impl<'a> Seen<'a> {
    fn new(view: &'a StereoView, [x, y]: [usize; 2], plane: &Vector3<f64>) -> Self {
        let ray = view.calibrated_from_pixels(0) * Vector3::new(x as f64, y as f64, 1.0);
        let to_world = &view.camera.world_from_camera;
        Self {
            view,
            sight: (to_world * ray).normalize(),
            distance: ray.norm() / plane.dot(&ray),
            normal: to_world * -plane.normalize(),
        }
    }

    /// The point `offset` behind it.
    fn position(&self, offset: f64) -> Vector3<f64> {
        self.view.camera.center_in_world + self.sight * (self.distance + offset)
    }

    /// How far behind it, along the sight line, the surface that `other` sees lies; `None`
    /// if that is another surface, or is not seen.
    fn offset_in(&self, other: &StereoView, map: &DepthMap) -> Option<f64> {
        let pixel_of = |point: &Vector3<f64>, level: usize| {
            let in_camera = other.camera.to_camera(point);
            let pixel = other.pixels_from_calibrated(level) * in_camera / in_camera.z;
            (in_camera.z > 0.0).then_some(pixel.xy())
        };
        let position = self.position(0.0);
        let on_lattice = pixel_of(&position, map.level)?.map(f64::round);
        let inside =
            |at: f64, count: usize| (0.0..count as f64).contains(&at).then_some(at as usize);
        let (column, row) = (
            inside(on_lattice.x, map.columns)?,
            inside(on_lattice.y, map.rows)?,
        );
        let plane: Vector3<f64> = map.planes[row * map.columns + column]?.cast();
        let normal = other.camera.world_from_camera * -plane.normalize();
        if normal.dot(&self.normal) < MIN_COSINE {
            return None;
        }
        let from = other.camera.to_camera(&self.view.camera.center_in_world);
        let along = other.camera.world_from_camera.tr_mul(&self.sight);
        let offset = (1.0 - plane.dot(&from)) / plane.dot(&along) - self.distance;
        let moved = pixel_of(&self.position(offset), 0)? - pixel_of(&position, 0)?;
        (moved.norm() <= MAX_OFFSET).then_some(offset)
    }
}
