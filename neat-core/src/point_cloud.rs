//! Point clouds in PLY files: the vertices and, in those written, their colours.

use crate::{SceneError, file};
use nalgebra::Vector3;
use std::path::Path;

/// How the numbers after the header are written.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Ascii,
    LittleEndian,
}

/// A number type of a property.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Scalar {
    Int8,
    Uint8,
    Int16,
    Uint16,
    Int32,
    Uint32,
    Float32,
    Float64,
}

impl Scalar {
    fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::Int8,
            "uchar" | "uint8" => Self::Uint8,
            "short" | "int16" => Self::Int16,
            "ushort" | "uint16" => Self::Uint16,
            "int" | "int32" => Self::Int32,
            "uint" | "uint32" => Self::Uint32,
            "float" | "float32" => Self::Float32,
            "double" | "float64" => Self::Float64,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::Int8 | Self::Uint8 => 1,
            Self::Int16 | Self::Uint16 => 2,
            Self::Int32 | Self::Uint32 | Self::Float32 => 4,
            Self::Float64 => 8,
        }
    }
}

/// What the header says about the vertices.
struct Header {
    encoding: Encoding,
    /// How many vertices it claims.
    vertices: usize,
    /// Their properties, in order.
    properties: Vec<(String, Scalar)>,
    /// Where the numbers start.
    body: usize,
}

/// A header line longer than this is none.
const MAX_LINE_BYTES: usize = 4096;

/// Reads the vertex positions of a PLY file: ASCII or binary little-endian, with
/// the vertices before all other elements.
///
/// # Errors
/// If the file is missing, empty, truncated or of another format, lacks x, y or
/// z, or a position is not finite.
pub fn read_ply(path: &Path) -> Result<Vec<Vector3<f64>>, SceneError> {
    parse_ply(&file::read(path, "give a point cloud as a PLY file")?, path)
}

/// [`read_ply`] from bytes; `path` is for messages.
///
/// # Errors
/// As [`read_ply`].
pub fn parse_ply(bytes: &[u8], path: &Path) -> Result<Vec<Vector3<f64>>, SceneError> {
    parse(bytes).map_err(|reason| SceneError::Malformed {
        path: path.into(),
        reason,
    })
}

/// Writes points and their colours as a PLY file: binary, little-endian, with
/// `double` x, y, z and `uchar` red, green, blue.
///
/// # Errors
/// If the file cannot be written.
///
/// # Panics
/// If there is not one colour per point.
pub fn write_ply(
    path: &Path,
    points: &[Vector3<f64>],
    colors: &[[u8; 3]],
) -> Result<(), SceneError> {
    assert_eq!(points.len(), colors.len(), "write_ply: a colour per point");
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\n\
         property double x\nproperty double y\nproperty double z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
        points.len()
    )
    .into_bytes();
    for (point, color) in points.iter().zip(colors) {
        for coordinate in point {
            bytes.extend(coordinate.to_le_bytes());
        }
        bytes.extend(color);
    }
    file::write_atomically(path, &bytes)
}

fn parse(bytes: &[u8]) -> Result<Vec<Vector3<f64>>, String> {
    let header = parse_header(bytes)?;
    let body = &bytes[header.body..];
    let points = match header.encoding {
        Encoding::Ascii => ascii_points(body, &header)?,
        Encoding::LittleEndian => binary_points(body, &header)?,
    };
    match points.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
        Some(index) => Err(format!("the position of vertex {index} is not finite")),
        None => Ok(points),
    }
}

