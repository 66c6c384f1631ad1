//! NumPy arrays of floats in `.npz` archives.
//!
//! Only what camera files need: `f4` and `f8` of either byte order, C and
//! Fortran order. Archives are read into memory, and no size that a file claims
//! is believed before the bytes are there.

use crate::{SceneError, file};
use npyz::WriterBuilder;
use std::collections::BTreeMap;
use std::io::{self, Cursor, Read, Write};
use std::path::{Path, PathBuf};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

/// The largest array that is read, in bytes of its `.npy` file.
const MAX_ARRAY_BYTES: u64 = 1 << 26;
/// The longest `.npy` header that is read; NumPy writes 128 bytes.
const MAX_HEADER_BYTES: usize = 4096;
/// With so few digits the product of the header's numbers fits in 64 bits.
const MAX_HEADER_DIGITS: usize = 18;
/// A dictionary with a tuple, and a record type, which is refused by its name. More opening brackets
/// are no array, and the parser takes twice as long or more for each that is nested.
const MAX_HEADER_BRACKETS: usize = 4;

/// A dense array of floats.
#[derive(Clone, Debug, PartialEq)]
pub struct NpyArray {
    /// Length of each axis.
    pub shape: Vec<usize>,
    /// The elements in C order: the last axis varies fastest.
    pub values: Vec<f64>,
}

/// A dense array of integers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NpyIntegers {
    /// Length of each axis.
    pub shape: Vec<usize>,
    /// The elements in C order.
    pub values: Vec<i64>,
}

/// An `.npz` archive held in memory.
pub struct NpzReader {
    path: PathBuf,
    archive: ZipArchive<Cursor<Vec<u8>>>,
}

impl NpzReader {
    /// Reads the archive at `path`.
    ///
    /// # Errors
    /// If it is missing (the message then gives `remedy`), empty, or no zip
    /// archive.
    pub fn open(path: &Path, remedy: &str) -> Result<Self, SceneError> {
        Self::from_bytes(file::read(path, remedy)?, path)
    }

    /// From the bytes of an archive; `path` is for messages.
    ///
    /// # Errors
    /// If the bytes are no zip archive.
    pub fn from_bytes(bytes: Vec<u8>, path: &Path) -> Result<Self, SceneError> {
        let archive = ZipArchive::new(Cursor::new(bytes)).map_err(|error| {
            SceneError::malformed(
                path,
                format!("it is not an npz archive or is truncated ({error})"),
            )
        })?;
        Ok(Self {
            path: path.into(),
            archive,
        })
    }

    /// Whether the archive holds an array of this name.
    pub fn contains(&self, name: &str) -> bool {
        self.archive
            .index_for_name(&npyz::npz::file_name_from_array_name(name))
            .is_some()
    }

    /// Reads an array.
    ///
    /// # Errors
    /// If there is none of this name, it is not of floats, its data are
    /// truncated or too large, or an element is NaN or infinite.
    pub fn array(&mut self, name: &str) -> Result<NpyArray, SceneError> {
        let path = self.path.join(name);
        let mut bytes = Vec::new();
        self.archive
            .by_name(&npyz::npz::file_name_from_array_name(name))
            .map_err(io::Error::from)
            .and_then(|entry| entry.take(MAX_ARRAY_BYTES + 1).read_to_end(&mut bytes))
            .map_err(|error| {
                SceneError::malformed(&path, format!("the array cannot be unpacked ({error})"))
            })?;
        if bytes.len() as u64 > MAX_ARRAY_BYTES {
            return Err(SceneError::TooLarge {
                path,
                limit: MAX_ARRAY_BYTES,
            });
        }
        parse_npy(&bytes, &path)
    }
}

