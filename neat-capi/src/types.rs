//! What C and neat exchange: constants and structures, with the words of the header.

use crate::numbers::Numbers;
use std::ffi::{c_char, c_void};

/// The version of this interface. It grows by one when something is added; whatever is there
/// stays as it is.
pub const NEAT_ABI_VERSION: u32 = 1;

/// A folder for results that holds something is an error.
pub const NEAT_EXISTING_REFUSE: u32 = 0;
/// An earlier run in the folder is replaced.
pub const NEAT_EXISTING_OVERWRITE: u32 = 1;
/// A run in the folder goes on where it ended; without one, one begins.
pub const NEAT_EXISTING_RESUME: u32 = 2;

/// A stage begins: `text` is its name.
pub const NEAT_EVENT_STAGE: u32 = 0;
/// `fraction` of the stage that began last is done.
pub const NEAT_EVENT_PROGRESS: u32 = 1;
/// `text` is about the scene, or a decision with its reason.
pub const NEAT_EVENT_NOTE: u32 = 2;
/// `text` is what a person should know.
pub const NEAT_EVENT_WARNING: u32 = 3;
/// `text` is the path of a file that is complete.
pub const NEAT_EVENT_FILE: u32 = 4;

/// How a call ended. The numbers are the exit codes of the program `neat`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NeatStatus {
    /// Done. A wireframe may be empty nevertheless.
    Ok = 0,
    /// It failed: a full disk, a device, a fault of neat.
    Failed = 1,
    /// The arguments or the input cannot be used.
    BadInput = 2,
    /// The listener ended it. `NEAT_EXISTING_RESUME` continues.
    Cancelled = 130,
}

/// What a run tells while it works.
#[repr(C)]
#[derive(Debug)]
pub struct NeatEvent {
    /// Size of this structure in the library; later versions add fields at its end.
    pub size: u32,
    /// One of `NEAT_EVENT_*`; ignore others.
    pub kind: u32,
    /// From 0 to 1 for `NEAT_EVENT_PROGRESS`, else 0.
    pub fraction: f64,
    /// Null for `NEAT_EVENT_PROGRESS`; else a text that is gone after the call.
    pub text: *const c_char,
}

/// Hears what happens, in the thread that called `neat_reconstruct`. Zero goes on, anything
/// else ends the run, which may take the time of a step. It must return: no exception, no
/// `longjmp`.
pub type NeatListener = Option<extern "C" fn(data: *mut c_void, event: *const NeatEvent) -> i32>;

/// What to reconstruct, and how. Zero and null stand for the defaults, which are those of
/// `neat reconstruct`: `NeatOptions options = {.size = sizeof options, .scene = ..., .out = ...};`
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct NeatOptions {
    /// `sizeof(NeatOptions)`.
    pub size: u32,
    /// What to do about a folder `out` that holds something: one of `NEAT_EXISTING_*`.
    pub existing: u32,
    /// The folder of the scene, in any format that neat reads.
    pub scene: *const c_char,
    /// The folder for all results.
    pub out: *const c_char,
    /// The configuration to start from; null: "fast".
    pub preset: *const c_char,
    /// What computes: "auto", "flex", "ndarray" or "wgpu"; null: "auto".
    pub backend: *const c_char,
    /// A folder that keeps undistorted images and detected segments for the next run; null: none.
    pub cache: *const c_char,
    /// Changes of the configuration, each "key=value" as `neat reconstruct --set` takes them.
    pub settings: *const *const c_char,
    /// How many `settings` there are.
    pub setting_count: usize,
    /// Seed of all randomness.
    pub seed: u64,
    /// Training ends after so many seconds; 0: after its steps.
    pub time_budget_in_seconds: f64,
    /// Memory that may be used; 0: three quarters of what there is.
    pub memory_limit_in_bytes: u64,
    /// Not zero: a field is trained, for renderings and meshes.
    pub train: u32,
    /// Not zero: the run begins without a look at whether poses and images agree.
    pub skip_examination: u32,
    /// Hears what happens; null: nobody.
    pub listener: NeatListener,
    /// Given to `listener` as it is.
    pub listener_data: *mut c_void,
}

/// The numbers of a wireframe. All lists belong to the wireframe and go with it; those that it
/// does not know are null.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct NeatView {
    /// `sizeof(NeatView)`, set by the caller.
    pub size: u32,
    /// Not used.
    pub reserved: u32,
    /// How many junctions there are.
    pub junction_count: usize,
    /// How many edges there are.
    pub edge_count: usize,
    /// x, y, z of every junction, in the frame and unit of the scene's files.
    pub junctions: *const f64,
    /// The upper triangle xx, xy, xz, yy, yz, zz of every junction's covariance, in squared
    /// units; NaN where the images do not determine the position.
    pub covariances: *const f64,
    /// Two indices of junctions per edge.
    pub edges: *const u32,
    /// The probability that an edge exists.
    pub probabilities: *const f64,
    /// Probabilities per edge: crease, boundary, texture, shadow; they add up to 1.
    pub kinds: *const f64,
    /// 1 for an edge that is a piece of a curve, else 0.
    pub curved: *const u8,
    /// How many arcs of circles there are beside the edges.
    pub arc_count: usize,
    /// Twelve numbers per arc: its centre; unit vectors toward angle 0 and a right angle; its
    /// radius; the angles in radians at which it begins and ends, 2π apart for a whole circle.
    pub arcs: *const f64,
    /// The upper triangle of the covariance of each arc's centre x, y, z and radius, row by row:
    /// ten numbers in squared units; NaN where the views do not tell.
    pub arc_covariances: *const f64,
    /// How many smooth curves there are beside edges and arcs: uniform cubic B-splines.
    pub spline_count: usize,
    /// x, y, z of the control points of one spline after the other. An open one begins at its
    /// first and ends at its last.
    pub spline_controls: *const f64,
    /// How many control points each spline has.
    pub spline_sizes: *const u32,
    /// 1 for a spline that runs around, else 0.
    pub spline_closed: *const u8,
}

/// A wireframe: see `neat_wireframe_view` and `neat_wireframe_free`.
#[derive(Debug)]
pub struct NeatWireframe {
    /// What its views show.
    pub(crate) numbers: Numbers,
}
