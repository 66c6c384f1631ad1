/* neat: a folder of posed photographs in, a 3D wireframe out.
 *
 * Made by cbindgen from neat-capi/src: change it there.
 *
 * Pointers are null or lead to what their type says; texts are UTF-8 and end with a zero byte;
 * what a function hands out is freed once, by the function that is named there.
 *
 * Every function may be called from any thread, and a wireframe be looked at by several at once.
 * Work is done on as many threads as there are cores, or as RAYON_NUM_THREADS says. */

#ifndef NEAT_H
#define NEAT_H

#include <stddef.h>
#include <stdint.h>

// The version of this interface. It grows by one when something is added; whatever is there
// stays as it is.
#define NEAT_ABI_VERSION 1

// A folder for results that holds something is an error.
#define NEAT_EXISTING_REFUSE 0

// An earlier run in the folder is replaced.
#define NEAT_EXISTING_OVERWRITE 1

// A run in the folder goes on where it ended; without one, one begins.
#define NEAT_EXISTING_RESUME 2

// A stage begins: `text` is its name.
#define NEAT_EVENT_STAGE 0

// `fraction` of the stage that began last is done.
#define NEAT_EVENT_PROGRESS 1

// `text` is about the scene, or a decision with its reason.
#define NEAT_EVENT_NOTE 2

// `text` is what a person should know.
#define NEAT_EVENT_WARNING 3

// `text` is the path of a file that is complete.
#define NEAT_EVENT_FILE 4

// How a call ended. The numbers are the exit codes of the program `neat`.
typedef enum {
    // Done. A wireframe may be empty nevertheless.
    NEAT_STATUS_OK = 0,
    // It failed: a full disk, a device, a fault of neat.
    NEAT_STATUS_FAILED = 1,
    // The arguments or the input cannot be used.
    NEAT_STATUS_BAD_INPUT = 2,
    // The listener ended it. `NEAT_EXISTING_RESUME` continues.
    NEAT_STATUS_CANCELLED = 130,
} NeatStatus;

// A wireframe: see `neat_wireframe_view` and `neat_wireframe_free`.
typedef struct NeatWireframe NeatWireframe;

// What a run tells while it works.
typedef struct {
    // Size of this structure in the library; later versions add fields at its end.
    uint32_t size;
    // One of `NEAT_EVENT_*`; ignore others.
    uint32_t kind;
    // From 0 to 1 for `NEAT_EVENT_PROGRESS`, else 0.
    double fraction;
    // Null for `NEAT_EVENT_PROGRESS`; else a text that is gone after the call.
    const char *text;
} NeatEvent;

// Hears what happens, in the thread that called `neat_reconstruct`. Zero goes on, anything
// else ends the run, which may take the time of a step. It must return: no exception, no
// `longjmp`.
typedef int32_t (*NeatListener)(void *data, const NeatEvent *event);

// What to reconstruct, and how. Zero and null stand for the defaults, which are those of
// `neat reconstruct`: `NeatOptions options = {.size = sizeof options, .scene = ..., .out = ...};`
typedef struct {
    // `sizeof(NeatOptions)`.
    uint32_t size;
    // What to do about a folder `out` that holds something: one of `NEAT_EXISTING_*`.
    uint32_t existing;
    // The folder of the scene, in any format that neat reads.
    const char *scene;
    // The folder for all results.
    const char *out;
    // The configuration to start from; null: "fast".
    const char *preset;
    // What computes: "auto", "flex", "ndarray" or "wgpu"; null: "auto".
    const char *backend;
    // A folder that keeps undistorted images and detected segments for the next run; null: none.
    const char *cache;
    // Changes of the configuration, each "key=value" as `neat reconstruct --set` takes them.
    const char *const *settings;
    // How many `settings` there are.
    size_t setting_count;
    // Seed of all randomness.
    uint64_t seed;
    // Training ends after so many seconds; 0: after its steps.
    double time_budget_in_seconds;
    // Memory that may be used; 0: three quarters of what there is.
    uint64_t memory_limit_in_bytes;
    // Not zero: a field is trained, for renderings and meshes.
    uint32_t train;
    // Not zero: the run begins without a look at whether poses and images agree.
    uint32_t skip_examination;
    // Hears what happens; null: nobody.
    NeatListener listener;
    // Given to `listener` as it is.
    void *listener_data;
} NeatOptions;

