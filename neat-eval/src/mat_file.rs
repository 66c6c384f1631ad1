//! Numeric arrays in MAT-files of version 5 (MATLAB's `-v6` and `-v7`), as the
//! DTU data set keeps its observation masks and ground planes.
//!
//! Source: MathWorks, *MAT-File Format*, "Level 5". Only real numeric arrays are
//! read; cells, structures, text, sparse and complex arrays are passed over. No
//! size that a file claims is believed before the bytes are there.

use flate2::read::ZlibDecoder;
use neat_core::{SceneError, file};
use std::io::Read;
use std::path::Path;

/// What all variables of a file may unpack to, in bytes: DTU's masks take 64 MiB.
/// A limit for each would add up, since a kilobyte can unpack to a megabyte.
const MAX_UNPACKED_BYTES: u64 = 1 << 28;
const HEADER_BYTES: usize = 128;

/// A real array of numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct MatArray {
    /// Name of the variable.
    pub name: String,
    /// Length of each axis, at least two.
    pub shape: Vec<usize>,
    /// The elements: the first axis varies fastest.
    numbers: Numbers,
}

/// Elements as they lie in the file: a mask of bytes stays one byte per cell.
#[derive(Clone, Debug, PartialEq)]
struct Numbers {
    kind: Kind,
    byte_order: ByteOrder,
    bytes: Vec<u8>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ByteOrder {
    Little,
    Big,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Int8,
    Uint8,
    Int16,
    Uint16,
    Int32,
    Uint32,
    Single,
    Double,
    Int64,
    Uint64,
}

const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;

impl Kind {
    fn of(code: u32) -> Option<Self> {
        Some(match code {
            1 => Self::Int8,
            2 => Self::Uint8,
            3 => Self::Int16,
            4 => Self::Uint16,
            5 => Self::Int32,
            6 => Self::Uint32,
            7 => Self::Single,
            9 => Self::Double,
            12 => Self::Int64,
            13 => Self::Uint64,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::Int8 | Self::Uint8 => 1,
            Self::Int16 | Self::Uint16 => 2,
            Self::Int32 | Self::Uint32 | Self::Single => 4,
            Self::Double | Self::Int64 | Self::Uint64 => 8,
        }
    }
}

impl MatArray {
    /// Number of elements.
    pub fn len(&self) -> usize {
        self.shape.iter().product()
    }

    /// Whether there is no element.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The element at `index`, counted with the first axis fastest.
    ///
    /// # Panics
    /// If there is none.
    pub fn number(&self, index: usize) -> f64 {
        match self.numbers.kind {
            Kind::Int8 => i8::from_le_bytes(self.raw(index)).into(),
            Kind::Uint8 => u8::from_le_bytes(self.raw(index)).into(),
            Kind::Int16 => i16::from_le_bytes(self.raw(index)).into(),
            Kind::Uint16 => u16::from_le_bytes(self.raw(index)).into(),
            Kind::Int32 => i32::from_le_bytes(self.raw(index)).into(),
            Kind::Uint32 => u32::from_le_bytes(self.raw(index)).into(),
            Kind::Single => f32::from_le_bytes(self.raw(index)).into(),
            Kind::Double => f64::from_le_bytes(self.raw(index)),
            Kind::Int64 => i64::from_le_bytes(self.raw(index)) as f64,
            Kind::Uint64 => u64::from_le_bytes(self.raw(index)) as f64,
        }
    }

    /// The bytes of the element at `index`, the lowest first.
    fn raw<const N: usize>(&self, index: usize) -> [u8; N] {
        let mut raw = [0; N];
        raw.copy_from_slice(&self.numbers.bytes[index * N..][..N]);
        if self.numbers.byte_order == ByteOrder::Big {
            raw.reverse();
        }
        raw
    }

