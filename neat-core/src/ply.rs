//! PLY files: elements of named numbers, as text or in either binary form.
//!
//! Elements and their properties may come in any order, and lists are passed over.
//! No number of a file is believed before its bytes are there.

use crate::{SceneError, file};
use nalgebra::Vector3;
use std::path::Path;

/// A PLY file of which the header has been read.
pub struct Ply<'a> {
    path: &'a Path,
    encoding: Encoding,
    elements: Vec<Element>,
    /// What follows the header.
    body: &'a [u8],
}

/// How the numbers after the header are written.
#[derive(Clone, Copy)]
enum Encoding {
    Text,
    LittleEndian,
    BigEndian,
}

struct Element {
    name: String,
    rows: u64,
    properties: Vec<Property>,
}

enum Property {
    Scalar {
        name: String,
        of: Scalar,
    },
    List {
        name: String,
        count: Scalar,
        of: Scalar,
    },
}

/// A number type and its bytes.
#[derive(Clone, Copy)]
enum Scalar {
    Signed(usize),
    Unsigned(usize),
    Float(usize),
}

/// A header line longer than this is none.
const MAX_LINE_BYTES: usize = 4096;

/// Reads the vertex positions of a PLY file.
///
/// # Errors
/// If the file is missing, empty, truncated or no PLY file, its vertices lack x, y or
/// z, or one of these is not finite.
pub fn read_points(path: &Path) -> Result<Vec<Vector3<f64>>, SceneError> {
    parse_points(&file::read(path, "give a point cloud as a PLY file")?, path)
}

/// [`read_points`] from bytes; `path` is for messages.
///
/// # Errors
/// As [`read_points`].
pub fn parse_points(bytes: &[u8], path: &Path) -> Result<Vec<Vector3<f64>>, SceneError> {
    let rows = Ply::parse(bytes, path)?.columns("vertex", ["x", "y", "z"])?;
    Ok(rows.into_iter().map(Vector3::from).collect())
}

/// Writes points and their colours as a PLY file: binary, little-endian, with
/// `double` x, y, z and `uchar` red, green, blue.
///
/// # Errors
/// If the file cannot be written.
pub fn write_points(path: &Path, points: &[(Vector3<f64>, [u8; 3])]) -> Result<(), SceneError> {
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\n\
         property double x\nproperty double y\nproperty double z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
        points.len()
    )
    .into_bytes();
    for (point, color) in points {
        bytes.extend(point.iter().flat_map(|coordinate| coordinate.to_le_bytes()));
        bytes.extend(color);
    }
    file::write_atomically(path, &bytes)
}

impl<'a> Ply<'a> {
    /// Reads the header of a file; `path` is for messages.
    ///
    /// # Errors
    /// If the bytes do not start with the header of a PLY file.
    pub fn parse(bytes: &'a [u8], path: &'a Path) -> Result<Self, SceneError> {
        parse_header(bytes, path).map_err(|reason| SceneError::malformed(path, reason))
    }

    /// The properties `names` of an element, row by row.
    ///
    /// # Errors
    /// If there is no such element or property, the file ends early, or one of these
    /// numbers is not finite.
    pub fn columns<const N: usize>(
        &self,
        element: &str,
        names: [&str; N],
    ) -> Result<Vec<[f64; N]>, SceneError> {
        self.read_columns(element, names)
            .map_err(|reason| SceneError::malformed(self.path, reason))
    }

    /// Shows the list of an element that has one of `names`, row by row; what `visit`
    /// says against a row is the reason why the file is refused.
    ///
    /// # Errors
    /// If there is no such element or list, the file ends early, or `visit` refuses a row.
    pub fn lists(
        &self,
        element: &str,
        names: &[&str],
        visit: impl FnMut(&[f64]) -> Result<(), String>,
    ) -> Result<(), SceneError> {
        self.read_lists(element, names, visit)
            .map_err(|reason| SceneError::malformed(self.path, reason))
    }

    fn read_columns<const N: usize>(
        &self,
        wanted: &str,
        names: [&str; N],
    ) -> Result<Vec<[f64; N]>, String> {
        let (element, mut body) = self.body_of(wanted)?;
        body.rows(element, names)
    }

    fn read_lists(
        &self,
        wanted: &str,
        names: &[&str],
        mut visit: impl FnMut(&[f64]) -> Result<(), String>,
    ) -> Result<(), String> {
        let (element, mut body) = self.body_of(wanted)?;
        let is_named = |property: &Property| match property {
            Property::List { name, .. } => names.contains(&name.as_str()),
            Property::Scalar { .. } => false,
        };
        let at = (element.properties.iter().position(is_named)).ok_or_else(|| {
            format!(
                "its element `{wanted}` has no list `{}`",
                names.join("` or `")
            )
        })?;
        let mut list = Vec::new();
        for index in 0..element.rows {
            list.clear();
            body.row::<0>(&element.properties, &[], Some((at, &mut list)))
                .map_err(|reason| element.in_row(reason, index))?;
            visit(&list).map_err(|reason| format!("its {wanted} {index} {reason}"))?;
        }
        Ok(())
    }

