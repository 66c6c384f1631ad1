//! The border as a C program sees it, good and bad.

use super::*;
use std::ffi::c_void;
use std::fs;
use std::mem::zeroed;

const WIREFRAME: &str = r#"{"junctions": [[0, 0, 0], [1, 0, 0]], "edges": [[0, 1]],
    "edge_fields": {"probability": [0.5]}}"#;

/// Options as C initialises them.
fn options(scene: &CStr, out: &CStr) -> NeatOptions {
    NeatOptions {
        size: size_of::<NeatOptions>() as u32,
        scene: scene.as_ptr(),
        out: out.as_ptr(),
        // SAFETY: zero is a value of every field.
        ..unsafe { zeroed() }
    }
}

/// What a reconstruction that is refused says.
fn refusal(options: *const NeatOptions) -> (NeatStatus, String) {
    let (mut wireframe, mut error) = (ptr::dangling_mut(), ptr::null_mut());
    // SAFETY: options and both targets are those of this function's caller and frame.
    unsafe {
        let status = neat_reconstruct(options, &raw mut wireframe, &raw mut error);
        assert!(wireframe.is_null(), "an error leaves no wireframe");
        let text = CStr::from_ptr(error).to_str().unwrap().to_owned();
        neat_string_free(error);
        (status, text)
    }
}

fn is_refused(options: *const NeatOptions, part: &str) {
    let (status, text) = refusal(options);
    assert_eq!(status, NeatStatus::BadInput, "{text}");
    assert!(text.contains(part), "{text}");
}

#[test]
fn what_cannot_be_meant_is_refused_with_a_sentence() {
    let good = options(c"no/such/scene", c"no/such/out");
    is_refused(ptr::null(), "options are null");
    is_refused(&good, "no/such/scene");
    is_refused(&NeatOptions { size: 0, ..good }, "sizeof(NeatOptions)");
    let null = ptr::null();
    is_refused(
        &NeatOptions {
            scene: null,
            ..good
        },
        "`scene` is null",
    );
    is_refused(&NeatOptions { out: null, ..good }, "`out` is null");
    is_refused(
        &NeatOptions {
            existing: 7,
            ..good
        },
        "`existing` is 7",
    );
    let latin = c"caf\xe9".as_ptr();
    is_refused(
        &NeatOptions {
            scene: latin,
            ..good
        },
        "`scene` is not UTF-8",
    );
    let preset = c"slow".as_ptr();
    is_refused(&NeatOptions { preset, ..good }, "unknown preset `slow`");
    let backend = c"abacus".as_ptr();
    is_refused(&NeatOptions { backend, ..good }, "unknown backend `abacus`");
    let settings = [c"train.rays=512".as_ptr(), c"train.rais=512".as_ptr()];
    let set = NeatOptions {
        settings: settings.as_ptr(),
        setting_count: 2,
        ..good
    };
    is_refused(&set, "train.rais");
    let settings = ptr::null();
    is_refused(&NeatOptions { settings, ..set }, "`settings` is null");
    for time_budget_in_seconds in [-1.0, f64::NAN, f64::INFINITY] {
        let options = NeatOptions {
            time_budget_in_seconds,
            ..good
        };
        is_refused(&options, "time_budget_in_seconds");
    }
}

#[test]
fn options_of_other_versions_are_read() {
    // An earlier header ended after `out`: what lies behind is not ours.
    let mut earlier = options(c"no/such/scene", c"out");
    earlier.size = offset_of!(NeatOptions, preset) as u32;
    earlier.preset = ptr::dangling();
    is_refused(&earlier, "no/such/scene");
    // A later one has more, which may be asked for or not.
    #[repr(C)]
    struct Later {
        known: NeatOptions,
        more: u64,
    }
    let mut later = Later {
        known: options(c"no/such/scene", c"out"),
        more: 0,
    };
    later.known.size = size_of::<Later>() as u32;
    is_refused((&raw const later).cast(), "no/such/scene");
    later.more = 1;
    is_refused((&raw const later).cast(), "later version");
}

#[test]
fn a_wireframe_is_read_and_viewed() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("wireframe.json");
    fs::write(&path, WIREFRAME).unwrap();
    let path = CString::new(path.to_str().unwrap()).unwrap();
    let mut wireframe = ptr::null_mut();
    // SAFETY: all pointers are of this frame; the wireframe is freed once, at the end.
    unsafe {
        let no_error = ptr::null_mut();
        let status = neat_wireframe_read(path.as_ptr(), &raw mut wireframe, no_error);
        assert_eq!(status, NeatStatus::Ok);

        let mut view: NeatView = zeroed();
        assert_eq!(
            neat_wireframe_view(wireframe, &raw mut view),
            NeatStatus::BadInput
        );
        view.size = size_of::<NeatView>() as u32;
        assert_eq!(
            neat_wireframe_view(wireframe, &raw mut view),
            NeatStatus::Ok
        );
        assert_eq!((view.junction_count, view.edge_count), (2, 1));
        assert_eq!(view.junctions.add(3).read(), 1.0);
        assert_eq!((view.edges.read(), view.edges.add(1).read()), (0, 1));
        assert_eq!(view.probabilities.read(), 0.5);
        assert!(view.covariances.is_null() && view.kinds.is_null() && view.curved.is_null());
        assert!(view.arc_count == 0 && view.arcs.is_null() && view.arc_covariances.is_null());
        assert!(view.spline_count == 0 && view.spline_controls.is_null());
        assert!(view.spline_sizes.is_null() && view.spline_closed.is_null());

        // An earlier header's view ends before `junctions`: nothing is written behind it.
        let mut earlier: NeatView = zeroed();
        earlier.size = offset_of!(NeatView, junctions) as u32;
        earlier.junctions = ptr::dangling();
        let before = earlier.junctions;
        assert_eq!(
            neat_wireframe_view(wireframe, &raw mut earlier),
            NeatStatus::Ok
        );
        assert_eq!((earlier.edge_count, earlier.junctions), (1, before));
        assert_eq!(
            neat_wireframe_view(ptr::null(), &raw mut view),
            NeatStatus::BadInput
        );

        neat_wireframe_free(wireframe);
        neat_wireframe_free(ptr::null_mut());
        neat_string_free(ptr::null_mut());
    }
}

#[test]
fn a_panic_is_an_error() {
    let mut error = ptr::null_mut();
    // SAFETY: the pointer is of this frame, and its text is freed once.
    unsafe {
        let status = answer(|| panic!("on purpose"), ptr::null_mut(), &raw mut error);
        assert_eq!(status, NeatStatus::Failed);
        assert!(CStr::from_ptr(error).to_str().unwrap().contains("fault"));
        neat_string_free(error);
    }
}

#[test]
fn the_listener_hears_and_ends() {
    extern "C" fn count(data: *mut c_void, event: *const NeatEvent) -> i32 {
        // SAFETY: the test gives a number that outlives the call, and `tell` an event.
        unsafe {
            *data.cast::<i32>() += 1;
            let event = &*event;
            assert_eq!(event.kind, NEAT_EVENT_WARNING);
            assert_eq!(CStr::from_ptr(event.text), c"beware");
            (*data.cast::<i32>() == 2).into()
        }
    }
    let mut heard = 0;
    let options = NeatOptions {
        listener: Some(count),
        listener_data: (&raw mut heard).cast(),
        ..options(c"scene", c"out")
    };
    let warning = Told::Warning("be\0ware".to_owned());
    assert!(tell(&options, &warning));
    assert!(!tell(&options, &warning));
    assert_eq!(heard, 2);
}