    /// All elements, the first axis fastest.
    pub fn numbers(&self) -> Vec<f64> {
        (0..self.len()).map(|index| self.number(index)).collect()
    }
}

/// Reads the real numeric arrays of a MAT-file, in the order of the file.
///
/// # Errors
/// If the file is missing (the message then gives `remedy`), empty, truncated, of
/// another version, or its variables unpack to too much.
pub fn read_mat(path: &Path, remedy: &str) -> Result<Vec<MatArray>, SceneError> {
    parse_mat(&file::read(path, remedy)?, path)
}

/// [`read_mat`] from bytes; `path` is for messages.
///
/// # Errors
/// As [`read_mat`].
pub fn parse_mat(bytes: &[u8], path: &Path) -> Result<Vec<MatArray>, SceneError> {
    parse(bytes).map_err(|reason| SceneError::Malformed {
        path: path.into(),
        reason,
    })
}

fn parse(bytes: &[u8]) -> Result<Vec<MatArray>, String> {
    let byte_order = match bytes.get(HEADER_BYTES - 4..HEADER_BYTES) {
        Some([0, 1, b'I', b'M']) => ByteOrder::Little,
        Some([1, 0, b'M', b'I']) => ByteOrder::Big,
        _ => {
            return Err(
                "it is not a MAT-file of version 5; save it again with MATLAB's -v7".into(),
            );
        }
    };
    let mut elements = Elements {
        rest: &bytes[HEADER_BYTES..],
        byte_order,
    };
    let mut arrays = Vec::new();
    let mut unpacked_bytes = 0;
    while let Some(element) = elements.next()? {
        match element.code {
            MATRIX => arrays.extend(matrix(element.data, byte_order)?),
            COMPRESSED => {
                let unpacked = unpack(element.data, MAX_UNPACKED_BYTES - unpacked_bytes)?;
                unpacked_bytes += unpacked.len() as u64;
                let mut inner = Elements {
                    rest: &unpacked,
                    byte_order,
                };
                while let Some(element) = inner.next()? {
                    if element.code == MATRIX {
                        arrays.extend(matrix(element.data, byte_order)?);
                    }
                }
            }
            _ => {}
        }
    }
    Ok(arrays)
}

/// Unpacks at most `room` bytes.
fn unpack(data: &[u8], room: u64) -> Result<Vec<u8>, String> {
    let mut unpacked = Vec::new();
    ZlibDecoder::new(data)
        .take(room + 1)
        .read_to_end(&mut unpacked)
        .map_err(|error| format!("a variable cannot be unpacked ({error})"))?;
    if unpacked.len() as u64 > room {
        return Err(format!(
            "its variables unpack to more than {MAX_UNPACKED_BYTES} bytes"
        ));
    }
    Ok(unpacked)
}

/// One tagged piece of a file.
struct Element<'a> {
    code: u32,
    data: &'a [u8],
}

/// The elements that follow each other in some bytes.
struct Elements<'a> {
    rest: &'a [u8],
    byte_order: ByteOrder,
}

impl<'a> Elements<'a> {
    fn next(&mut self) -> Result<Option<Element<'a>>, String> {
        let Some((tag, after)) = self.rest.split_first_chunk::<8>() else {
            return if self.rest.is_empty() {
                Ok(None)
            } else {
                Err("it is truncated".into())
            };
        };
        let word = |bytes: [u8; 4]| match self.byte_order {
            ByteOrder::Little => u32::from_le_bytes(bytes),
            ByteOrder::Big => u32::from_be_bytes(bytes),
        };
        let [a, b, c, d, e, f, g, h] = *tag;
        let first = word([a, b, c, d]);
        // Up to four bytes of data may lie in the tag itself; then the upper half
        // of its first word is their number.
        let small = (first >> 16) as usize;
        if small > 0 {
            let data = self.rest[4..8].get(..small);
            self.rest = after;
            return Ok(Some(Element {
                code: first & 0xffff,
                data: data.ok_or("a small element has more than four bytes")?,
            }));
        }
        let length = word([e, f, g, h]) as usize;
        let data = after.get(..length).ok_or("it is truncated")?;
        // Compressed elements are not padded, others are, to eight bytes.
        let padded = if first == COMPRESSED {
            length
        } else {
            length.next_multiple_of(8)
        };
        self.rest = after.get(padded..).unwrap_or_default();
        Ok(Some(Element { code: first, data }))
    }

    fn required(&mut self) -> Result<Element<'a>, String> {
        self.next()?.ok_or_else(|| "it is truncated".into())
    }
}