    /// An element, and the numbers from its first row on.
    fn body_of(&self, wanted: &str) -> Result<(&Element, Body<'_>), String> {
        let is_wanted = |element: &Element| element.name == wanted;
        let at = (self.elements.iter().position(is_wanted))
            .ok_or_else(|| format!("it has no element `{wanted}`"))?;
        let mut body = Body {
            encoding: self.encoding,
            rest: self.body,
            row: &[],
        };
        for element in &self.elements[..at] {
            body.rows(element, [])?;
        }
        Ok((&self.elements[at], body))
    }
}

impl Element {
    /// A reason with the row that it is about.
    fn in_row(&self, reason: String, index: u64) -> String {
        format!("{reason} `{}`, in row {index} of {}", self.name, self.rows)
    }
}

impl Scalar {
    fn named(name: &str) -> Result<Self, String> {
        Ok(match name {
            "char" | "int8" => Self::Signed(1),
            "uchar" | "uint8" => Self::Unsigned(1),
            "short" | "int16" => Self::Signed(2),
            "ushort" | "uint16" => Self::Unsigned(2),
            "int" | "int32" => Self::Signed(4),
            "uint" | "uint32" => Self::Unsigned(4),
            "float" | "float32" => Self::Float(4),
            "double" | "float64" => Self::Float(8),
            _ => return Err(format!("no type is called `{name}`")),
        })
    }

    /// The number in `word`, whose low bytes it fills.
    fn number(self, word: u64) -> f64 {
        match self {
            Self::Float(4) => f64::from(f32::from_bits(word as u32)),
            Self::Float(_) => f64::from_bits(word),
            Self::Unsigned(_) => word as f64,
            Self::Signed(bytes) => {
                let unused = 64 - 8 * bytes as u32;
                ((word << unused).cast_signed() >> unused) as f64
            }
        }
    }
}

fn parse_header<'a>(bytes: &'a [u8], path: &'a Path) -> Result<Ply<'a>, String> {
    let mut body = bytes;
    let mut next_line = || {
        let (line, rest) = split_line(body, MAX_LINE_BYTES)?;
        body = rest;
        std::str::from_utf8(line).ok().map(str::trim)
    };
    if next_line() != Some("ply") {
        return Err("it does not start with the line `ply`".into());
    }
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    loop {
        let line = next_line().ok_or("its header does not end")?;
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            [] | ["comment" | "obj_info", ..] => {}
            ["end_header"] => break,
            ["format", name, _] => {
                encoding = Some(match name {
                    "ascii" => Encoding::Text,
                    "binary_little_endian" => Encoding::LittleEndian,
                    "binary_big_endian" => Encoding::BigEndian,
                    _ => return Err(format!("its format `{name}` is unknown")),
                });
            }
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
                    ["list", count, of, name] => Property::List {
                        name: name.into(),
                        count: Scalar::named(count)?,
                        of: Scalar::named(of)?,
                    },
                    [of, name] => Property::Scalar {
                        name: name.into(),
                        of: Scalar::named(of)?,
                    },
                    _ => return Err(format!("its header has the line `{line}`")),
                });
            }
            _ => return Err(format!("its header has the line `{line}`")),
        }
    }
    Ok(Ply {
        path,
        encoding: encoding.ok_or("its header names no format")?,
        elements,
        body,
    })
}

/// The bytes before the first line break, and those behind it.
fn split_line(bytes: &[u8], longest: usize) -> Option<(&[u8], &[u8])> {
    let end = bytes.iter().take(longest).position(|&b| b == b'\n')?;
    Some((&bytes[..end], &bytes[end + 1..]))
}

/// The numbers of a file that have not been read.
struct Body<'a> {
    encoding: Encoding,
    rest: &'a [u8],
    /// Of text: what is left of the line.
    row: &'a [u8],
}

