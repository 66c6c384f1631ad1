//! Files that claim more than they hold cost memory by what they hold.
//!
//! One test in a file of its own: it measures the memory of the whole process.

#[path = "../../fuzz/src/readers.rs"]
mod readers;
#[path = "../../fuzz/src/seeds.rs"]
mod seeds;

use peak_alloc::PeakAlloc;
use readers::{READERS, SEPARATOR};

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Bytes of memory that a byte of a file may cost: a bracket of JSON becomes a value.
const PER_BYTE: usize = 128;
/// What a file may cost in any case, such as threads and the tables of a decoder.
const IN_ANY_CASE: usize = 1 << 20;

/// `seed` with `new` in the place of the first `old`.
fn replaced(seed: &[u8], old: &[u8], new: &[u8]) -> Vec<u8> {
    let at = seed.windows(old.len()).position(|window| window == old);
    let at = at.expect("the seed has what is replaced");
    [&seed[..at], new, &seed[at + old.len()..]].concat()
}

/// `seed` with `new` over what is `offset` bytes after the first `mark`.
fn overwritten(mut seed: Vec<u8>, mark: &[u8], offset: usize, new: &[u8]) -> Vec<u8> {
    let at = seed.windows(mark.len()).position(|window| window == mark);
    let at = at.expect("the seed has the mark") + offset;
    seed[at..at + new.len()].copy_from_slice(new);
    seed
}

fn first(seeds: Vec<Vec<u8>>) -> Vec<u8> {
    seeds.into_iter().next().expect("a seed")
}

/// An npz whose entry says that it unpacks to four gigabytes.
fn archive_that_claims(seed: Vec<u8>) -> Vec<u8> {
    let size = 0xffff_fff0_u32.to_le_bytes();
    let local = overwritten(seed, b"PK\x03\x04", 22, &size);
    overwritten(local, b"PK\x01\x02", 24, &size)
}

/// An npz whose directory says that it has sixty thousand entries.
fn archive_of_many(seed: Vec<u8>) -> Vec<u8> {
    overwritten(seed, b"PK\x05\x06", 8, &[0xff, 0xee, 0xff, 0xee])
}

/// A NumPy array of that shape and no data.
fn array_of_shape(shape: &str) -> Vec<u8> {
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes
}

/// A PNG whose header says, with the right checksum, that it has 12000 × 12000 pixels.
fn png_that_claims() -> Vec<u8> {
    let png = first(seeds::picture());
    let mut png = overwritten(png, b"IHDR", 4, &[0, 0, 0x2e, 0xe0, 0, 0, 0x2e, 0xe0]);
    let mut checksum = flate2::Crc::new();
    checksum.update(&png[12..29]);
    png[29..33].copy_from_slice(&checksum.sum().to_be_bytes());
    png
}

/// A JPEG whose header says that it has 65500 × 65500 pixels.
fn jpeg_that_claims() -> Vec<u8> {
    let jpeg = seeds::picture().swap_remove(1);
    // Height and width follow marker, length and precision.
    overwritten(jpeg, &[0xff, 0xc0], 5, &[0xff, 0xdc, 0xff, 0xdc])
}

/// A mesh of one face whose corners take a byte each.
fn face_of_many(binary_mesh: &[u8]) -> Vec<u8> {
    let mesh = replaced(binary_mesh, b"list uchar int", b"list uint uchar");
    let vertices = mesh
        .windows(11)
        .position(|window| window == b"end_header\n");
    let faces = vertices.expect("a header") + 11 + 48;
    let corners = 60_000_u32;
    let count = corners.to_le_bytes();
    [
        &mesh[..faces],
        &count,
        &vec![1; corners as usize],
        &count,
        &vec![2; 60_000],
    ]
    .concat()
}