// The numbers of a wireframe. All lists belong to the wireframe and go with it; those that it
// does not know are null.
typedef struct {
    // `sizeof(NeatView)`, set by the caller.
    uint32_t size;
    // Not used.
    uint32_t reserved;
    // How many junctions there are.
    size_t junction_count;
    // How many edges there are.
    size_t edge_count;
    // x, y, z of every junction, in the frame and unit of the scene's files.
    const double *junctions;
    // The upper triangle xx, xy, xz, yy, yz, zz of every junction's covariance, in squared
    // units; NaN where the images do not determine the position.
    const double *covariances;
    // Two indices of junctions per edge.
    const uint32_t *edges;
    // The probability that an edge exists.
    const double *probabilities;
    // Probabilities per edge: crease, boundary, texture, shadow; they add up to 1.
    const double *kinds;
    // 1 for an edge that is a piece of a curve, else 0.
    const uint8_t *curved;
    // How many arcs of circles there are beside the edges.
    size_t arc_count;
    // Twelve numbers per arc: its centre; unit vectors toward angle 0 and a right angle; its
    // radius; the angles in radians at which it begins and ends, 2π apart for a whole circle.
    const double *arcs;
    // The upper triangle of the covariance of each arc's centre x, y, z and radius, row by row:
    // ten numbers in squared units; NaN where the views do not tell.
    const double *arc_covariances;
    // How many smooth curves there are beside edges and arcs: uniform cubic B-splines.
    size_t spline_count;
    // x, y, z of the control points of one spline after the other. An open one begins at its
    // first and ends at its last.
    const double *spline_controls;
    // How many control points each spline has.
    const uint32_t *spline_sizes;
    // 1 for a spline that runs around, else 0.
    const uint8_t *spline_closed;
} NeatView;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// `NEAT_ABI_VERSION` of the library that is loaded.
uint32_t neat_abi_version(void);

// The version of neat, such as "0.1.0". It is not to be freed.
const char *neat_version(void);

// Reconstructs the wireframe of a scene and writes all results into the folder `options->out`.
//
// `*wireframe` is what `neat_wireframe_free` takes, or null after an error; `*error` is null,
// or says what went wrong and what helps, and is what `neat_string_free` takes. Either pointer
// may be null if it is of no interest.
//
// # Safety
// Pointers and texts are what the header says they have to be.
NeatStatus neat_reconstruct(const NeatOptions *options, NeatWireframe **wireframe, char **error);

// Reads a `wireframe.json`, of a run or of another program. Answers as `neat_reconstruct`.
//
// # Safety
// Pointers and texts are what the header says they have to be.
NeatStatus neat_wireframe_read(const char *path, NeatWireframe **wireframe, char **error);

// Fills `*view`, whose `size` is set. `NEAT_STATUS_BAD_INPUT`: a pointer is null, or `size` is
// none.
//
// # Safety
// Pointers and texts are what the header says they have to be.
NeatStatus neat_wireframe_view(const NeatWireframe *wireframe, NeatView *view);

// Frees a wireframe and all lists of its views. Null is nothing to free.
//
// # Safety
// Pointers and texts are what the header says they have to be.
void neat_wireframe_free(NeatWireframe *wireframe);

// Frees the text of an error. Null is nothing to free.
//
// # Safety
// Pointers and texts are what the header says they have to be.
void neat_string_free(char *text);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* NEAT_H */
