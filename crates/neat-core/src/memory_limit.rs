//! How much memory may be used, and how it is shared out.

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
}