fn parse_header(bytes: &[u8]) -> Result<Header, String> {
    let mut body = 0;
    let mut next_line = || {
        let rest = &bytes[body..];
        let window = &rest[..rest.len().min(MAX_LINE_BYTES)];
        let end = window.iter().position(|&b| b == b'\n')?;
        body += end + 1;
        std::str::from_utf8(&window[..end]).ok().map(str::trim)
    };

    if next_line() != Some("ply") {
        return Err("it does not start with the line `ply`".into());
    }
    let mut encoding = None;
    let mut vertices = None;
    let mut in_vertices = false;
    let mut properties = Vec::new();
    loop {
        let line = next_line().ok_or("its header does not end")?;
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            [] | ["comment" | "obj_info", ..] => {}
            ["format", "ascii", _] => encoding = Some(Encoding::Ascii),
            ["format", "binary_little_endian", _] => encoding = Some(Encoding::LittleEndian),
            ["format", ref other @ ..] => {
                return Err(format!(
                    "format `{}` is not read; convert it to ascii or binary_little_endian",
                    other.join(" ")
                ));
            }
            ["element", "vertex", count] if vertices.is_none() => {
                let count = count
                    .parse::<usize>()
                    .map_err(|_| format!("`{count}` is no number of vertices"))?;
                vertices = Some(count);
                in_vertices = true;
            }
            ["element", ..] if vertices.is_none() => {
                return Err("its first element is not `vertex`".into());
            }
            ["element", ..] => in_vertices = false,
            ["property", ..] if !in_vertices => {}
            ["property", kind, name] => {
                let scalar = Scalar::parse(kind)
                    .ok_or_else(|| format!("property type `{kind}` is unknown"))?;
                properties.push((name.to_string(), scalar));
            }
            ["end_header"] => break,
            _ => return Err(format!("its header has the line `{line}`")),
        }
    }
    Ok(Header {
        encoding: encoding.ok_or("its header names no format")?,
        vertices: vertices.ok_or("its header names no vertices")?,
        properties,
        body,
    })
}

/// Which properties are x, y and z.
fn position_columns(header: &Header) -> Result<[usize; 3], String> {
    let mut columns = [0; 3];
    for (column, axis) in columns.iter_mut().zip(["x", "y", "z"]) {
        *column = header
            .properties
            .iter()
            .position(|(name, _)| name == axis)
            .ok_or_else(|| format!("its vertices have no property `{axis}`"))?;
    }
    Ok(columns)
}

fn ascii_points(body: &[u8], header: &Header) -> Result<Vec<Vector3<f64>>, String> {
    let columns = position_columns(header)?;
    let text = std::str::from_utf8(body).map_err(|_| "its body is not text")?;
    let mut lines = text.lines().filter(|line| !line.trim().is_empty());
    let mut points = Vec::new();
    let mut row = Vec::with_capacity(header.properties.len());
    for vertex in 0..header.vertices {
        row.clear();
        row.extend(lines.next().unwrap_or_default().split_whitespace());
        if row.len() != header.properties.len() {
            return Err(format!(
                "vertex {vertex} of {} has {} numbers, not {}",
                header.vertices,
                row.len(),
                header.properties.len()
            ));
        }
        let mut point = Vector3::zeros();
        for (coordinate, &column) in point.iter_mut().zip(&columns) {
            *coordinate = row[column]
                .parse()
                .map_err(|_| format!("vertex {vertex} has `{}` for a number", row[column]))?;
        }
        points.push(point);
    }
    Ok(points)
}

fn binary_points(body: &[u8], header: &Header) -> Result<Vec<Vector3<f64>>, String> {
    let columns = position_columns(header)?;
    let stride: usize = header.properties.iter().map(|(_, s)| s.bytes()).sum();
    let needed = stride.checked_mul(header.vertices);
    let data = needed
        .and_then(|needed| body.get(..needed))
        .ok_or_else(|| {
            format!(
                "{} vertices of {stride} bytes do not fit its {} bytes of data",
                header.vertices,
                body.len()
            )
        })?;
    let offset = |column: usize| -> usize {
        let before = &header.properties[..column];
        before.iter().map(|(_, scalar)| scalar.bytes()).sum()
    };
    let fields = columns.map(|column| (offset(column), header.properties[column].1));
    let mut points = Vec::with_capacity(header.vertices);
    for vertex in data.chunks_exact(stride) {
        let mut point = Vector3::zeros();
        for (coordinate, &(start, scalar)) in point.iter_mut().zip(&fields) {
            *coordinate = float(&vertex[start..start + scalar.bytes()], scalar)?;
        }
        points.push(point);
    }
    Ok(points)
}