impl Body<'_> {
    /// Reads all rows of an element, and keeps the properties `names`.
    fn rows<const N: usize>(
        &mut self,
        element: &Element,
        names: [&str; N],
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
        let mut rows = Vec::new();
        // A row of nothing takes no bytes: there could be as many as one likes.
        let count = if columns.is_empty() { 0 } else { element.rows };
        for index in 0..count {
            let row = (self.row(&element.properties, &columns, None))
                .map_err(|reason| element.in_row(reason, index))?;
            if let Some(bad) = row.iter().position(|number| !number.is_finite()) {
                let (name, wanted) = (&element.name, names[bad]);
                return Err(format!(
                    "`{wanted}` of its {name} {index} is {}, which is not finite",
                    row[bad]
                ));
            }
            rows.push(row);
        }
        Ok(rows)
    }

    /// One row; of a property of column `i` the number is its `i`-th element. The
    /// numbers of the property that `list` names are added to the vector beside it.
    fn row<const N: usize>(
        &mut self,
        properties: &[Property],
        columns: &[Option<usize>],
        mut list: Option<(usize, &mut Vec<f64>)>,
    ) -> Result<[f64; N], String> {
        self.start_row()?;
        let mut row = [0.0; N];
        for (index, property) in properties.iter().enumerate() {
            match property {
                Property::Scalar { of, .. } => {
                    let number = self.number(*of)?;
                    if let Some(Some(column)) = columns.get(index) {
                        row[*column] = number;
                    }
                }
                Property::List { count, of, .. } => {
                    for _ in 0..self.number(*count)? as u64 {
                        let number = self.number(*of)?;
                        if let Some((_, numbers)) = list.as_mut().filter(|(at, _)| *at == index) {
                            numbers.push(number);
                        }
                    }
                }
            }
        }
        if self.row.iter().all(u8::is_ascii_whitespace) {
            Ok(row)
        } else {
            Err("too many numbers are in its element".into())
        }
    }

    /// Each row of text has a line of its own; lines of nothing do not count.
    fn start_row(&mut self) -> Result<(), String> {
        if !matches!(self.encoding, Encoding::Text) {
            return Ok(());
        }
        self.rest = self.rest.trim_ascii_start();
        if self.rest.is_empty() {
            return Err(ENDS.into());
        }
        (self.row, self.rest) = split_line(self.rest, usize::MAX).unwrap_or((self.rest, &[]));
        Ok(())
    }

    fn number(&mut self, of: Scalar) -> Result<f64, String> {
        let (Scalar::Signed(bytes) | Scalar::Unsigned(bytes) | Scalar::Float(bytes)) = of;
        if matches!(self.encoding, Encoding::Text) {
            let row = self.row.trim_ascii_start();
            let end = row.iter().position(u8::is_ascii_whitespace);
            let (word, rest) = row.split_at(end.unwrap_or(row.len()));
            self.row = rest;
            if word.is_empty() {
                return Err("too few numbers are in its element".into());
            }
            let word = String::from_utf8_lossy(word);
            return word
                .parse()
                .map_err(|_| format!("`{word}` stands for a number in its element"));
        }
        let (raw, rest) = self.rest.split_at_checked(bytes).ok_or(ENDS)?;
        self.rest = rest;
        let mut word = [0; 8];
        word[..bytes].copy_from_slice(raw);
        if matches!(self.encoding, Encoding::BigEndian) {
            word[..bytes].reverse();
        }
        Ok(of.number(u64::from_le_bytes(word)))
    }
}

