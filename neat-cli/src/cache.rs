//! Where results are kept between runs.

use clap::Args;
use neat_core::file_cache::FileCache;

/// Whether results are kept between runs.
#[derive(Clone, Copy, Debug, Args)]
pub struct CacheArgs {
    /// Neither use nor keep undistorted images and detected 2D wireframes of earlier runs (in
    /// $NEAT_CACHE, else the user's folder for caches)
    #[arg(long)]
    no_cache: bool,
}

impl CacheArgs {
    /// The cache: in `$NEAT_CACHE`, else below the user's folder for caches; none
    /// if it is not wanted or the system has no such folder.
    pub fn open(self) -> Option<FileCache> {
        if self.no_cache {
            return None;
        }
        FileCache::of_user()
    }
}
