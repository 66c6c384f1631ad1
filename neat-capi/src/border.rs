//! The border to C: pointers are looked at here, and nowhere else.
//!
//! What crosses it keeps these rules, which the header tells and no compiler checks:
//! pointers are null or lead to what their type says, texts end with a zero byte, `size` is
//! what the caller has room for, and a handle is used until it is freed, once.

// A border to C cannot be drawn without: each block says why it may.
#![allow(unsafe_code)]

#[cfg(test)]
mod tests;

use crate::numbers::Numbers;
use crate::run::{self, Failure, Request, Told};
use crate::types::{
    NEAT_ABI_VERSION, NEAT_EVENT_FILE, NEAT_EVENT_NOTE, NEAT_EVENT_PROGRESS, NEAT_EVENT_STAGE,
    NEAT_EVENT_WARNING, NEAT_EXISTING_OVERWRITE, NEAT_EXISTING_REFUSE, NEAT_EXISTING_RESUME,
    NeatEvent, NeatOptions, NeatStatus, NeatView, NeatWireframe,
};
use neat_pipeline::run_dir::Existing;
use std::ffi::{CStr, CString, c_char};
use std::mem::{MaybeUninit, offset_of, size_of};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr;

/// `NEAT_ABI_VERSION` of the library that is loaded.
#[unsafe(no_mangle)]
pub extern "C" fn neat_abi_version() -> u32 {
    NEAT_ABI_VERSION
}

/// The version of neat, such as "0.1.0". It is not to be freed.
#[unsafe(no_mangle)]
pub extern "C" fn neat_version() -> *const c_char {
    const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "\0");
    VERSION.as_ptr().cast()
}

/// Reconstructs the wireframe of a scene and writes all results into the folder `options->out`.
///
/// `*wireframe` is what `neat_wireframe_free` takes, or null after an error; `*error` is null,
/// or says what went wrong and what helps, and is what `neat_string_free` takes. Either pointer
/// may be null if it is of no interest.
///
/// # Safety
/// Pointers and texts are what the header says they have to be.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neat_reconstruct(
    options: *const NeatOptions,
    wireframe: *mut *mut NeatWireframe,
    error: *mut *mut c_char,
) -> NeatStatus {
    let work = || {
        // SAFETY: null or options of the size that they state, by the rules of the module.
        let options = unsafe { read_options(options) }?;
        // SAFETY: its texts are null or end with a zero byte, by the same rules.
        let request = unsafe { request(&options) }?;
        request.run(&mut |told| tell(&options, told))
    };
    // SAFETY: both are null or may be written to, by the rules of the module.
    unsafe { answer(work, wireframe, error) }
}

/// Reads a `wireframe.json`, of a run or of another program. Answers as `neat_reconstruct`.
///
/// # Safety
/// Pointers and texts are what the header says they have to be.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neat_wireframe_read(
    path: *const c_char,
    wireframe: *mut *mut NeatWireframe,
    error: *mut *mut c_char,
) -> NeatStatus {
    let work = || {
        // SAFETY: null or a text that ends with a zero byte, by the rules of the module.
        let path = unsafe { needed_text(path, "path") }?;
        run::read(path.as_ref())
    };
    // SAFETY: both are null or may be written to, by the rules of the module.
    unsafe { answer(work, wireframe, error) }
}

/// Fills `*view`, whose `size` is set. `NEAT_STATUS_BAD_INPUT`: a pointer is null, or `size` is
/// none.
///
/// # Safety
/// Pointers and texts are what the header says they have to be.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neat_wireframe_view(
    wireframe: *const NeatWireframe,
    view: *mut NeatView,
) -> NeatStatus {
    // SAFETY: null or a wireframe that lives, by the rules of the module.
    let Some(wireframe) = (unsafe { wireframe.as_ref() }) else {
        return NeatStatus::BadInput;
    };
    if view.is_null() {
        return NeatStatus::BadInput;
    }
    // SAFETY: not null, and a view begins with its size whatever its version.
    let size = unsafe { view.cast::<u32>().read() };
    if (size as usize) < size_of::<u32>() {
        return NeatStatus::BadInput;
    }
    let known = view_of(&wireframe.numbers, size);
    let bytes = (size as usize).min(size_of::<NeatView>());
    // SAFETY: the caller has room for `size` bytes, we have those of a view, and it is ours.
    unsafe { ptr::copy_nonoverlapping((&raw const known).cast::<u8>(), view.cast(), bytes) };
    NeatStatus::Ok
}

