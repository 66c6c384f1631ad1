//! How much memory may be used, and how it is shared out.

use crate::SceneError;
use rayon::prelude::*;
use std::path::Path;

const MIB: u64 = 1 << 20;
/// Share of the limit that the images of a scene may stay in. The rest is for what
/// is done with them, for the networks and for the regions that rays are drawn from.
const IMAGES_SHARE: f64 = 0.25;
/// Share of the limit that work on several views at once may take together.
const WORK_SHARE: f64 = 0.5;

/// How many bytes of memory a program may use.
///
/// It decides how things are kept and how many are worked on at once, never what
/// comes out.
///
/// ```
/// use neat_core::MemoryLimit;
///
/// let limit = MemoryLimit::of_bytes(8 << 30);
/// // 300 photographs of 12 megapixels go to a file, fifty stay.
/// assert!(!limit.holds_images(300 * 36_000_000));
/// assert!(limit.holds_images(50 * 36_000_000));
/// // Work that takes a gibibyte for each view is done on four at once.
/// assert_eq!(limit.at_once(1 << 30), 4);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MemoryLimit(Option<u64>);

impl MemoryLimit {
    /// As much as there is.
    pub const NONE: Self = Self(None);

    /// At most so many bytes.
    pub const fn of_bytes(bytes: u64) -> Self {
        Self(Some(bytes))
    }

    /// The bytes; `None` without a limit.
    pub const fn bytes(self) -> Option<u64> {
        self.0
    }

    /// Whether the images of a scene that are `bytes` large together may stay in
    /// memory: up to a quarter of the limit.
    pub fn holds_images(self, bytes: u64) -> bool {
        self.share(IMAGES_SHARE).is_none_or(|room| bytes <= room)
    }

    /// How many pieces of work that take `bytes_each` may be done at once, in half
    /// of the limit; at least one.
    pub fn at_once(self, bytes_each: u64) -> usize {
        let Some(room) = self.share(WORK_SHARE) else {
            return usize::MAX;
        };
        usize::try_from(room / bytes_each.max(1)).map_or(usize::MAX, |count| count.max(1))
    }

    /// What [`Self::try_map`] needs to know about work that takes `bytes_per_pixel` of
    /// images of these sizes: the bytes that the largest of them takes. `work` and
    /// `path` say in the error what is done with which image or scene.
    ///
    /// # Errors
    /// If that is more than the limit.
    pub fn bytes_each(
        self,
        sizes: impl Iterator<Item = (u32, u32)>,
        bytes_per_pixel: u64,
        work: &'static str,
        path: &Path,
    ) -> Result<u64, SceneError> {
        let pixels = |(width, height): (u32, u32)| u64::from(width) * u64::from(height);
        let (width, height) = sizes.max_by_key(|&size| pixels(size)).unwrap_or_default();
        let needed = pixels((width, height)).saturating_mul(bytes_per_pixel);
        match self.0 {
            Some(limit) if limit < needed => Err(SceneError::MemoryLimit {
                path: path.into(),
                work,
                width,
                height,
                needed_mib: needed.div_ceil(MIB),
                limit_mib: limit / MIB,
            }),
            _ => Ok(needed),
        }
    }

    /// Maps in parallel, as many items at once as [`Self::at_once`] says.
    ///
    /// # Errors
    /// Of several errors the first in the order of the items.
    pub fn try_map<T: Sync, U: Send, E: Send>(
        self,
        items: &[T],
        bytes_each: u64,
        f: impl Fn(&T) -> Result<U, E> + Sync + Send,
    ) -> Result<Vec<U>, E> {
        let mut mapped = Vec::with_capacity(items.len());
        // A thread that waits for others within `f` takes up the next item: the number
        // of threads is no bound.
        for chunk in items.chunks(self.at_once(bytes_each)) {
            let results: Vec<_> = chunk.par_iter().map(&f).collect();
            for result in results {
                mapped.push(result?);
            }
        }
        Ok(mapped)
    }

    fn share(self, share: f64) -> Option<u64> {
        // The limit is far below 2⁵³.
        self.0.map(|bytes| (bytes as f64 * share) as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_leave_room_and_work_goes_on_without_it() {
        let limit = MemoryLimit::of_bytes(1000);
        assert!(limit.holds_images(250) && !limit.holds_images(251));
        assert_eq!(
            [100, 500, 501, 0].map(|each| limit.at_once(each)),
            [5, 1, 1, 500]
        );
        assert!(MemoryLimit::NONE.holds_images(u64::MAX));
        assert_eq!(MemoryLimit::NONE.at_once(u64::MAX), usize::MAX);
    }

    #[test]
    fn too_little_for_one_image_is_an_error_that_says_how_much_is_needed() {
        let sizes = || [(10, 10), (2048, 1024), (3000, 1)].into_iter();
        let bytes = |limit: u64| {
            MemoryLimit::of_bytes(limit).bytes_each(
                sizes(),
                16,
                "reading an image",
                "scene".as_ref(),
            )
        };
        assert_eq!(bytes(32 * MIB).unwrap(), 32 * MIB);
        let message = bytes(32 * MIB - 1).unwrap_err().to_string();
        for part in [
            "scene",
            "reading",
            "32 MiB",
            "2048×1024",
            "31 MiB",
            "--memory-limit",
        ] {
            assert!(message.contains(part), "{message}");
        }
        let none = MemoryLimit::NONE.bytes_each(std::iter::empty(), 16, "", "".as_ref());
        assert_eq!(none.unwrap(), 0);
    }

    #[test]
    fn no_more_is_done_at_once_than_fits_and_the_first_error_counts() {
        use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};
        let items: Vec<usize> = (0..50).collect();
        let [now, most] = [AtomicUsize::new(0), AtomicUsize::new(0)];
        let double = |item: &usize| -> Result<usize, usize> {
            most.fetch_max(now.fetch_add(1, SeqCst) + 1, SeqCst);
            // Others could begin meanwhile.
            let inner: usize = (0..1000usize)
                .into_par_iter()
                .map(|_| *item)
                .max()
                .unwrap_or(0);
            now.fetch_sub(1, SeqCst);
            Ok(2 * inner)
        };
        let run = |limit: MemoryLimit| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(4)
                .build()
                .unwrap();
            pool.install(|| limit.try_map(&items, 100, double)).unwrap()
        };
        let expected: Vec<usize> = items.iter().map(|item| 2 * item).collect();
        assert_eq!(run(MemoryLimit::of_bytes(400)), expected);
        assert!((1..=2).contains(&most.load(SeqCst)));
        assert_eq!(run(MemoryLimit::NONE), expected);

        let late = |item: &usize| if *item % 7 == 6 { Err(*item) } else { Ok(()) };
        for limit in [MemoryLimit::NONE, MemoryLimit::of_bytes(1)] {
            assert_eq!(limit.try_map(&items, 100, late), Err(6));
        }
    }
}
