//! What an edge map costs, whatever it shows.
//!
//! One test in a file of its own: it measures the memory of the whole process.

use image::{GrayImage, Luma};
use neat_detect::edge_map::segments;
use peak_alloc::PeakAlloc;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

#[test]
fn wide_areas_cost_bytes_per_pixel() {
    const SIDE: u32 = 1024;
    let map = GrayImage::from_pixel(SIDE, SIDE, Luma([255]));
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    segments(&map);
    let taken = MEMORY.peak_usage() - before;
    // Two images of truth values, and lists of the border.
    let most = 3 * (SIDE * SIDE) as usize;
    assert!(taken < most, "{taken} bytes");
}
