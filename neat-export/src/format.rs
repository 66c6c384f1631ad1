//! The formats: a table of names, file endings and the functions that write them.
//!
//! A new format is a file with its function, a variant of [`Format`], and a row of
//! [`FORMATS`].

use crate::ExportError;
use crate::target::Target;
use crate::{cityjson, colmap, dxf, geojson, gltf, limap, npz, picture, step, svg};
use neat_wireframe::export::{write_json, write_obj, write_ply};
use std::path::Path;

/// A format that a wireframe can be written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// neat's own JSON, with everything that is known.
    Json,
    /// Wavefront OBJ.
    Obj,
    /// Polygon file format with edges.
    Ply,
    /// glTF 2.0 as text.
    Gltf,
    /// glTF 2.0 in one binary file.
    Glb,
    /// Drawing exchange format of CAD programs.
    Dxf,
    /// ISO 10303-21, the exchange format of CAD programs.
    Step,
    /// An orthographic view as vector graphics.
    Svg,
    /// An orthographic view as an image.
    Png,
    /// Features for geographic information systems.
    GeoJson,
    /// CityJSON 2.0, the buildings of geographic information systems.
    CityJson,
    /// NumPy arrays.
    Npz,
    /// A COLMAP text model whose points are the junctions.
    Colmap,
    /// LIMAP's line tracks.
    Limap,
}

/// A format as one row of [`FORMATS`].
struct Row {
    format: Format,
    name: &'static str,
    /// See [`Format::endings`].
    endings: &'static [&'static str],
    write: fn(&mut Target) -> Result<(), ExportError>,
    explanation: &'static str,
}

/// The endings of a format that fills a folder.
const FOLDER: &[&str] = &[];

/// Every format, in the order of [`Format`] and of help texts.
#[rustfmt::skip] // One row a line.
static FORMATS: [Row; 14] = [
    row(Format::Json, "json", &["json"], |to| Ok(write_json(to.path, to.document)?), "everything that is known, by docs/wireframe.schema.json"),
    row(Format::Obj, "obj", &["obj"], |to| Ok(write_obj(to.path, &to.document.drawn(), &to.document.drawn_triangles())?), "Wavefront OBJ: v, l and f elements (Blender, MeshLab, trimesh)"),
    row(Format::Ply, "ply", &["ply"], |to| Ok(write_ply(to.path, &to.document.drawn(), &to.document.drawn_triangles())?), "PLY, ASCII, with vertex, face and edge elements (CloudCompare, trimesh)"),
    row(Format::Gltf, "gltf", &["gltf"], gltf::write_text, "glTF 2.0 lines and triangles, text with embedded data, coloured by confidence"),
    row(Format::Glb, "glb", &["glb"], gltf::write_binary, "glTF 2.0 lines and triangles in one binary file (web viewers, Blender)"),
    row(Format::Dxf, "dxf", &["dxf"], dxf::write, "AutoCAD R12 lines on layers by confidence, arcs, splines (CAD programs)"),
    row(Format::Step, "step", &["step", "stp"], step::write, "ISO 10303 AP214: solids and sheets of faces, else a wireframe of lines and circles (CAD programs)"),
    row(Format::Svg, "svg", &["svg"], svg::write, "orthographic view, vector graphics"),
    row(Format::Png, "png", &["png"], picture::write, "orthographic view, image"),
    row(Format::GeoJson, "geojson", &["geojson"], geojson::write, "LineString features with z, coordinates as they are (QGIS)"),
    row(Format::CityJson, "cityjson", &["city.json"], cityjson::write, "CityJSON 2.0: faces as ground, walls and roofs of buildings, solids where they close (GIS)"),
    row(Format::Npz, "npz", &["npz"], npz::write, "NumPy: lines3d as the published NEAT code, junctions, edges, arcs, splines"),
    row(Format::Colmap, "colmap", FOLDER, colmap::write, "a folder: COLMAP text model of the junctions, and lines3D.txt"),
    row(Format::Limap, "limap", FOLDER, limap::write, "a folder: line tracks with their 2D segments, as LIMAP leaves them"),
];

const fn row(
    format: Format,
    name: &'static str,
    endings: &'static [&'static str],
    write: fn(&mut Target) -> Result<(), ExportError>,
    explanation: &'static str,
) -> Row {
    Row {
        format,
        name,
        endings,
        write,
        explanation,
    }
}

