//! A trained field as functions of points.

use crate::arrays::{points, read_only};
use crate::background::run;
use crate::errors::Failure;
use nalgebra::Vector3;
use neat_core::Similarity;
use neat_pipeline::reconstruct::OpenedRun;
use neat_train::TrainedField;
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use std::sync::Arc;

/// The signed distance and the 3D segments that a run has learned, as functions of points.
///
/// Points and lengths are in the frame and unit of your files. Points may be anything that numpy
/// takes for an array, tensors of torch on the CPU among them; `torch.from_numpy(result.copy())`
/// leads back. Outside of the scene sphere the distance is that to the sphere.
#[pyclass(frozen, module = "neat3d")]
pub struct Field {
    field: Arc<TrainedField>,
    original_from_world: Similarity,
    threads: Option<usize>,
}

impl Field {
    pub fn new(opened: OpenedRun, threads: Option<usize>) -> PyResult<Self> {
        let original_from_world = opened.scene.original_from_world;
        let none = || Failure::input("the run was not trained");
        let field = opened.field.ok_or_else(none)?.into();
        Ok(Self {
            field,
            original_from_world,
            threads,
        })
    }

    /// What the field says of points in the frame of the files.
    fn ask<T: Send + 'static>(
        &self,
        py: Python<'_>,
        points: &[Vector3<f64>],
        question: impl FnOnce(&TrainedField, &[[f32; 3]]) -> T + Send + 'static,
    ) -> PyResult<T> {
        let world_from_original = self.original_from_world.inverse();
        let points: Vec<[f32; 3]> = (points.iter())
            .map(|point| world_from_original.apply(point).map(|x| x as f32).into())
            .collect();
        let field = Arc::clone(&self.field);
        run(py, self.threads, move || Ok(question(&field, &points)))
    }
}

#[pymethods]
impl Field {
    /// Signed distance (N,) to the surface from points (N, 3): negative inside.
    fn distance<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let points = self::points(points, "points")?;
        let distances = self.ask(py, &points, TrainedField::distances)?;
        let unit = self.original_from_world.length_factor();
        let values = distances.into_iter().map(|x| unit * f64::from(x)).collect();
        Ok(read_only(py, points.len(), values))
    }

    /// The same: `field(points)`.
    fn __call__<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        self.distance(py, points)
    }

    /// Gradient (N, 3) of the distance at points (N, 3), not normalised.
    fn gradient<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let points = self::points(points, "points")?;
        let both = self.ask(py, &points, TrainedField::distances_and_gradients)?;
        // A distance and a length change alike with the unit; a mirrored frame turns them around.
        let sign = self.original_from_world.scale.signum();
        let values = both
            .into_iter()
            .flat_map(|(_, gradient)| gradient.map(|x| sign * f64::from(x)));
        Ok(read_only(py, (points.len(), 3), values.collect()))
    }

    /// Both ends (N, 2, 3) of the 3D segment that the attraction field holds at points (N, 3).
    ///
    /// directions (N, 3): from where they are seen, unit vectors from the camera, for networks that look at
    /// that (the presets paper-*); by default against the gradient.
    #[pyo3(signature = (points, directions=None))]
    fn segments<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        directions: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let points = self::points(points, "points")?;
        let sign = self.original_from_world.scale.signum();
        let given = directions
            .map(|all| self::points(all, "directions"))
            .transpose()?;
        if let Some(directions) = &given
            && directions.len() != points.len()
        {
            let (points, directions) = (points.len(), directions.len());
            let text = format!(
                "there are {points} points and {directions} directions: give one per point"
            );
            return Err(Failure::input(text).into());
        }
        let ends = self.ask(py, &points, move |field, points| {
            let against = |(_, gradient): (f32, [f32; 3])| -Vector3::from(gradient).map(f64::from);
            let directions: Vec<Vector3<f64>> = match given {
                Some(directions) => directions
                    .into_iter()
                    .map(|direction| sign * direction)
                    .collect(),
                None => field
                    .distances_and_gradients(points)
                    .into_iter()
                    .map(against)
                    .collect(),
            };
            let unit = |direction: &Vector3<f64>| {
                direction
                    .try_normalize(0.0)
                    .unwrap_or_default()
                    .map(|x| x as f32)
                    .into()
            };
            let directions: Vec<[f32; 3]> = directions.iter().map(unit).collect();
            field.segments(points, &directions)
        })?;
        let original = |end: [f32; 3]| {
            self.original_from_world
                .apply(&Vector3::from(end).map(f64::from))
        };
        let values = ends
            .into_iter()
            .flat_map(|[a, b, c, d, e, f]| [[a, b, c], [d, e, f]]);
        let values = values
            .flat_map(|end| <[f64; 3]>::from(original(end)))
            .collect();
        Ok(read_only(py, (points.len(), 2, 3), values))
    }

    /// Where the latents of the field say that edges meet: (J, 3).
    #[getter]
    fn junctions<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let junctions = self.field.junctions();
        let original = |p: &Vector3<f64>| <[f64; 3]>::from(self.original_from_world.apply(p));
        read_only(
            py,
            (junctions.len(), 3),
            junctions.iter().flat_map(original).collect(),
        )
    }
}