/// The array of a matrix element; `None` if it is not real and numeric.
fn matrix(data: &[u8], byte_order: ByteOrder) -> Result<Option<MatArray>, String> {
    let mut parts = Elements {
        rest: data,
        byte_order,
    };
    let flags = numbers_of(&parts.required()?, byte_order)?;
    let flags = flags.first().copied().unwrap_or_default() as u32;
    let (class, is_complex) = (flags & 0xff, flags & 0x800 != 0);
    // 6 to 15 are the numeric classes, from double to uint64.
    if !(6..=15).contains(&class) || is_complex {
        return Ok(None);
    }
    let shape: Vec<usize> = numbers_of(&parts.required()?, byte_order)?
        .into_iter()
        .map(|n| n.max(0.0) as usize)
        .collect();
    let name = String::from_utf8_lossy(parts.required()?.data).into_owned();
    let real = parts.required()?;
    let kind = Kind::of(real.code).ok_or_else(|| format!("`{name}` holds no numbers"))?;
    let len = shape
        .iter()
        .try_fold(1_usize, |product, n| product.checked_mul(*n));
    if shape.len() < 2 || len.and_then(|n| n.checked_mul(kind.bytes())) != Some(real.data.len()) {
        return Err(format!(
            "`{name}` of shape {shape:?} does not fit its {} bytes of data",
            real.data.len()
        ));
    }
    Ok(Some(MatArray {
        name,
        shape,
        numbers: Numbers {
            kind,
            byte_order,
            bytes: real.data.to_vec(),
        },
    }))
}

