//! PLY with edges: a `vertex` element with x, y and z, and an `edge` element with
//! `vertex1` and `vertex2`, in text or in either binary form. Other elements,
//! lists among them, are passed over.

use super::{checked, malformed};
use nalgebra::Vector3;
use neat_core::{SceneError, Wireframe3d};
use std::path::Path;

/// Reads vertices and edges.
///
/// # Errors
/// If the header is not that of a PLY file with vertices and edges, the file ends
/// early, an edge names no vertex, or a vertex is not finite.
pub fn parse_ply_edges(bytes: &[u8], path: &Path) -> Result<Wireframe3d, SceneError> {
    let wireframe = parse(bytes).map_err(|reason| malformed(path, reason))?;
    checked(wireframe, path)
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Scalar {
    Int { bytes: usize, signed: bool },
    Float { bytes: usize },
}

impl Scalar {
    fn named(name: &str) -> Option<Self> {
        let int = |bytes, signed| Self::Int { bytes, signed };
        Some(match name {
            "char" | "int8" => int(1, true),
            "uchar" | "uint8" => int(1, false),
            "short" | "int16" => int(2, true),
            "ushort" | "uint16" => int(2, false),
            "int" | "int32" => int(4, true),
            "uint" | "uint32" => int(4, false),
            "float" | "float32" => Self::Float { bytes: 4 },
            "double" | "float64" => Self::Float { bytes: 8 },
            _ => return None,
        })
    }
}

enum Property {
    Scalar { name: String, of: Scalar },
    List { count: Scalar, of: Scalar },
}

struct Element {
    name: String,
    rows: usize,
    properties: Vec<Property>,
}

fn parse(bytes: &[u8]) -> Result<Wireframe3d, String> {
    let end = b"end_header";
    let header_end = bytes
        .windows(end.len())
        .position(|window| window == end)
        .ok_or("its header does not end")?;
    let body_start = bytes[header_end..]
        .iter()
        .position(|byte| *byte == b'\n')
        .ok_or("it ends after its header")?;
    let header = std::str::from_utf8(&bytes[..header_end]).map_err(|_| "its header is not text")?;
    let body = &bytes[header_end + body_start + 1..];
    let (format, elements) = parse_header(header)?;
    let mut values: Box<dyn Values> = match format {
        "ascii" => Box::new(Words(
            std::str::from_utf8(body)
                .map_err(|_| "its body is not text")?
                .split_ascii_whitespace(),
        )),
        "binary_little_endian" => Box::new(Binary { body, big: false }),
        "binary_big_endian" => Box::new(Binary { body, big: true }),
        other => return Err(format!("its format `{other}` is unknown")),
    };
    let mut wireframe = Wireframe3d::default();
    for element in &elements {
        match element.name.as_str() {
            "vertex" => {
                let rows = read_rows(element, ["x", "y", "z"], values.as_mut())?;
                wireframe.junctions = rows.into_iter().map(Vector3::from).collect();
            }
            "edge" => {
                let rows = read_rows(element, ["vertex1", "vertex2"], values.as_mut())?;
                for row in rows {
                    if row.iter().any(|index| *index < 0.0) {
                        return Err("an edge has a negative index".into());
                    }
                    wireframe.edges.push(row.map(|index| index as usize));
                }
            }
            _ => drop(read_rows(element, [], values.as_mut())?),
        }
    }
    Ok(wireframe)
}

/// The name of the format, and the elements in the order of the body.
fn parse_header(header: &str) -> Result<(&str, Vec<Element>), String> {
    let mut lines = header.lines();
    if lines.next().map(str::trim) != Some("ply") {
        return Err("it does not start with the line `ply`".into());
    }
    let mut format = None;
    let mut elements: Vec<Element> = Vec::new();
    for line in lines {
        let words: Vec<&str> = line.split_whitespace().collect();
        let scalar = |name: &str| Scalar::named(name).ok_or(format!("no type is called `{name}`"));
        match words[..] {
            [] | ["comment" | "obj_info", ..] => {}
            ["format", name, _] => format = Some(name),
            ["element", name, rows] => elements.push(Element {
                name: name.into(),
                rows: rows
                    .parse()
                    .map_err(|_| format!("`{rows}` is no number of rows"))?,
                properties: Vec::new(),
            }),
            ["property", ref property @ ..] => {
                let element = elements.last_mut().ok_or("a property has no element")?;
                element.properties.push(match *property {
                    ["list", count, of, _] => Property::List {
                        count: scalar(count)?,
                        of: scalar(of)?,
                    },
                    [of, name] => Property::Scalar {
                        name: name.into(),
                        of: scalar(of)?,
                    },
                    _ => return Err(format!("its header has the line `{line}`")),
                });
            }
            _ => return Err(format!("its header has the line `{line}`")),
        }
    }
    for required in ["vertex", "edge"] {
        if !elements.iter().any(|element| element.name == required) {
            return Err(format!("it has no element `{required}`"));
        }
    }
    Ok((format.ok_or("its header names no format")?, elements))
}

/// The columns of these names; all other values are read and dropped.
fn read_rows<const N: usize>(
    element: &Element,
    names: [&str; N],
    values: &mut dyn Values,
) -> Result<Vec<[f64; N]>, String> {
    let column = |property: &Property| match property {
        Property::Scalar { name, .. } => names.iter().position(|wanted| wanted == name),
        Property::List { .. } => None,
    };
    let columns: Vec<Option<usize>> = element.properties.iter().map(column).collect();
    if let Some(missing) = (0..N).find(|index| !columns.contains(&Some(*index))) {
        let (name, wanted) = (&element.name, names[missing]);
        return Err(format!("its element `{name}` has no property `{wanted}`"));
    }
    let truncated = || format!("it ends within its element `{}`", element.name);
    let mut rows = Vec::new();
    // A row of nothing takes no bytes: as many as one likes.
    let count = if element.properties.is_empty() {
        0
    } else {
        element.rows
    };
    for _ in 0..count {
        let mut row = [0.0; N];
        for (property, column) in element.properties.iter().zip(&columns) {
            match property {
                Property::Scalar { of, .. } => {
                    let value = values.next(*of).ok_or_else(truncated)?;
                    if let Some(column) = column {
                        row[*column] = value;
                    }
                }
                Property::List { count, of } => {
                    let count = values.next(*count).ok_or_else(truncated)?;
                    for _ in 0..count as u64 {
                        values.next(*of).ok_or_else(truncated)?;
                    }
                }
            }
        }
        rows.push(row);
    }
    Ok(rows)
}

/// The numbers of a body, one after the other.
trait Values {
    /// `None` at the end, or where there is no number.
    fn next(&mut self, of: Scalar) -> Option<f64>;
}

struct Words<'a>(std::str::SplitAsciiWhitespace<'a>);

