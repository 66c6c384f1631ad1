//! The 3D wireframe, as arrays.

use crate::arrays::{points, read_only, rows};
use crate::background;
use crate::errors::{Failure, NeatWarning};
use nalgebra::Vector3;
use neat_core::{CircularArc, Wireframe3d};
use neat_export::{
    EdgeFilter, ExportOptions, Format, LengthUnit, UpAxis, ViewDirection, export as write_as,
};
use neat_wireframe::export::{WireframeDocument, read_json};
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::Arc;

/// A 3D wireframe with whatever is known about its parts: the content of a wireframe.json.
///
/// Lengths are in the unit and positions in the frame of your files. Arrays are read-only
/// copies.
#[pyclass(frozen, module = "neat3d")]
pub struct Wireframe {
    pub document: Arc<WireframeDocument>,
}

impl From<WireframeDocument> for Wireframe {
    fn from(document: WireframeDocument) -> Self {
        Self {
            document: document.into(),
        }
    }
}

#[pymethods]
impl Wireframe {
    /// A wireframe of junctions (J, 3) and edges (E, 2), pairs of their indices.
    #[new]
    fn new(junctions: &Bound<'_, PyAny>, edges: &Bound<'_, PyAny>) -> PyResult<Self> {
        let index = |[a, b]: [f64; 2]| {
            let is_index = |x: f64| x >= 0.0 && x.fract() == 0.0;
            let bad =
                || Failure::input(format!("edges holds ({a}, {b}): give indices of junctions"));
            // Whole numbers that are not negative, as just checked; too large ones name no junction.
            (is_index(a) && is_index(b))
                .then_some([a as usize, b as usize])
                .ok_or_else(bad)
        };
        let edges = rows::<2>(edges, "edges")?.into_iter().map(index);
        let wireframe = Wireframe3d {
            junctions: points(junctions, "junctions")?,
            edges: edges.collect::<Result<_, _>>()?,
        };
        let document = WireframeDocument::from(&wireframe);
        document
            .check("wireframe".as_ref())
            .map_err(Failure::from)?;
        Ok(document.into())
    }

    /// Reads a wireframe.json.
    #[staticmethod]
    fn read(path: PathBuf) -> PyResult<Self> {
        Ok(read_json(&path).map_err(Failure::from)?.into())
    }