/// The numbers of a short element, such as flags and dimensions.
fn numbers_of(element: &Element<'_>, byte_order: ByteOrder) -> Result<Vec<f64>, String> {
    let kind = Kind::of(element.code).ok_or("an array has no flags or no dimensions")?;
    let array = MatArray {
        name: String::new(),
        shape: vec![element.data.len() / kind.bytes()],
        numbers: Numbers {
            kind,
            byte_order,
            bytes: element.data.to_vec(),
        },
    };
    Ok(array.numbers())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use flate2::Compression;
    use flate2::write::ZlibEncoder;
    use proptest::prelude::*;
    use std::io::Write;

    fn element(code: u32, data: &[u8]) -> Vec<u8> {
        let mut bytes = code.to_le_bytes().to_vec();
        bytes.extend((data.len() as u32).to_le_bytes());
        bytes.extend(data);
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        bytes
    }

    /// A matrix element as MATLAB writes it: `class` 6 is double, 9 uint8; `code`
    /// is the type of the stored numbers.
    pub(crate) fn matrix_element(
        name: &str,
        class: u8,
        shape: &[i32],
        code: u32,
        data: &[u8],
    ) -> Vec<u8> {
        let mut content = element(6, &[class, 0, 0, 0, 0, 0, 0, 0]);
        let shape: Vec<u8> = shape.iter().flat_map(|n| n.to_le_bytes()).collect();
        content.extend(element(5, &shape));
        if name.len() <= 4 {
            content.extend(1_u16.to_le_bytes());
            content.extend((name.len() as u16).to_le_bytes());
            let mut small = name.as_bytes().to_vec();
            small.resize(4, 0);
            content.extend(small);
        } else {
            content.extend(element(1, name.as_bytes()));
        }
        content.extend(element(code, data));
        element(MATRIX, &content)
    }

    pub(crate) fn compressed(matrix: &[u8]) -> Vec<u8> {
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
        encoder.write_all(matrix).unwrap();
        let packed = encoder.finish().unwrap();
        let mut bytes = COMPRESSED.to_le_bytes().to_vec();
        bytes.extend((packed.len() as u32).to_le_bytes());
        bytes.extend(packed);
        bytes
    }

    pub(crate) fn mat_file(elements: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = vec![b' '; 124];
        bytes.extend([0, 1, b'I', b'M']);
        bytes.extend(elements.concat());
        bytes
    }

    fn small_file() -> Vec<u8> {
        let doubles: Vec<u8> = [1.5_f64, -2.0, 3.0, 4.0]
            .iter()
            .flat_map(|x| x.to_le_bytes())
            .collect();
        mat_file(&[
            compressed(&matrix_element("ObsMask", 9, &[2, 1, 2], 2, &[1, 0, 0, 1])),
            matrix_element("P", 6, &[4, 1], 9, &doubles),
            matrix_element("text", 4, &[1, 2], 4, &[65, 0, 66, 0]),
            // MATLAB stores doubles that are small integers as bytes.
            compressed(&matrix_element("Res", 6, &[1, 1], 2, &[1])),
        ])
    }

    #[test]
    fn numeric_arrays_are_read_packed_or_not() {
        let arrays = parse(&small_file()).unwrap();
        let names: Vec<&str> = arrays.iter().map(|a| a.name.as_str()).collect();
        assert_eq!(names, ["ObsMask", "P", "Res"]);
        assert_eq!(arrays[0].shape, [2, 1, 2]);
        assert_eq!(arrays[0].numbers(), [1.0, 0.0, 0.0, 1.0]);
        assert_eq!(arrays[1].numbers(), [1.5, -2.0, 3.0, 4.0]);
        assert_eq!(arrays[2].numbers(), [1.0]);
    }

    #[test]
    fn other_files_are_refused_with_a_reason() {
        let message = |bytes: &[u8]| {
            parse_mat(bytes, Path::new("ObsMask24_10.mat"))
                .unwrap_err()
                .to_string()
        };
        assert!(message(b"MATLAB 7.3 MAT-file").contains("-v7"));
        let whole = small_file();
        assert!(message(&whole[..whole.len() - 9]).contains("ObsMask24_10.mat"));
        let short = mat_file(&[matrix_element("P", 6, &[4, 1], 9, &[0; 24])]);
        assert!(message(&short).contains("24 bytes"));
        let huge = mat_file(&[matrix_element("P", 6, &[i32::MAX; 3], 9, &[0; 24])]);
        assert!(message(&huge).contains("does not fit"));
    }

    #[test]
    fn variables_that_add_up_to_too_much_are_refused() {
        let zeros = vec![0; 1 << 26];
        // Text, which is unpacked and passed over.
        let variable = compressed(&matrix_element("A", 4, &[1 << 26, 1], 2, &zeros));
        let file = |count: usize| mat_file(&vec![variable.clone(); count]);
        assert_eq!(parse(&file(1)).unwrap(), []);
        let bomb = file(4);
        assert!(bomb.len() < 1 << 19, "a bomb is small");
        let error = parse(&bomb).unwrap_err();
        assert!(error.contains("variables unpack to more"), "{error}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        #[test]
        fn damaged_and_truncated_files_do_not_panic(
            changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
            end: prop::sample::Index,
        ) {
            let mut file = small_file();
            for (at, byte) in changes {
                let at = at.index(file.len());
                file[at] = byte;
            }
            file.truncate(HEADER_BYTES + end.index(file.len() - HEADER_BYTES));
            if let Ok(arrays) = parse(&file) {
                for array in arrays {
                    prop_assert_eq!(array.numbers().len(), array.len());
                }
            }
        }
    }
}