/// Two thousand views that share one large camera with a long name.
fn openmvg_that_shares() -> Vec<u8> {
    let numbers = vec!["0"; 50_000].join(",");
    let name = "x".repeat(100_000);
    let mut entries = vec![format!(
        r#"{{"key":0,"value":{{"polymorphic_id":2147483649,"polymorphic_name":"{name}",
        "ptr_wrapper":{{"id":2147483649,"data":{{"numbers":[{numbers}]}}}}}}}}"#
    )];
    entries.extend((1..2000).map(|key| {
        format!(r#"{{"key":{key},"value":{{"polymorphic_id":1,"ptr_wrapper":{{"id":1}}}}}}"#)
    }));
    let entries = entries.join(",");
    format!(r#"{{"views":[{entries}],"intrinsics":[],"extrinsics":[]}}"#).into_bytes()
}

/// (reader, what is wrong with the file, the file).
fn hostile_files() -> Vec<(&'static str, &'static str, Vec<u8>)> {
    const MOST: [u8; 8] = [0xff; 8];
    let colmap = first(seeds::colmap_binary());
    let after = |mark: &[u8], offset| overwritten(colmap.clone(), mark, offset, &MOST);
    let mvs = first(seeds::openmvs());
    let brackets = b"[".repeat(1 << 20);
    let lists = [&b"[[]"[..], &b",[]".repeat(1 << 18), b"]"].concat();
    let within = |before: &str, json: &[u8], after: &str| {
        [before.as_bytes(), json, after.as_bytes()].concat()
    };
    let ascii_ply = first(seeds::ply());
    let edges = seeds::ply_edges();
    let meshes = seeds::triangle_mesh();
    vec![
        (
            "npy",
            "a huge shape",
            array_of_shape("(99999999, 999999999)"),
        ),
        ("npy", "a huge axis", array_of_shape("(99999999999999999,)")),
        (
            "numpy_lines",
            "a huge shape",
            array_of_shape("(999999999, 2, 3)"),
        ),
        (
            "npz",
            "a huge entry",
            archive_that_claims(first(seeds::npz())),
        ),
        ("npz", "many entries", archive_of_many(first(seeds::npz()))),
        (
            "abc",
            "a huge entry",
            archive_that_claims(first(seeds::abc())),
        ),
        (
            "dtu",
            "a huge entry",
            archive_that_claims(first(seeds::dtu())),
        ),
        ("picture", "a huge PNG", png_that_claims()),
        ("picture", "a huge JPEG", jpeg_that_claims()),
        ("edge_picture", "a huge JPEG", jpeg_that_claims()),
        (
            "colmap_binary",
            "many cameras",
            overwritten(colmap.clone(), &colmap[..8], 0, &MOST),
        ),
        (
            "colmap_binary",
            "many images",
            after(SEPARATOR, SEPARATOR.len()),
        ),
        ("colmap_binary", "many 2D points", after(b"a.png\0", 6)),
        ("colmap_binary", "many points", {
            let points = colmap.len() - 75;
            let mut bytes = colmap.clone();
            bytes[points..points + 8].copy_from_slice(&MOST);
            bytes
        }),
        ("colmap_binary", "a long track", {
            let track = colmap.len() - 24;
            let mut bytes = colmap.clone();
            bytes[track..track + 8].copy_from_slice(&MOST);
            bytes
        }),
        (
            "openmvs",
            "many platforms",
            overwritten(mvs.clone(), b"MVSI", 12, &MOST),
        ),
        (
            "openmvs",
            "a long name",
            overwritten(mvs.clone(), b"MVSI", 20, &MOST),
        ),
        (
            "openmvs",
            "many images",
            overwritten(mvs, &[2u64, 12].map(u64::to_le_bytes).concat(), 0, &MOST),
        ),
        (
            "nvm",
            "many cameras",
            b"NVM_V3\n\n18446744073709551615\na.png 20 1 0 0 0 0 0 -4 0 0\n".into(),
        ),
        (
            "nvm",
            "many points",
            replaced(
                &first(seeds::nvm()),
                b"\n1\n0 0.1",
                b"\n18446744073709551615\n0 0.1",
            ),
        ),
        (
            "nvm",
            "many measurements",
            replaced(
                &first(seeds::nvm()),
                b"0 0 2 0",
                b"0 0 18446744073709551615 0",
            ),
        ),
        (
            "bundler",
            "many points",
            replaced(
                &first(seeds::bundler()),
                b"\n2 1\n",
                b"\n2 18446744073709551615\n",
            ),
        ),
        (
            "bundler",
            "many cameras",
            replaced(
                &first(seeds::bundler()),
                b"\n2 1\n",
                b"\n18446744073709551615 1\n",
            ),
        ),
        (
            "ply",
            "many vertices",
            replaced(&ascii_ply, b"vertex 2", b"vertex 99999999999999"),
        ),
        (
            "ply",
            "many binary vertices",
            replaced(&seeds::ply()[1], b"vertex 2", b"vertex 99999999999999"),
        ),
        (
            "points_of_scene",
            "many vertices",
            replaced(&ascii_ply, b"vertex 2", b"vertex 99999999999999"),
        ),
        (
            "ply_edges",
            "many vertices",
            replaced(&edges[0], b"vertex 2", b"vertex 99999999999999"),
        ),
        (
            "ply_edges",
            "rows of nothing",
            replaced(
                &edges[1],
                b"element face 1\nproperty list uchar int vertex_indices",
                b"element face 99999999999999",
            ),
        ),
        (
            "ply_edges",
            "a list without end",
            replaced(&edges[0], b"\n2 0 -1\n", b"\n1e300 0 -1\n"),
        ),
        (
            "triangle_mesh",
            "many faces",
            replaced(&meshes[0], b"face 2", b"face 99999999999999"),
        ),
        (
            "triangle_mesh",
            "a list without end",
            replaced(&meshes[0], b"\n3 0 1 3\n", b"\n1e300 0 1 3\n"),
        ),
        (
            "triangle_mesh",
            "a face of very many corners",
            face_of_many(&meshes[1]),
        ),
        (
            "true_edges",
            "lists",
            within(r#"{"junctions":[],"edges":[],"edge_views":"#, &lists, "}"),
        ),
        (
            "mat",
            "a huge array",
            overwritten(first(seeds::mat()), b"ObsMask", 7, &MOST),
        ),
        (
            "mat",
            "a long element",
            overwritten(first(seeds::mat()), b"IM", 6, &MOST[..4]),
        ),
        ("line3dpp", "many segments", b"1e18 0 0 0 1 0 0 0\n".into()),
        (
            "limap_tracks",
            "many tracks",
            b"18446744073709551615\n0 2 2\n0 0 0\n1 0 0\n0 1\n3 4\n".into(),
        ),
        (
            "limap_tracks",
            "many segments",
            b"1\n0 18446744073709551615 2\n0 0 0\n1 0 0\n0 1\n3 4\n".into(),
        ),
        (
            "limap_track",
            "many segments",
            b"0 0 0 1 0 0\n18446744073709551615 2\nimage_id_list 0 1\n".into(),
        ),
        (
            "limap_images",
            "many images",
            b"number of images, 18446744073709551615\n0, a\n".into(),
        ),
        (
            "segments_text",
            "many segments",
            b"18446744073709551615\n1 2 3 4\n".into(),
        ),
        ("openmvg", "shared objects", openmvg_that_shares()),
        ("openmvg", "brackets", within(r#"{"views":"#, &brackets, "")),
        (
            "openmvg",
            "lists",
            within(
                r#"{"views":[{"key":0,"value":{"ptr_wrapper":{"data":"#,
                &lists,
                r#"}}}],"intrinsics":[],"extrinsics":[]}"#,
            ),
        ),
        (
            "parametric_edges",
            "brackets",
            within(r#"{"lines_end_pts":"#, &brackets, ""),
        ),
        (
            "parametric_edges",
            "lists",
            within(r#"{"lines_end_pts":"#, &lists, "}"),
        ),
        (
            "wireframe_json",
            "brackets",
            within(r#"{"metadata":{"a":"#, &brackets, ""),
        ),
        (
            "wireframe_json",
            "lists",
            within(r#"{"metadata":{"a":"#, &lists, r#"},"junctions":[]}"#),
        ),
        (
            "transforms_json",
            "lists",
            within(r#"{"a":"#, &lists, r#","frames":[]}"#),
        ),
        ("hawp", "brackets", within(r#"{"vertices":"#, &brackets, "")),
        ("hawp", "lists", within(r#"{"vertices":"#, &lists, "}")),
        (
            "wireframe_of_truth",
            "brackets",
            within(r#"{"a":"#, &brackets, ""),
        ),
    ]
}

#[test]
fn memory_follows_the_file_and_not_its_claims() {
    let files = hostile_files();
    // Folders and threads that the first use of a reader makes.
    for reader in READERS {
        (reader.read)(&first((reader.seeds)()));
    }
    for (name, what, bytes) in files {
        let reader = READERS.iter().find(|reader| reader.name == name);
        let reader = reader.expect("a name of READERS");
        let before = MEMORY.current_usage();
        MEMORY.reset_peak_usage();
        (reader.read)(&bytes);
        let used = MEMORY.peak_usage().saturating_sub(before);
        let allowed = IN_ANY_CASE + PER_BYTE * bytes.len();
        let length = bytes.len();
        assert!(
            used <= allowed,
            "{name}, {what}: {used} bytes for a file of {length}"
        );
    }
}
