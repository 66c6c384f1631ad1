//! Scenes: a folder, or arrays that become one.

use crate::arrays::{numbers, points, read_only, rgb_image};
use crate::background;
use crate::errors::Failure;
use crate::wireframe2d::{PIXEL_CENTER, Segments, given};
use nalgebra::{Matrix3, Matrix4};
use neat_core::convert::{SceneFormat, convert};
use neat_core::file_cache::FileCache;
use neat_core::{
    Camera, Intrinsics, LoadOptions, Scene as Posed, Similarity, SparsePoint, View, Wireframe2d,
    load_scene,
};
use neat_lab::demo::synthesise;
use neat_pipeline::config::Preset;
use neat_pipeline::resources::default_limit;
use neat_pipeline::scene::load_options;
use numpy::{PyArray2, PyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// Posed images: a folder in any layout that neat reads, which is looked into when something
/// of it is wanted.
///
/// `K` and `poses` have OpenCV's conventions: x right, y down, z forward; a pose is a 4×4 matrix
/// from the camera to the world of your files. Image coordinates count from the upper left corner of the
/// image, the centre of the first pixel being (0.5, 0.5).
#[pyclass(frozen, module = "neat3d")]
pub struct Scene {
    /// Where it is.
    #[pyo3(get)]
    folder: PathBuf,
    /// A temporary folder, which lives as long as the scene.
    keep: Option<Py<PyAny>>,
    read: OnceLock<Arc<Posed>>,
}

/// A new temporary folder, and what removes it.
pub fn temporary(py: Python<'_>) -> PyResult<(PathBuf, Py<PyAny>)> {
    let prefix = PyDict::new(py);
    prefix.set_item("prefix", "neat3d-")?;
    let tempfile = py.import("tempfile")?;
    let keep = tempfile.call_method("TemporaryDirectory", (), Some(&prefix))?;
    Ok((keep.getattr("name")?.extract()?, keep.unbind()))
}

/// Where a scene is to be written: in a folder that was named, or in a temporary one that is
/// called like the scene.
fn place(
    py: Python<'_>,
    name: Option<&str>,
    folder: Option<PathBuf>,
) -> PyResult<(PathBuf, Option<Py<PyAny>>)> {
    let bad = |text: String| Err(Failure::input(text).into());
    match (name, folder) {
        (Some(_), Some(_)) => {
            bad("name and folder: give one of them; a folder names its scene".into())
        }
        (None, Some(folder)) => Ok((folder, None)),
        (Some(name), None) if Path::new(name).file_name() != Some(name.as_ref()) => bad(format!(
            "name is `{name}`: give a plain name, without slashes"
        )),
        (name, None) => {
            let (folder, keep) = temporary(py)?;
            Ok((folder.join(name.unwrap_or("scene")), Some(keep)))
        }
    }
}

#[pymethods]
impl Scene {
    /// The scene in a folder. keep: anything that has to live as long as the folder is needed.
    #[new]
    #[pyo3(signature = (folder, *, keep=None))]
    fn new(folder: PathBuf, keep: Option<Py<PyAny>>) -> Self {
        Self {
            folder,
            keep,
            read: OnceLock::new(),
        }
    }

    /// A scene of arrays, written losslessly into a folder: a temporary one that goes with
    /// the scene, or `folder`, which must be new or empty.
    ///
    /// images: N arrays (height, width, 3) uint8, red first, without lens distortion. K: (3, 3),
    /// or (N, 3, 3). poses: (N, 4, 4) camera to world. names: of the views; by default 0000, 0001, …
    /// segments: for each view what `detect` returned, or (M, 4) x, y, x, y or (M, 5) with a score, in pixels; by default they are detected.
    /// points: (P, 3) of a sparse reconstruction, which place the part of space to model.
    /// pixel_center: image coordinates of the centre of the first pixel in K and segments, 0.5 or 0.
    /// name: of the scene in a temporary folder; `folder` names its own.
    #[staticmethod]
    #[pyo3(signature = (images, K, poses, *, names=None, segments=None, points=None, pixel_center=0.5, name=None, folder=None))]
    #[expect(non_snake_case, reason = "the field's name")]
    fn from_arrays(
        py: Python<'_>,
        images: Vec<Bound<'_, PyAny>>,
        K: &Bound<'_, PyAny>,
        poses: &Bound<'_, PyAny>,
        names: Option<Vec<String>>,
        segments: Option<Vec<Bound<'_, PyAny>>>,
        points: Option<&Bound<'_, PyAny>>,
        pixel_center: f64,
        name: Option<&str>,
        folder: Option<PathBuf>,
    ) -> PyResult<Self> {
        let (folder, keep) = place(py, name, folder)?;
        let given = Given {
            images: &images,
            names,
            segments: segments.as_deref(),
        };
        if ![0.0, PIXEL_CENTER].contains(&pixel_center) {
            return Err(
                Failure::input(format!("pixel_center is {pixel_center}: give 0.5 or 0")).into(),
            );
        }
        let scene = Posed {
            // Its folder names it.
            name: folder.display().to_string(),
            views: given.views(
                &matrices::<9>(K, "K", images.len())?,
                &matrices::<16>(poses, "poses", images.len())?,
                pixel_center,
            )?,
            original_from_world: Similarity::identity(),
            pixel_center,
            // Settled by whoever reads the folder.
            sphere_radius: 1.0,
            sparse_points: match points {
                Some(all) => self::points(all, "points")?
                    .into_iter()
                    .map(SparsePoint::unseen)
                    .collect(),
                None => Vec::new(),
            },
        };
        let path = folder.clone();
        background::run(py, None, move || {
            Ok(convert(&scene, SceneFormat::TransformsJson, &path)?)
        })?;
        Ok(Self::new(folder, keep))
    }

    /// A scene with exact truth, written into a new folder: `gt_wireframe.json` beside
    /// images, poses and what a detector would see. settings: solid, views, image_size,
    /// image_height, camera_distance, seed, noise_in_pixels, detection_rate, false_segments,
    /// min_visible_length, shading.
    #[staticmethod]
    #[pyo3(signature = (folder, **settings))]
    fn synth(
        py: Python<'_>,
        folder: PathBuf,
        settings: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let json = match settings {
            Some(settings) => py
                .import("json")?
                .call_method1("dumps", (settings,))?
                .extract()?,
            None => "{}".to_owned(),
        };
        let config = serde_json::from_str(&json).map_err(|error| {
            let text = error.to_string();
            // Without the place in a text that nobody has written.
            Failure::input(text.split(" at line").next().unwrap_or_default())
        })?;
        let path = folder.clone();
        background::run(py, None, move || Ok(synthesise(&config, &path)?))?;
        Ok(Self::new(folder, None))
    }

    /// A scene of a `pycolmap.Reconstruction` and the folder of its photographs, which are
    /// undistorted when the scene is read. The photographs are linked into the scene's folder, or
    /// copied where the system has no such links.
    #[staticmethod]
    #[pyo3(signature = (reconstruction, images, *, name=None, folder=None))]
    fn from_pycolmap<'py>(
        reconstruction: &Bound<'py, PyAny>,
        images: PathBuf,
        name: Option<&str>,
        folder: Option<PathBuf>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = reconstruction.py();
        let (folder, keep) = place(py, name, folder)?;
        let interop = py.import("neat3d.interop")?;
        interop.call_method1("from_pycolmap", (reconstruction, images, folder, keep))
    }

    /// Names of the views, in their order.
    #[getter]
    fn names(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        let scene = self.scene(py)?;
        Ok(scene.views.iter().map(|view| view.name.clone()).collect())
    }

    /// Intrinsics of the undistorted images (N, 3, 3), in pixels.
    #[getter]
    #[pyo3(name = "K")]
    fn intrinsics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let scene = self.scene(py)?;
        let shift = PIXEL_CENTER - scene.pixel_center;
        let matrix = |view: &View| {
            let mut k = view.camera.intrinsics.matrix();
            k[(0, 2)] += shift;
            k[(1, 2)] += shift;
            k.transpose()
        };
        let values = scene
            .views
            .iter()
            .flat_map(|view| matrix(view).as_slice().to_vec());
        Ok(read_only(py, (scene.views.len(), 3, 3), values.collect()))
    }

    /// Poses (N, 4, 4): camera to the world of your files.
    #[getter]
    fn poses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let scene = self.scene(py)?;
        let matrix = |view: &View| {
            let camera = scene.original_from_world.apply_to_camera(&view.camera);
            camera.matrix_world_from_camera().transpose()
        };
        let values = scene
            .views
            .iter()
            .flat_map(|view| matrix(view).as_slice().to_vec());
        Ok(read_only(py, (scene.views.len(), 4, 4), values.collect()))
    }

    /// Points of the sparse reconstruction (P, 3), in the world of your files.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let scene = self.scene(py)?;
        let position =
            |point: &SparsePoint| scene.original_from_world.apply(&point.position_in_world);
        let values = scene
            .sparse_points
            .iter()
            .flat_map(|point| <[f64; 3]>::from(position(point)));
        Ok(read_only(
            py,
            (scene.sparse_points.len(), 3),
            values.collect(),
        ))
    }

    /// The undistorted image of a view (height, width, 3) uint8.
    fn image<'py>(&self, py: Python<'py>, view: usize) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let scene = self.scene(py)?;
        let image = view_of(&scene, view)?.image.read().map_err(Failure::from)?;
        let shape = (image.height() as usize, image.width() as usize, 3);
        Ok(read_only(py, shape, image.as_raw().clone()))
    }

    /// The 2D wireframe of a view that the folder holds; empty where it holds none and a run
    /// detects it.
    fn segments(&self, py: Python<'_>, view: usize) -> PyResult<Segments> {
        let scene = self.scene(py)?;
        let mut wireframe = view_of(&scene, view)?.wireframe.clone();
        for vertex in &mut wireframe.vertices {
            *vertex = vertex.add_scalar(PIXEL_CENTER - scene.pixel_center);
        }
        Ok(Segments {
            wireframe: wireframe.into(),
        })
    }

    /// Number of views.
    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        Ok(self.scene(py)?.views.len())
    }

    fn __repr__(&self) -> String {
        format!("<neat3d.Scene: {}>", self.folder.display())
    }
}