    /// Positions of the junctions (J, 3).
    #[getter]
    fn junctions<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let junctions = &self.document.junctions;
        let values = junctions
            .iter()
            .flat_map(|p| <[f64; 3]>::from(*p))
            .collect();
        read_only(py, (junctions.len(), 3), values)
    }

    /// Pairs of junctions that an edge joins (E, 2), as indices.
    #[getter]
    fn edges<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<i64>> {
        let edges = &self.document.edges;
        let values = edges.iter().flatten().map(|i| *i as i64).collect();
        read_only(py, (edges.len(), 2), values)
    }

    /// Both ends of every edge (E, 2, 3).
    #[getter]
    fn segments<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f64>> {
        let edges = &self.document.edges;
        let ends = edges
            .iter()
            .flatten()
            .map(|end| self.document.junctions[*end]);
        let values = ends.flat_map(<[f64; 3]>::from).collect();
        read_only(py, (edges.len(), 2, 3), values)
    }

    /// Covariances of the junctions (J, 3, 3) in squared units; NaN where the images do not
    /// determine the position, or nobody has said.
    #[getter]
    fn covariances<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f64>> {
        let count = self.document.junctions.len();
        let known = self.document.junction_covariances.iter().copied();
        let all = known.chain(std::iter::repeat(None)).take(count);
        let matrix = |upper: Option<[f64; 6]>| {
            let [xx, xy, xz, yy, yz, zz] = upper.unwrap_or([f64::NAN; 6]);
            [xx, xy, xz, xy, yy, yz, xz, yz, zz]
        };
        read_only(py, (count, 3, 3), all.flat_map(matrix).collect())
    }

    /// Probability that each edge exists (E,); None if nobody has said.
    #[getter]
    fn probabilities<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        let probability = self.document.edge_fields.probability.clone()?;
        Some(read_only(py, probability.len(), probability))
    }

    /// Probabilities of what each edge is (E, 4), in the order of `neat3d.KINDS`: crease,
    /// boundary, texture, shadow; None if nobody has said.
    #[getter]
    fn kinds<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        let fields = &self.document.edge_fields;
        let (crease, boundary) = (fields.crease.as_ref()?, fields.boundary.as_ref()?);
        let (texture, shadow) = (fields.texture.as_ref()?, fields.shadow.as_ref()?);
        let edges = self.document.edges.len();
        let row = |edge: usize| [crease[edge], boundary[edge], texture[edge], shadow[edge]];
        Some(read_only(
            py,
            (edges, 4),
            (0..edges).flat_map(row).collect(),
        ))
    }

    /// Arcs of circles beside the edges, as arrays by name: `centers` (A, 3); `axes` (A, 2, 3),
    /// unit vectors toward angle 0 and a right angle; `radii` (A,); `angles` (A, 2) in radians,
    /// where they begin and end, 2π apart for a whole circle; `covariances` (A, 4, 4) of centre and
    /// radius in squared units, NaN where the views do not tell.
    #[getter]
    fn arcs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (arcs, count) = (&self.document.arcs, self.document.arcs.len());
        let numbers = |of: &dyn Fn(&CircularArc) -> Vec<f64>| arcs.iter().flat_map(of).collect();
        let coordinates = |points: &[Vector3<f64>]| points.iter().flatten().copied().collect();
        let known = self.document.arc_covariances.iter().copied();
        let all = known.chain(std::iter::repeat(None)).take(count);
        let matrix = |upper: Option<[f64; 10]>| {
            let [xx, xy, xz, xr, yy, yz, yr, zz, zr, rr] = upper.unwrap_or([f64::NAN; 10]);
            [
                xx, xy, xz, xr, xy, yy, yz, yr, xz, yz, zz, zr, xr, yr, zr, rr,
            ]
        };
        let centers = numbers(&|arc| coordinates(&[arc.center]));
        let axes = numbers(&|arc| coordinates(&arc.axes));
        let (radii, angles) = (
            numbers(&|arc| vec![arc.radius]),
            numbers(&|arc| arc.angles.into()),
        );
        let covariances = all.flat_map(matrix).collect();
        let dict = PyDict::new(py);
        dict.set_item("centers", read_only(py, (count, 3), centers))?;
        dict.set_item("axes", read_only(py, (count, 2, 3), axes))?;
        dict.set_item("radii", read_only(py, count, radii))?;
        dict.set_item("angles", read_only(py, (count, 2), angles))?;
        dict.set_item("covariances", read_only(py, (count, 4, 4), covariances))?;
        Ok(dict)
    }

    /// Smooth curves beside edges and arcs, as arrays by name. Each is a uniform cubic B-spline:
    /// `controls` (C, 3), the control points of one behind those of the other; `sizes` (S,), how many
    /// of them are its own; `closed` (S,), whether it runs around. An open one begins at its first
    /// control point and ends at its last.
    #[getter]
    fn splines<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (splines, count) = (&self.document.splines, self.document.splines.len());
        let controls = splines.iter().flat_map(|spline| &spline.controls);
        let controls: Vec<f64> = controls.flatten().copied().collect();
        let sizes = splines.iter().map(|spline| spline.controls.len() as i64);
        let closed = splines.iter().map(|spline| spline.closed).collect();
        let dict = PyDict::new(py);
        dict.set_item("controls", read_only(py, (controls.len() / 3, 3), controls))?;
        dict.set_item("sizes", read_only(py, count, sizes.collect()))?;
        dict.set_item("closed", read_only(py, count, closed))?;
        Ok(dict)
    }

    /// Parts of spheres that images show by their outlines, as the dicts of wireframe.json: `center`,
    /// `axis` to the pole, `radius` and `reach`, the angle from the axis to the rim in radians.
    #[getter]
    fn domes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        from_json(py, &serde_json::json!(self.document.domes))
    }

    /// Faces between edges, arcs and splines, closed shells first, as the lists and dicts of
    /// wireframe.json: `closed`, whether it bounds a solid, and `faces`. A face has a `plane`
    /// (`normal`, `offset`), a `cylinder` (`point`, `axis`, `radius`, `convex`), a `cone` (`apex`,
    /// `axis`, `half_angle`, `convex`), a `sphere` (`center`, `radius`, `convex`), a profile that is
    /// `extruded` (`direction`) or a `patch` between four `sides`, and `loops` of steps: an `edge`, `arc`
    /// or `spline` by its index, a `smooth` line by its two junctions, or the `rim` of a dome by its
    /// index, and whether it is `reversed`.
    #[getter]
    fn shells<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        from_json(py, &serde_json::json!(self.document.shells))
    }

    /// All facts about the edges, by name: each (E,).
    #[getter]
    fn edge_fields<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        named_arrays(py, self.document.edge_fields.named())
    }

    /// All facts about the junctions, by name: each (J,). `sigma` is the largest standard
    /// deviation of the position; `junction_type` 0 an end, 1 a tee, 2 a meeting in one plane, 3 a corner.
    #[getter]
    fn junction_fields<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        named_arrays(py, self.document.junction_fields.named())
    }

    /// Names of the views that `support` counts.
    #[getter]
    fn views(&self) -> Vec<String> {
        self.document.views.clone()
    }

    /// For every edge the 2D segments that support it: (view, (x, y, x, y), residual), the
    /// view as an index of `views`, the rest in pixels of the undistorted image.
    #[getter]
    fn support(&self) -> Vec<Vec<(usize, [f64; 4], f64)>> {
        let edges = self.document.edge_support.iter();
        edges
            .map(|all| {
                all.iter()
                    .map(|one| (one.view, one.segment, one.residual))
                    .collect()
            })
            .collect()
    }

    /// What is known of the whole: scene, seed, preset, version, the report of the back end.
    #[getter]
    fn metadata<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        from_json(py, &serde_json::json!(self.document.metadata))
    }

    /// The wireframe with only the edges that are certain enough, or of the shape of things,
    /// and the junctions that they join.
    #[pyo3(signature = (*, min_probability=None, min_views=None, only_structure=false))]
    fn filter(
        &self,
        min_probability: Option<f64>,
        min_views: Option<u32>,
        only_structure: bool,
    ) -> PyResult<Self> {
        let filter = EdgeFilter {
            min_probability,
            min_views,
            only_structure,
        };
        Ok(filter.apply(&self.document).map_err(Failure::from)?.into())
    }

    /// Writes the wireframe for other programs, in the frame and unit of your files, and
    /// returns the files.
    ///
    /// format: one of `neat3d.FORMATS`; by default what the ending of path says. view: from
    /// where svg and png look (front, top, side, isometric). width: of svg and png in pixels.
    /// unit: of your files, which step has to name (mm, cm, m). up: the axis of your files that
    /// points upward, which cityjson turns to +z (x, y, z, -x, -y, -z).
    #[pyo3(signature = (path, format=None, *, view=None, width=None, unit=None, up=None))]
    fn export(
        &self,
        py: Python<'_>,
        path: PathBuf,
        format: Option<&str>,
        view: Option<&str>,
        width: Option<u32>,
        unit: Option<&str>,
        up: Option<&str>,
    ) -> PyResult<Vec<PathBuf>> {
        let format = match format {
            Some(name) => Format::from_name(name),
            None => Format::from_path(&path),
        };
        let format = format.map_err(Failure::from)?;
        let is_drawing = matches!(format, Format::Svg | Format::Png);
        for (option, given, is_used) in [
            ("view", view.is_some(), is_drawing),
            ("width", width.is_some(), is_drawing),
            ("unit", unit.is_some(), format == Format::Step),
            ("up", up.is_some(), format == Format::CityJson),
        ] {
            if given && !is_used {
                let name = format.name();
                return Err(Failure::input(format!("{option} has no meaning for {name}")).into());
            }
        }
        let default = ExportOptions::default();
        let options = ExportOptions {
            direction: view.map_or(Ok(default.direction), direction)?,
            width: width.unwrap_or(default.width),
            unit: unit.map_or(Ok(default.unit), length_unit)?,
            up: up
                .map_or(Ok(default.up), UpAxis::from_name)
                .map_err(Failure::from)?,
            ..default
        };
        let document = Arc::clone(&self.document);
        let written = background::run(py, None, move || {
            Ok(write_as(&document, &path, format, &options)?)
        })?;
        for sentence in written.remarks {
            warn(py, &sentence)?;
        }
        Ok(written.files)
    }

    /// The edges as a `trimesh.path.Path3D`, whose package must be installed.
    fn to_trimesh<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py()
            .import("neat3d.interop")?
            .call_method1("to_trimesh", (slf,))
    }

    /// The edges as an `open3d.geometry.LineSet`, whose package must be installed.
    fn to_open3d<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py()
            .import("neat3d.interop")?
            .call_method1("to_open3d", (slf,))
    }

    /// Number of edges.
    fn __len__(&self) -> usize {
        self.document.edges.len()
    }

    fn __repr__(&self) -> String {
        let (junctions, edges) = (self.document.junctions.len(), self.__len__());
        format!("<neat3d.Wireframe: {junctions} junctions, {edges} edges>")
    }
}