/// Parses the bytes of a `.npy` file; `path` is for messages.
///
/// # Errors
/// As [`NpzReader::array`].
pub fn parse_npy(bytes: &[u8], path: &Path) -> Result<NpyArray, SceneError> {
    check_header(bytes).map_err(|reason| SceneError::malformed(path, reason))?;
    let mut data = bytes;
    let header = npyz::NpyHeader::from_reader(&mut data).map_err(|error| {
        SceneError::malformed(path, format!("its header is not valid ({error})"))
    })?;

    let dtype = header.dtype().descr();
    let element_bytes = match dtype.trim_matches('\'') {
        "<f4" | ">f4" => 4,
        "<f8" | ">f8" => 8,
        _ => {
            return Err(SceneError::malformed(
                path,
                format!("elements of type {dtype} are not floats of 4 or 8 bytes"),
            ));
        }
    };
    let shape: Vec<usize> = header.shape().iter().map(|&n| n as usize).collect();
    let len: usize = shape.iter().product();
    if len.checked_mul(element_bytes) != Some(data.len()) {
        return Err(SceneError::malformed(
            path,
            format!(
                "shape {shape:?} of {dtype} does not fit its {} bytes of data",
                data.len()
            ),
        ));
    }

    let order = header.order();
    let values = read_values(npyz::NpyFile::with_header(header, data), element_bytes)
        .map_err(|error| SceneError::malformed(path, error.to_string()))?;
    let values = match order {
        npyz::Order::C => values,
        npyz::Order::Fortran => c_order_from_fortran(&shape, &values),
    };
    match values.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(SceneError::NotFinite {
            path: path.into(),
            element: format!("element {index} (in C order)"),
            value: values[index],
        }),
        None => Ok(NpyArray { shape, values }),
    }
}

/// Writes arrays as `f8` in C order, not compressed, the same bytes every time.
///
/// # Errors
/// If the file cannot be written, or a shape does not fit its values.
pub fn write_npz(path: &Path, arrays: &BTreeMap<&str, NpyArray>) -> Result<(), SceneError> {
    write_npz_with_integers(path, arrays, &BTreeMap::new())
}

/// [`write_npz`], with arrays of integers, as `i8`, after those of floats.
///
/// # Errors
/// As [`write_npz`].
pub fn write_npz_with_integers(
    path: &Path,
    floats: &BTreeMap<&str, NpyArray>,
    integers: &BTreeMap<&str, NpyIntegers>,
) -> Result<(), SceneError> {
    let bytes =
        archive_bytes(floats, integers).map_err(|source| SceneError::write(path, source))?;
    file::write_atomically(path, &bytes)
}

/// [`write_npz`] to memory.
#[cfg(test)]
pub(crate) fn npz_bytes(arrays: &BTreeMap<&str, NpyArray>) -> io::Result<Vec<u8>> {
    archive_bytes(arrays, &BTreeMap::new())
}

fn archive_bytes(
    floats: &BTreeMap<&str, NpyArray>,
    integers: &BTreeMap<&str, NpyIntegers>,
) -> io::Result<Vec<u8>> {
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let mut write = |name: &str, array: io::Result<Vec<u8>>| {
        archive.start_file(npyz::npz::file_name_from_array_name(name), options)?;
        archive.write_all(&array?)
    };
    for (name, array) in floats {
        write(name, npy_bytes(&array.shape, &array.values))?;
    }
    for (name, array) in integers {
        write(name, npy_bytes(&array.shape, &array.values))?;
    }
    Ok(archive.finish()?.into_inner())
}

fn npy_bytes<T: npyz::AutoSerialize + Copy>(shape: &[usize], values: &[T]) -> io::Result<Vec<u8>> {
    let shape: Vec<u64> = shape.iter().map(|&n| n as u64).collect();
    let mut bytes = Vec::new();
    let mut writer = npyz::WriteOptions::new()
        .default_dtype()
        .shape(&shape)
        .writer(&mut bytes)
        .begin_nd()?;
    writer.extend(values.iter().copied())?;
    writer.finish()?;
    Ok(bytes)
}

/// Refuses headers that could make the header parser allocate, overflow or
/// recurse beyond reason.
fn check_header(bytes: &[u8]) -> Result<(), String> {
    let (start, len) = match *bytes {
        [0x93, b'N', b'U', b'M', b'P', b'Y', 1, _, a, b, ..] => {
            (10, usize::from(u16::from_le_bytes([a, b])))
        }
        [0x93, b'N', b'U', b'M', b'P', b'Y', 2 | 3, _, a, b, c, d, ..] => {
            (12, u32::from_le_bytes([a, b, c, d]) as usize)
        }
        _ => return Err("it does not start as a .npy array does".into()),
    };
    if len > MAX_HEADER_BYTES {
        return Err(format!("its header claims {len} bytes"));
    }
    let header = bytes
        .get(start..start + len)
        .ok_or("its header is truncated")?;
    let digits = header.iter().filter(|c| c.is_ascii_digit()).count();
    let brackets = header.iter().filter(|c| b"([{".contains(c)).count();
    if digits > MAX_HEADER_DIGITS || brackets > MAX_HEADER_BRACKETS {
        return Err("its header does not describe a plain array of sensible size".into());
    }
    Ok(())
}