impl Scene {
    /// Its folder, and what must live as long as that is needed.
    pub fn place(&self, py: Python<'_>) -> (PathBuf, Option<Py<PyAny>>) {
        (
            self.folder.clone(),
            self.keep.as_ref().map(|keep| keep.clone_ref(py)),
        )
    }

    fn scene(&self, py: Python<'_>) -> PyResult<Arc<Posed>> {
        if let Some(scene) = self.read.get() {
            return Ok(Arc::clone(scene));
        }
        let folder = self.folder.clone();
        let loaded = background::run(py, None, move || {
            let (data, cache) = (Preset::default().config().data, FileCache::of_user());
            let options = LoadOptions {
                require_wireframes: false,
                ..load_options(&data, cache.as_ref(), default_limit())
            };
            Ok(load_scene(&folder, &options)?)
        })?;
        for warning in &loaded.warnings {
            crate::wireframe::warn(py, &warning.to_string())?;
        }
        Ok(Arc::clone(self.read.get_or_init(|| loaded.scene.into())))
    }
}

fn view_of(scene: &Posed, index: usize) -> Result<&View, Failure> {
    let none = || {
        Failure::input(format!(
            "there is no view {index}: the scene has {}",
            scene.views.len()
        ))
    };
    scene.views.get(index).ok_or_else(none)
}

