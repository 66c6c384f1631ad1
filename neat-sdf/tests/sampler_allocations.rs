//! The error-bounded sampler does not allocate per ray.

#![allow(unsafe_code)] // to count, an allocator has to be one

use neat_sdf::ray_sampler::{Deterministic, ErrorBoundConfig, RayBundle, StopRule};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

/// The system's allocator, counting.
struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: forwards to the system's allocator, whose contract it shares.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promise about `layout` is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: `pointer` came from `System.alloc` with this `layout`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

fn sphere(points: &[[f32; 3]]) -> Vec<f32> {
    let distance = |p: &[f32; 3]| (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt() - 1.0;
    points.iter().map(distance).collect()
}

fn fan(count: usize) -> RayBundle {
    let mut rays = RayBundle::default();
    for i in 0..count {
        let slope = 0.65 * i as f32 / count as f32;
        let length = (1.0 + slope * slope).sqrt();
        rays.origins.push([0.0, 0.0, -2.5]);
        rays.directions.push([slope / length, 0.0, 1.0 / length]);
    }
    rays
}

#[test]
fn allocations_do_not_grow_with_the_rays() {
    // On one thread: what threads need to share work is not the sampler's.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1);
    let pool = pool.build().expect("a thread");
    for stop in [StopRule::Batch, StopRule::Ray] {
        let config = ErrorBoundConfig {
            stop,
            ..ErrorBoundConfig::default()
        };
        let rays = fan(400);
        let count = || {
            pool.install(|| {
                // Every answer is an allocation, but not the sampler's.
                let mut answers = 0;
                let mut query = |points: &[[f32; 3]]| {
                    answers += 1;
                    sphere(points)
                };
                let before = ALLOCATIONS.load(Ordering::Relaxed);
                config.sample(&rays, 0.005, &mut query, &mut Deterministic, None);
                ALLOCATIONS.load(Ordering::Relaxed) - before - answers
            })
        };
        // The first call makes room.
        count();
        let again = count();
        // The first positions, the columns that stay for each length, the result.
        assert!(again <= 12, "{stop:?}: {again} allocations");
    }
}