fn read_values<R: Read>(npy: npyz::NpyFile<R>, element_bytes: usize) -> io::Result<Vec<f64>> {
    if element_bytes == 8 {
        return npy.into_vec::<f64>();
    }
    Ok(npy.into_vec::<f32>()?.into_iter().map(f64::from).collect())
}

/// Reorders `values` from "first axis varies fastest" to "last axis varies
/// fastest".
fn c_order_from_fortran(shape: &[usize], values: &[f64]) -> Vec<f64> {
    let mut index = vec![0; shape.len()];
    let mut reordered = Vec::with_capacity(values.len());
    for _ in 0..values.len() {
        let offset = index
            .iter()
            .zip(shape)
            .rev()
            .fold(0, |offset, (&i, &n)| offset * n + i);
        reordered.push(values[offset]);
        for (i, &n) in index.iter_mut().zip(shape).rev() {
            *i += 1;
            if *i < n {
                break;
            }
            *i = 0;
        }
    }
    reordered
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mutation::{CASES, damaged};
    use proptest::prelude::*;

    /// The bytes of a `.npy` file as NumPy writes it.
    fn npy(descr: &str, fortran: bool, shape: &str, data: &[u8]) -> Vec<u8> {
        let fortran = if fortran { "True" } else { "False" };
        let header =
            format!("{{'descr': {descr}, 'fortran_order': {fortran}, 'shape': {shape}, }}\n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    fn f32_bytes(values: &[f32]) -> Vec<u8> {
        values.iter().flat_map(|v| v.to_le_bytes()).collect()
    }

    fn parse(bytes: &[u8]) -> Result<NpyArray, SceneError> {
        parse_npy(bytes, Path::new("cameras.npz/a"))
    }

    #[test]
    fn both_orders_and_both_byte_orders_are_read() {
        let expected = NpyArray {
            shape: vec![2, 3],
            values: vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0],
        };
        let c = f32_bytes(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(parse(&npy("'<f4'", false, "(2, 3)", &c)).unwrap(), expected);
        let fortran = f32_bytes(&[0.0, 3.0, 1.0, 4.0, 2.0, 5.0]);
        assert_eq!(
            parse(&npy("'<f4'", true, "(2, 3)", &fortran)).unwrap(),
            expected
        );
        let big: Vec<u8> = expected
            .values
            .iter()
            .flat_map(|v| v.to_be_bytes())
            .collect();
        assert_eq!(
            parse(&npy("'>f8'", false, "(2, 3)", &big)).unwrap(),
            expected
        );
    }

    #[test]
    fn fortran_order_of_three_axes() {
        // Element (i, j, k) is 100 i + 10 j + k.
        let mut fortran = Vec::new();
        let mut c = Vec::new();
        for a in 0..2 {
            for b in 0..3 {
                for d in 0..4 {
                    c.push((100 * a + 10 * b + d) as f64);
                }
            }
        }
        for d in 0..4 {
            for b in 0..3 {
                for a in 0..2 {
                    fortran.push((100 * a + 10 * b + d) as f64);
                }
            }
        }
        assert_eq!(c_order_from_fortran(&[2, 3, 4], &fortran), c);
    }

    #[test]
    fn what_is_not_a_float_array_is_refused_with_a_reason() {
        let data = [0; 16];
        let cases = [
            (npy("'|O'", false, "(2,)", &data), "not floats"),
            (npy("'<i8'", false, "(2,)", &data), "not floats"),
            (npy("[('x', '<f8')]", false, "(2,)", &data), "not floats"),
            (npy("'<f8'", false, "(3,)", &data), "does not fit"),
            (
                npy("'<f8'", false, "(99999999, 99999999)", &data),
                "does not fit",
            ),
            (
                npy("'<f8'", false, "(9999999999, 9999999999)", &data),
                "sensible",
            ),
            (npy("'<f8'", false, &"(".repeat(900), &data), "sensible"),
            (npy("'<f4'", false, "(1,)", &f32_bytes(&[f32::NAN])), "NaN"),
            (b"\x93NUMPY\x02\x00\xff\xff\xff\xff".to_vec(), "claims"),
            (b"PK".to_vec(), "start"),
        ];
        for (bytes, reason) in cases {
            let message = parse(&bytes).unwrap_err().to_string();
            assert!(message.contains(reason), "{message}");
            assert!(message.contains("cameras.npz/a"), "{message}");
        }
    }

    fn small_archive() -> Vec<u8> {
        let array = NpyArray {
            shape: vec![2, 2],
            values: vec![1.0, -2.5, 1e-300, 4.0],
        };
        npz_bytes(&BTreeMap::from([("a", array)])).unwrap()
    }

    /// Reads the array of [`small_archive`] from damaged bytes.
    fn read_a(bytes: &[u8]) -> Result<NpyArray, SceneError> {
        NpzReader::from_bytes(bytes.to_vec(), Path::new("cameras.npz"))?.array("a")
    }

    #[test]
    fn archives_that_unpack_to_too_much_are_refused() {
        let deflated = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
        let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
        archive.start_file("a.npy", deflated).unwrap();
        for _ in 0..=MAX_ARRAY_BYTES >> 20 {
            archive.write_all(&[0; 1 << 20]).unwrap();
        }
        let bytes = archive.finish().unwrap().into_inner();
        assert!(bytes.len() < 1 << 18, "a bomb is small");
        assert!(matches!(read_a(&bytes), Err(SceneError::TooLarge { .. })));
    }

    #[test]
    fn nested_headers_are_refused_before_they_are_parsed() {
        // Each bracket more takes the parser twice as long or more: of 16 nobody has seen the end.
        let mut bytes = b"\x93NUMPY\x01\x00\x40\x00".to_vec();
        bytes.extend([b'{'; 64]);
        let message = parse(&bytes).unwrap_err().to_string();
        assert!(message.contains("plain array"), "{message}");
    }

    #[test]
    fn arrays_that_are_not_there_are_named() {
        let mut npz = NpzReader::from_bytes(small_archive(), Path::new("cameras.npz")).unwrap();
        assert!(npz.contains("a") && !npz.contains("extrinsics"));
        let message = npz.array("extrinsics").unwrap_err().to_string();
        assert!(message.contains("extrinsics"), "{message}");
    }

    proptest! {
        #[test]
        fn what_is_written_reads_back(
            rows in 0usize..6, columns in 0usize..6, seed in prop::num::f64::NORMAL,
        ) {
            let values = (0..rows * columns).map(|i| seed / (1.0 + i as f64)).collect();
            let array = NpyArray { shape: vec![rows, columns], values };
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join("a.npz");
            write_npz(&path, &BTreeMap::from([("a", array.clone())])).unwrap();
            prop_assert_eq!(NpzReader::open(&path, "").unwrap().array("a").unwrap(), array);
        }

        #[test]
        fn random_bytes_are_errors(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            prop_assert!(read_a(&bytes).is_err());
            prop_assert!(parse(&bytes).is_err());
            prop_assert!(parse(&npy("'<f8'", false, "(7, 7)", &bytes)).is_err());
        }

        #[test]
        fn random_headers_do_not_panic(header in "[\\[({'a-f<>48,0-9: \\])}]{0,80}") {
            let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
            bytes.extend((header.len() as u16).to_le_bytes());
            bytes.extend(header.as_bytes());
            prop_assert!(parse(&bytes).is_err());
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(CASES))]
        #[test]
        fn truncated_and_damaged_archives_do_not_panic(
            cut in 1usize..100, bytes in damaged(small_archive()),
        ) {
            let archive = small_archive();
            prop_assert!(read_a(&archive[..archive.len() - cut]).is_err());
            if let Ok(array) = read_a(&bytes) {
                prop_assert_eq!(array.shape.iter().product::<usize>(), array.values.len());
            }
        }
    }
}