/// What a scene is made of, but for its cameras.
struct Given<'a, 'py> {
    images: &'a [Bound<'py, PyAny>],
    names: Option<Vec<String>>,
    segments: Option<&'a [Bound<'py, PyAny>]>,
}

impl Given<'_, '_> {
    /// The views, sorted by name.
    fn views(self, k: &[[f64; 9]], poses: &[[f64; 16]], pixel_center: f64) -> PyResult<Vec<View>> {
        let views = self.images.len();
        let names = self
            .names
            .unwrap_or_else(|| (0..views).map(|i| format!("{i:04}")).collect());
        check_count("names", names.len(), views)?;
        if let Some(segments) = self.segments {
            check_count("segments", segments.len(), views)?;
        }
        let mut all = Vec::with_capacity(views);
        for (index, name) in names.into_iter().enumerate() {
            let bad = |problem: String| Failure::input(format!("view `{name}`: {problem}"));
            let image = rgb_image(&self.images[index], &format!("image {index}"))?;
            let (width, height) = image.dimensions();
            let intrinsics = Intrinsics::try_from_matrix(&Matrix3::from_row_slice(&k[index]));
            let intrinsics = intrinsics.map_err(|problem| bad(problem.to_string()))?;
            let pose = Matrix4::from_row_slice(&poses[index]);
            let camera = Camera::try_from_matrices(intrinsics, &pose, width, height);
            let camera = camera.map_err(|problem| bad(problem.to_string()))?;
            let mut wireframe = match self.segments {
                Some(segments) => given(&segments[index], (width, height))?,
                None => Wireframe2d::empty(width, height),
            };
            let is_ours =
                |segments: &[Bound<'_, PyAny>]| segments[index].is_instance_of::<Segments>();
            if self.segments.is_some_and(is_ours) {
                for vertex in &mut wireframe.vertices {
                    *vertex = vertex.add_scalar(pixel_center - PIXEL_CENTER);
                }
            }
            all.push(View {
                name,
                camera,
                wireframe,
                image: image.into(),
            });
        }
        all.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(all)
    }
}

fn check_count(what: &str, count: usize, views: usize) -> Result<(), Failure> {
    match count == views {
        true => Ok(()),
        false => Err(Failure::input(format!(
            "there are {views} images and {count} {what}: give one per image"
        ))),
    }
}

/// Square matrices of `CELLS` numbers, row by row: one for each of `count` views, or one for all.
fn matrices<const CELLS: usize>(
    object: &Bound<'_, PyAny>,
    name: &str,
    count: usize,
) -> PyResult<Vec<[f64; CELLS]>> {
    let array = numbers(object)?;
    let side = CELLS.isqrt();
    let cells = array.as_slice()?.as_chunks().0;
    match *array.shape() {
        [a, b] if [a, b] == [side; 2] => Ok(vec![cells[0]; count]),
        [n, a, b] if n == count && [a, b] == [side; 2] => Ok(cells.to_vec()),
        ref shape => {
            let text = format!(
                "{name} has the shape {shape:?}: give ({count}, {side}, {side}), one per image"
            );
            Err(Failure::input(text).into())
        }
    }
}