fn float(bytes: &[u8], scalar: Scalar) -> Result<f64, String> {
    match (scalar, bytes) {
        (Scalar::Float32, &[a, b, c, d]) => Ok(f64::from(f32::from_le_bytes([a, b, c, d]))),
        (Scalar::Float64, &[a, b, c, d, e, f, g, h]) => {
            Ok(f64::from_le_bytes([a, b, c, d, e, f, g, h]))
        }
        _ => Err("its positions are not floats".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mutation::{CASES, damaged};
    use proptest::prelude::*;

    const ASCII: &str = "ply\nformat ascii 1.0\ncomment any\nelement vertex 2\nproperty uchar red\n\
        property float x\nproperty float y\nproperty float z\nelement face 1\n\
        property list uchar int vertex_indices\nend_header\n\
        9 1 2 3\n8 -4 5e-1 6\n3 0 1 0\n";

    fn binary() -> Vec<u8> {
        let mut bytes = b"ply\nformat binary_little_endian 1.0\nelement vertex 2\n\
            property float64 x\nproperty float32 y\nproperty short flag\nproperty float32 z\n\
            end_header\n"
            .to_vec();
        for (x, y, z) in [(1.0_f64, 2.0_f32, 3.0_f32), (-4.0, 0.5, 6.0)] {
            bytes.extend(x.to_le_bytes());
            bytes.extend(y.to_le_bytes());
            bytes.extend(7_i16.to_le_bytes());
            bytes.extend(z.to_le_bytes());
        }
        bytes
    }

    #[test]
    fn ascii_and_binary_give_the_positions() {
        let expected = [Vector3::new(1.0, 2.0, 3.0), Vector3::new(-4.0, 0.5, 6.0)];
        assert_eq!(parse(ASCII.as_bytes()).unwrap(), expected);
        assert_eq!(parse(&binary()).unwrap(), expected);
    }

    #[test]
    fn what_is_written_reads_back() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("points.ply");
        let points = [Vector3::new(1.0 / 3.0, -2e9, 0.1), Vector3::zeros()];
        write_ply(&path, &points, &[[10, 13, 255], [0; 3]]).unwrap();
        assert_eq!(read_ply(&path).unwrap(), points);
    }

    #[test]
    fn bad_files_are_refused_with_a_reason() {
        let cases = [
            (ASCII.replace("vertex 2", "vertex 4"), "vertex 3 of 4"),
            (
                ASCII.replace("vertex 2", "vertex 99999999999999"),
                "vertex 3 of",
            ),
            (ASCII.replace("vertex 2", "vertex -1"), "no number"),
            (ASCII.replace("ascii", "binary_big_endian"), "convert"),
            (
                ASCII
                    .replace("ascii", "binary_little_endian")
                    .replace("vertex 2", "vertex 9999999999999999999"),
                "fit",
            ),
            (ASCII.replace("float z", "float w"), "`z`"),
            (ASCII.replace("5e-1", "nan"), "finite"),
            (ASCII.replace("5e-1", "x"), "for a number"),
            (
                ASCII.replace("element vertex", "element edge"),
                "first element",
            ),
            (ASCII.replace("end_header", ""), "header"),
            ("off\n".into(), "start"),
        ];
        for (text, reason) in cases {
            let error = parse_ply(text.as_bytes(), Path::new("scan.ply")).unwrap_err();
            let message = error.to_string();
            assert!(
                message.contains(reason) && message.contains("scan.ply"),
                "{message}"
            );
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(CASES))]
        #[test]
        fn truncated_and_damaged_files_do_not_panic(
            bytes in prop::collection::vec(any::<u8>(), 0..300),
            cut in 1usize..36, damaged in [damaged(ASCII.as_bytes().to_vec()), damaged(binary())],
        ) {
            prop_assert!(parse(&bytes).is_err());
            for file in damaged {
                if let Ok(points) = parse(&file) {
                    prop_assert!(points.len() <= file.len());
                }
            }
            let whole = binary();
            prop_assert!(parse(&whole[..whole.len() - cut]).is_err());
        }
    }
}