const ENDS: &str = "it ends within its element";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mutation::{CASES, damaged};
    use proptest::prelude::*;

    const HEADER: &str = "ply\nformat FORMAT 1.0\ncomment any\nelement vertex 2\n\
        property uchar red\nproperty float x\nproperty double y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_indices\n\
        element edge 1\nproperty short vertex1\nproperty int vertex2\nend_header\n";
    const POINTS: [[f64; 3]; 2] = [[1.0, 2.0, 3.0], [-4.0, 0.5, 6.0]];

    fn binary(big: bool) -> Vec<u8> {
        let order = if big { "big" } else { "little" };
        let format = format!("binary_{order}_endian");
        let mut bytes = HEADER.replace("FORMAT", &format).into_bytes();
        let mut put = |mut raw: Vec<u8>| {
            if big {
                raw.reverse();
            }
            bytes.extend(raw);
        };
        for [x, y, z] in POINTS {
            put(vec![200]);
            put((x as f32).to_le_bytes().to_vec());
            put(y.to_le_bytes().to_vec());
            put((z as f32).to_le_bytes().to_vec());
        }
        put(vec![2]);
        put(0_i32.to_le_bytes().to_vec());
        put((-1_i32).to_le_bytes().to_vec());
        put(1_i16.to_le_bytes().to_vec());
        put((-2_i32).to_le_bytes().to_vec());
        bytes
    }

    fn text() -> String {
        HEADER.replace("FORMAT", "ascii") + "9 1 2 3\n\n8 -4 5e-1 6\r\n2 0 -1\n1 -2\n"
    }

    fn parse(bytes: &[u8]) -> Result<Vec<Vector3<f64>>, SceneError> {
        parse_points(bytes, Path::new("scan.ply"))
    }

    fn edges(bytes: &[u8]) -> Result<Vec<[f64; 2]>, SceneError> {
        Ply::parse(bytes, Path::new("scan.ply"))?.columns("edge", ["vertex1", "vertex2"])
    }

    #[test]
    fn all_three_encodings_give_the_numbers() {
        for bytes in [text().into_bytes(), binary(false), binary(true)] {
            assert_eq!(parse(&bytes).unwrap(), POINTS.map(Vector3::from));
            assert_eq!(edges(&bytes).unwrap(), [[1.0, -2.0]]);
        }
    }

    #[test]
    fn properties_and_elements_may_come_in_any_order() {
        let text = "ply\nelement face 1\nproperty list int short any\nproperty char last\n\
            element empty 99999999999\nelement vertex 1\nproperty int z\nproperty uint x\n\
            property short y\nformat ascii 1.0\nend_header\n3 7 8 9 0\n-3 1 2";
        assert_eq!(
            parse(text.as_bytes()).unwrap(),
            [Vector3::new(1.0, 2.0, -3.0)]
        );
    }

    #[test]
    fn lists_are_shown_row_by_row() {
        for bytes in [text().into_bytes(), binary(false), binary(true)] {
            let ply = Ply::parse(&bytes, Path::new("scan.ply")).unwrap();
            let mut lists = Vec::new();
            let mut read = |names: &[&str]| {
                ply.lists("face", names, |list| {
                    lists.push(list.to_vec());
                    (lists.len() < 2)
                        .then_some(())
                        .ok_or("is one too many".into())
                })
            };
            read(&["vertex_index", "vertex_indices"]).unwrap();
            let message = read(&["vertex_indices"]).unwrap_err().to_string();
            assert!(message.contains("its face 0 is one too many"), "{message}");
            let message = read(&["x", "y"]).unwrap_err().to_string();
            assert!(message.contains("no list `x` or `y`"), "{message}");
            assert_eq!(lists, [[0.0, -1.0], [0.0, -1.0]]);
        }
    }

    #[test]
    fn what_is_written_reads_back() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("points.ply");
        let points = [Vector3::new(1.0 / 3.0, -2e9, 0.1), Vector3::zeros()];
        write_points(&path, &[(points[0], [10, 13, 255]), (points[1], [0; 3])]).unwrap();
        assert_eq!(read_points(&path).unwrap(), points);
    }

    #[test]
    fn bad_files_are_refused_with_a_reason() {
        for (from, to, reason) in [
            ("vertex 2", "vertex 4", "too few numbers"),
            (
                "vertex 2",
                "vertex 99999999999999",
                "row 2 of 99999999999999",
            ),
            (
                "vertex 2",
                "vertex 9999999999999999999999",
                "no number of rows",
            ),
            ("vertex 2", "vertex -1", "no number of rows"),
            (
                "edge 1",
                "edge 2",
                "ends within its element `edge`, in row 1 of 2",
            ),
            ("ascii", "binary_middle_endian", "`binary_middle_endian`"),
            ("float z", "float w", "`z`"),
            ("vertex2", "vertex3", "`vertex2`"),
            ("element vertex", "element edge", "no element `vertex`"),
            ("5e-1", "nan", "`y` of its vertex 1 is NaN"),
            ("5e-1", "x", "`x` stands for a number"),
            ("8 -4 5e-1 6", "8 -4 5e-1 6 7", "too many numbers"),
            ("double", "decimal", "`decimal`"),
            ("end_header", "", "its header has the line"),
            ("ply\n", "off\n", "start"),
        ] {
            let text = text().replace(from, to);
            let result = parse(text.as_bytes()).and_then(|_| edges(text.as_bytes()));
            let message = result.unwrap_err().to_string();
            assert!(message.contains(reason), "{message}");
            assert!(message.contains("scan.ply"), "{message}");
        }
    }

    #[test]
    fn binary_files_that_claim_more_than_they_hold_are_refused() {
        for count in ["99999999999999", "9999999999999999999"] {
            let header = HEADER.replace("FORMAT", "binary_little_endian");
            let header = header.replace("vertex 2", &format!("vertex {count}"));
            let message = parse(header.as_bytes()).unwrap_err().to_string();
            assert!(message.contains("ends within"), "{message}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(CASES))]
        #[test]
        fn truncated_and_damaged_files_do_not_panic(
            bytes in prop::collection::vec(any::<u8>(), 0..300), cut in 1usize..49,
            damaged in [damaged(text().into_bytes()), damaged(binary(false)), damaged(binary(true))],
        ) {
            prop_assert!(parse(&bytes).is_err());
            for file in damaged {
                if let Ok(points) = parse(&file) {
                    prop_assert!(points.len() <= file.len());
                }
                let _ = edges(&file);
            }
            let whole = binary(false);
            prop_assert!(edges(&whole[..whole.len() - cut]).is_err());
        }
    }
}