/// Says something through Python's module of warnings.
pub fn warn(py: Python<'_>, text: &str) -> PyResult<()> {
    let category = py.get_type::<NeatWarning>();
    py.import("warnings")?
        .call_method1("warn", (text, category))?;
    Ok(())
}

/// JSON as Python's dicts, lists and numbers.
pub fn from_json<'py>(py: Python<'py>, value: &serde_json::Value) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?
        .call_method1("loads", (value.to_string(),))
}

fn named_arrays<'py>(
    py: Python<'py>,
    fields: impl IntoIterator<Item = (String, Vec<f64>)>,
) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for (name, values) in fields {
        dict.set_item(name, read_only(py, values.len(), values))?;
    }
    Ok(dict)
}

fn direction(name: &str) -> Result<ViewDirection, Failure> {
    Ok(match name {
        "front" => ViewDirection::Front,
        "top" => ViewDirection::Top,
        "side" => ViewDirection::Side,
        "isometric" => ViewDirection::Isometric,
        _ => {
            let text = format!("there is no view `{name}`: use one of front, top, side, isometric");
            return Err(Failure::input(text));
        }
    })
}

fn length_unit(name: &str) -> Result<LengthUnit, Failure> {
    Ok(match name {
        "mm" => LengthUnit::Millimetre,
        "cm" => LengthUnit::Centimetre,
        "m" => LengthUnit::Metre,
        _ => {
            return Err(Failure::input(format!(
                "there is no unit `{name}`: use one of mm, cm, m"
            )));
        }
    })
}