/// Frees a wireframe and all lists of its views. Null is nothing to free.
///
/// # Safety
/// Pointers and texts are what the header says they have to be.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neat_wireframe_free(wireframe: *mut NeatWireframe) {
    if !wireframe.is_null() {
        // SAFETY: `answer` made it of a box, and it is freed once, by the rules of the module.
        drop(unsafe { Box::from_raw(wireframe) });
    }
}

/// Frees the text of an error. Null is nothing to free.
///
/// # Safety
/// Pointers and texts are what the header says they have to be.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neat_string_free(text: *mut c_char) {
    if !text.is_null() {
        // SAFETY: `answer` made it of a `CString`, and it is freed once.
        drop(unsafe { CString::from_raw(text) });
    }
}

/// Does `work` and hands over what it comes to. No panic leaves the library.
///
/// # Safety
/// Both pointers are null or may be written to.
unsafe fn answer(
    work: impl FnOnce() -> Result<Numbers, Failure>,
    wireframe: *mut *mut NeatWireframe,
    error: *mut *mut c_char,
) -> NeatStatus {
    // What was half done is dropped with the closure: nobody sees it again.
    let result = catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|_| {
        let text = "a fault of neat: its message is on the standard error; please report it";
        Err(Failure::Failed(text.to_owned()))
    });
    let (status, numbers, text) = match result {
        Ok(numbers) => (NeatStatus::Ok, Some(numbers), None),
        Err(Failure::BadInput(text)) => (NeatStatus::BadInput, None, Some(text)),
        Err(Failure::Failed(text)) => (NeatStatus::Failed, None, Some(text)),
        Err(Failure::Cancelled(text)) => (NeatStatus::Cancelled, None, Some(text)),
    };
    if !wireframe.is_null() {
        let made = numbers.map(|numbers| Box::into_raw(Box::new(NeatWireframe { numbers })));
        // SAFETY: not null, so it may be written to.
        unsafe { wireframe.write(made.unwrap_or(ptr::null_mut())) };
    }
    if !error.is_null() {
        let made = text.map(|text| c_text(&text).into_raw());
        // SAFETY: not null, so it may be written to.
        unsafe { error.write(made.unwrap_or(ptr::null_mut())) };
    }
    status
}

/// Options of any version: what an earlier one lacks is zero, and what only a later one knows
/// has to be.
///
/// # Safety
/// `options` is null or leads to as many bytes as its first field states.
unsafe fn read_options(options: *const NeatOptions) -> Result<NeatOptions, Failure> {
    let refused = |text: &str| Err(Failure::BadInput(text.to_owned()));
    if options.is_null() {
        return refused("the options are null");
    }
    // SAFETY: not null, and options begin with their size whatever their version.
    let size = unsafe { options.cast::<u32>().read() } as usize;
    if size < offset_of!(NeatOptions, preset) {
        return refused("`size` of the options has to be sizeof(NeatOptions)");
    }
    let ours = size_of::<NeatOptions>();
    for at in ours..size {
        // SAFETY: within the bytes that the caller has.
        if unsafe { options.cast::<u8>().add(at).read() } != 0 {
            return refused(
                "the options ask for something that only a later version of this library can do",
            );
        }
    }
    let mut known = MaybeUninit::<NeatOptions>::zeroed();
    // SAFETY: both have so many bytes; and zero is a value of every field, as is whatever a C
    // program may have put there: numbers, pointers, and a function or null.
    unsafe {
        let target = known.as_mut_ptr().cast::<u8>();
        ptr::copy_nonoverlapping(options.cast(), target, size.min(ours));
        Ok(known.assume_init())
    }
}