impl Values for Words<'_> {
    fn next(&mut self, _: Scalar) -> Option<f64> {
        self.0.next()?.parse().ok()
    }
}

struct Binary<'a> {
    body: &'a [u8],
    big: bool,
}

impl Values for Binary<'_> {
    fn next(&mut self, of: Scalar) -> Option<f64> {
        let (Scalar::Int { bytes, .. } | Scalar::Float { bytes }) = of;
        let (raw, rest) = self.body.split_at_checked(bytes)?;
        self.body = rest;
        // Least significant byte first, in the low bytes of eight.
        let mut word = [0; 8];
        word[..bytes].copy_from_slice(raw);
        if self.big {
            word[..bytes].reverse();
        }
        let word = u64::from_le_bytes(word);
        Some(match of {
            Scalar::Float { bytes: 4 } => f64::from(f32::from_bits(word as u32)),
            Scalar::Float { .. } => f64::from_bits(word),
            Scalar::Int { signed: false, .. } => word as f64,
            Scalar::Int {
                bytes,
                signed: true,
            } => {
                let unused = 64 - 8 * bytes as u32;
                ((word << unused).cast_signed() >> unused) as f64
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "ply\nformat FORMAT 1.0\ncomment any\nelement vertex 2\n\
        property uchar red\nproperty float x\nproperty double y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_indices\n\
        element edge 1\nproperty short vertex1\nproperty int vertex2\nend_header\n";

    fn binary(big: bool) -> Vec<u8> {
        let format = if big {
            "binary_big_endian"
        } else {
            "binary_little_endian"
        };
        let mut bytes = HEADER.replace("FORMAT", format).into_bytes();
        let mut put = |mut raw: Vec<u8>| {
            if big {
                raw.reverse();
            }
            bytes.extend(raw);
        };
        for (x, y, z) in [(1.0_f32, 2.0_f64, 3.0_f32), (-4.0, 0.5, 6.0)] {
            put(vec![200]);
            put(x.to_le_bytes().to_vec());
            put(y.to_le_bytes().to_vec());
            put(z.to_le_bytes().to_vec());
        }
        put(vec![2]);
        put(0_i32.to_le_bytes().to_vec());
        put((-1_i32).to_le_bytes().to_vec());
        put(1_i16.to_le_bytes().to_vec());
        put(0_i32.to_le_bytes().to_vec());
        bytes
    }

    fn ascii() -> String {
        HEADER.replace("FORMAT", "ascii") + "9 1 2 3\n8 -4 5e-1 6\n2 0 -1\n1 0\n"
    }

    #[test]
    fn all_three_encodings_give_the_graph() {
        for bytes in [ascii().into_bytes(), binary(false), binary(true)] {
            let wireframe = parse(&bytes).unwrap();
            let expected = [Vector3::new(1.0, 2.0, 3.0), Vector3::new(-4.0, 0.5, 6.0)];
            assert_eq!(wireframe.junctions, expected);
            assert_eq!(wireframe.edges, [[1, 0]]);
        }
    }

    #[test]
    fn bad_files_are_refused_with_a_reason() {
        for (from, to, reason) in [
            ("edge 1", "edge 2", "within its element `edge`"),
            (
                "element vertex 2",
                "element vertex 99999999999",
                "ends within",
            ),
            ("vertex2", "vertex3", "`vertex2`"),
            ("element edge", "element edges", "no element `edge`"),
            ("\n1 0\n", "\n-1 0\n", "negative"),
            ("\n1 0\n", "\n7 0\n", "junctions"),
            ("5e-1", "nan", "finite"),
            ("double", "decimal", "`decimal`"),
            ("end_header", "", "header"),
        ] {
            let text = ascii().replace(from, to);
            let error = parse_ply_edges(text.as_bytes(), Path::new("a.ply")).unwrap_err();
            let message = error.to_string();
            assert!(
                message.contains(reason) && message.contains("a.ply"),
                "{message}"
            );
        }
        let truncated = binary(false);
        assert!(parse(&truncated[..truncated.len() - 1]).is_err());
    }
}
