//! The formats, their names and their file endings.

use crate::ExportError;
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
    /// NumPy arrays.
    Npz,
    /// A COLMAP text model whose points are the junctions.
    Colmap,
    /// LIMAP's line tracks.
    Limap,
}

impl Format {
    /// All formats, in the order in which help texts list them.
    pub const ALL: [Self; 13] = [
        Self::Json,
        Self::Obj,
        Self::Ply,
        Self::Gltf,
        Self::Glb,
        Self::Dxf,
        Self::Step,
        Self::Svg,
        Self::Png,
        Self::GeoJson,
        Self::Npz,
        Self::Colmap,
        Self::Limap,
    ];

    /// Name, for command lines and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Json => "json",
            Self::Obj => "obj",
            Self::Ply => "ply",
            Self::Gltf => "gltf",
            Self::Glb => "glb",
            Self::Dxf => "dxf",
            Self::Step => "step",
            Self::Svg => "svg",
            Self::Png => "png",
            Self::GeoJson => "geojson",
            Self::Npz => "npz",
            Self::Colmap => "colmap",
            Self::Limap => "limap",
        }
    }

    /// The file endings by which [`Format::from_path`] knows it, the usual one
    /// first; empty for a format that fills a folder.
    pub fn endings(self) -> &'static [&'static str] {
        match self {
            Self::Json => &["json"],
            Self::Obj => &["obj"],
            Self::Ply => &["ply"],
            Self::Gltf => &["gltf"],
            Self::Glb => &["glb"],
            Self::Dxf => &["dxf"],
            Self::Step => &["step", "stp"],
            Self::Svg => &["svg"],
            Self::Png => &["png"],
            Self::GeoJson => &["geojson"],
            Self::Npz => &["npz"],
            Self::Colmap | Self::Limap => &[],
        }
    }

    /// Whether it fills a folder instead of a file.
    pub fn is_folder(self) -> bool {
        self.endings().is_empty()
    }

    /// What it is for, in one line.
    pub fn explanation(self) -> &'static str {
        match self {
            Self::Json => "everything that is known, by docs/wireframe.schema.json",
            Self::Obj => "Wavefront OBJ: v and l elements (Blender, MeshLab, trimesh)",
            Self::Ply => "PLY, ASCII, with vertex and edge elements (CloudCompare, trimesh)",
            Self::Gltf => "glTF 2.0 lines, text with embedded data, coloured by confidence",
            Self::Glb => "glTF 2.0 lines in one binary file (web viewers, Blender)",
            Self::Dxf => "AutoCAD R12 lines on layers by confidence (CAD programs)",
            Self::Step => "ISO 10303 AP214 wireframe with shared vertices (CAD programs)",
            Self::Svg => "orthographic view, vector graphics",
            Self::Png => "orthographic view, image",
            Self::GeoJson => "LineString features with z, coordinates as they are (QGIS)",
            Self::Npz => "NumPy: lines3d as the published NEAT code, junctions, edges",
            Self::Colmap => "a folder: COLMAP text model of the junctions, and lines3D.txt",
            Self::Limap => "a folder: line tracks with their 2D segments, as LIMAP leaves them",
        }
    }

    /// The format that a file name's ending says, in upper or lower case.
    ///
    /// # Errors
    /// If it has no ending or one that no format has.
    pub fn from_path(path: &Path) -> Result<Self, ExportError> {
        let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
        let named = |format: &Self| format.endings().iter().any(|known| ending == *known);
        Self::ALL.into_iter().find(named).ok_or_else(|| {
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
            assert_eq!(Format::from_name(format.name()).unwrap(), format);
            for ending in format.endings() {
                let path = format!("out.d/wire.frame.{}", ending.to_uppercase());
                assert_eq!(Format::from_path(Path::new(&path)).unwrap(), format);
                assert_eq!(Format::from_name(ending).unwrap(), format);
            }
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