/// What options ask for.
///
/// # Safety
/// Their texts are null or end with a zero byte, and there are `setting_count` settings.
unsafe fn request(options: &NeatOptions) -> Result<Request, Failure> {
    let existing = match options.existing {
        NEAT_EXISTING_REFUSE => Existing::Refuse,
        NEAT_EXISTING_OVERWRITE => Existing::Overwrite,
        NEAT_EXISTING_RESUME => Existing::Resume,
        other => {
            let text = format!("`existing` is {other}: use one of NEAT_EXISTING_*");
            return Err(Failure::BadInput(text));
        }
    };
    if options.settings.is_null() && options.setting_count > 0 {
        let text = "`settings` is null and `setting_count` is not 0".to_owned();
        return Err(Failure::BadInput(text));
    }
    // SAFETY: the caller promises so of all texts, and that there are so many settings.
    unsafe {
        let settings = (0..options.setting_count)
            .map(|i| needed_text(options.settings.add(i).read(), "settings"))
            .collect::<Result<_, _>>()?;
        Ok(Request {
            scene: needed_text(options.scene, "scene")?.into(),
            out: needed_text(options.out, "out")?.into(),
            existing,
            preset: text(options.preset, "preset")?,
            backend: text(options.backend, "backend")?,
            cache: text(options.cache, "cache")?.map(Into::into),
            settings,
            seed: options.seed,
            time_budget_in_seconds: options.time_budget_in_seconds,
            memory_limit_in_bytes: options.memory_limit_in_bytes,
            train: options.train != 0,
            skip_examination: options.skip_examination != 0,
        })
    }
}

/// A text of the caller; `name` is for messages.
///
/// # Safety
/// It is null or ends with a zero byte.
unsafe fn text(text: *const c_char, name: &str) -> Result<Option<String>, Failure> {
    if text.is_null() {
        return Ok(None);
    }
    // SAFETY: not null, so it ends with a zero byte.
    match unsafe { CStr::from_ptr(text) }.to_str() {
        Ok(text) => Ok(Some(text.to_owned())),
        Err(_) => Err(Failure::BadInput(format!("`{name}` is not UTF-8"))),
    }
}

/// A text that may not be null.
///
/// # Safety
/// As [`text`].
unsafe fn needed_text(pointer: *const c_char, name: &str) -> Result<String, Failure> {
    // SAFETY: the caller promises the same.
    let given = unsafe { text(pointer, name) }?;
    given.ok_or_else(|| Failure::BadInput(format!("`{name}` is null")))
}

/// Tells the listener, if there is one; whether the run goes on.
fn tell(options: &NeatOptions, told: &Told) -> bool {
    let Some(listener) = options.listener else {
        return true;
    };
    let (kind, fraction, text) = match told {
        Told::Stage(text) => (NEAT_EVENT_STAGE, 0.0, Some(text)),
        Told::Progress(fraction) => (NEAT_EVENT_PROGRESS, *fraction, None),
        Told::Note(text) => (NEAT_EVENT_NOTE, 0.0, Some(text)),
        Told::Warning(text) => (NEAT_EVENT_WARNING, 0.0, Some(text)),
        Told::File(text) => (NEAT_EVENT_FILE, 0.0, Some(text)),
    };
    let text = text.map(|text| c_text(text));
    let event = NeatEvent {
        size: size_of::<NeatEvent>() as u32,
        kind,
        fraction,
        text: text.as_ref().map_or(ptr::null(), |text| text.as_ptr()),
    };
    // The text lives until here, and so for the whole call.
    let goes_on = listener(options.listener_data, &raw const event) == 0;
    drop(text);
    goes_on
}

fn c_text(text: &str) -> CString {
    let bytes: Vec<u8> = text.bytes().filter(|byte| *byte != 0).collect();
    // No byte is zero.
    CString::new(bytes).unwrap_or_default()
}

fn view_of(numbers: &Numbers, size: u32) -> NeatView {
    NeatView {
        size,
        reserved: 0,
        junction_count: numbers.junctions.len() / 3,
        edge_count: numbers.edges.len() / 2,
        junctions: list(&numbers.junctions),
        covariances: list(&numbers.covariances),
        edges: list(&numbers.edges),
        probabilities: list(&numbers.probabilities),
        kinds: list(&numbers.kinds),
        curved: list(&numbers.curved),
        arc_count: numbers.arcs.len() / 12,
        arcs: list(&numbers.arcs),
        arc_covariances: list(&numbers.arc_covariances),
        spline_count: numbers.spline_sizes.len(),
        spline_controls: list(&numbers.spline_controls),
        spline_sizes: list(&numbers.spline_sizes),
        spline_closed: list(&numbers.spline_closed),
    }
}

/// Null for an empty list.
fn list<T>(values: &[T]) -> *const T {
    if values.is_empty() {
        return ptr::null();
    }
    values.as_ptr()
}