impl Format {
    /// All formats, in the order in which help texts list them.
    pub const ALL: [Self; FORMATS.len()] = {
        let mut all = [Self::Json; FORMATS.len()];
        let mut index = 0;
        while index < all.len() {
            all[index] = FORMATS[index].format;
            index += 1;
        }
        all
    };

    fn row(self) -> &'static Row {
        &FORMATS[self as usize]
    }

    /// Name, for command lines and messages.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// The file endings by which [`Format::from_path`] knows it, the usual one
    /// first; empty for a format that fills a folder.
    pub fn endings(self) -> &'static [&'static str] {
        self.row().endings
    }

    /// Whether it fills a folder instead of a file.
    pub fn is_folder(self) -> bool {
        self.endings().is_empty()
    }

    /// Whether it has faces beside edges.
    pub fn holds_faces(self) -> bool {
        matches!(
            self,
            Self::Json
                | Self::Obj
                | Self::Ply
                | Self::Gltf
                | Self::Glb
                | Self::Step
                | Self::CityJson
        )
    }

    /// What it is for, in one line.
    pub fn explanation(self) -> &'static str {
        self.row().explanation
    }

    pub(crate) fn write(self, target: &mut Target) -> Result<(), ExportError> {
        (self.row().write)(target)
    }

    /// The format that a file name's ending says, in upper or lower case.
    ///
    /// # Errors
    /// If it has no ending or one that no format has.
    pub fn from_path(path: &Path) -> Result<Self, ExportError> {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let name = name.to_ascii_lowercase();
        // How long the ending is by which a format knows the name.
        let known_by = |format: &Self| {
            let endings = format.endings().iter().filter(|ending| {
                let stem = name.strip_suffix(*ending);
                let stem = stem.and_then(|stem| stem.strip_suffix('.'));
                stem.is_some_and(|stem| !stem.is_empty())
            });
            endings.map(|ending| ending.len()).max()
        };
        let known = Self::ALL
            .into_iter()
            .filter_map(|f| Some((known_by(&f)?, f)));
        // `.city.json` is no `.json`.
        let longest = known.max_by_key(|(length, _)| *length);
        longest.map(|(_, format)| format).ok_or_else(|| {
            let endings: Vec<_> = Self::ALL
                .iter()
                .flat_map(|format| format.endings())
                .map(|ending| format!(".{ending}"))
                .collect();
            ExportError::UnknownEnding {
                path: path.into(),
                known: endings.join(", "),
            }
        })
    }

    /// The format of this [`Format::name`] or ending.
    ///
    /// # Errors
    /// If there is none.
    pub fn from_name(name: &str) -> Result<Self, ExportError> {
        let lower = name.to_ascii_lowercase();
        Self::ALL
            .into_iter()
            .find(|format| format.name() == lower || format.endings().contains(&lower.as_str()))
            .ok_or_else(|| ExportError::UnknownFormat {
                name: name.into(),
                known: Self::ALL.map(Self::name).join(", "),
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_endings_lead_back() {
        for format in Format::ALL {
            assert_eq!(format.row().format, format);
            assert_eq!(Format::from_name(format.name()).unwrap(), format);
            for ending in format.endings() {
                let path = format!("out.d/wire.frame.{}", ending.to_uppercase());
                assert_eq!(Format::from_path(Path::new(&path)).unwrap(), format);
                assert_eq!(Format::from_name(ending).unwrap(), format);
            }
        }
    }

    #[test]
    fn the_longest_ending_says_the_format() {
        for (name, format) in [
            ("house.city.json", Format::CityJson),
            ("house.CITY.Json", Format::CityJson),
            ("city.json", Format::Json),
            (".city.json", Format::Json),
            ("house.simplicity.json", Format::Json),
        ] {
            assert_eq!(Format::from_path(Path::new(name)).unwrap(), format);
        }
    }

    #[test]
    fn unknown_ones_are_named_with_the_known() {
        for path in ["", "wireframe", ".json", "a.docx", "a.json.gz", "a.dxf.d/x"] {
            let error = Format::from_path(Path::new(path)).unwrap_err().to_string();
            assert!(error.contains(path) && error.contains(".stp"), "{error}");
        }
        let error = Format::from_name("docx").unwrap_err().to_string();
        assert!(
            error.contains("`docx`") && error.contains("colmap"),
            "{error}"
        );
    }
}
