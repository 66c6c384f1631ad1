//! Working memory of a block, kept from one block to the next.

use std::cell::RefCell;
use std::sync::{Mutex, PoisonError};

/// Numbers in a cache line.
const LINE: usize = 16;

/// Memory whose first number begins a cache line: vector loads then never
/// straddle two.
#[derive(Debug, Default)]
struct Aligned {
    data: Vec<f32>,
    offset: usize,
    len: usize,
}

impl Aligned {
    /// `len` zeros.
    pub fn zeros(len: usize) -> Self {
        let data = vec![0.0f32; len + LINE];
        let offset = data
            .as_ptr()
            .align_offset(LINE * size_of::<f32>())
            .min(LINE);
        Self { data, offset, len }
    }

    fn capacity(&self) -> usize {
        self.data.len() - self.data.len().min(LINE)
    }

    /// The numbers.
    pub fn as_slice(&self) -> &[f32] {
        &self.data[self.offset..self.offset + self.len]
    }

    /// The numbers.
    pub fn as_mut_slice(&mut self) -> &mut [f32] {
        &mut self.data[self.offset..self.offset + self.len]
    }
}

/// Buffers that passes leave to later ones: fresh memory costs a page fault for
/// every few rows.
static POOL: Mutex<Vec<Aligned>> = Mutex::new(Vec::new());
/// Most buffers in the pool.
const POOLED: usize = 96;

/// A buffer from the pool, given back when it is dropped.
#[derive(Debug)]
pub struct Pooled(Aligned);

impl Pooled {
    /// `len` numbers, whose values are left over from earlier use.
    pub fn take(len: usize) -> Self {
        let mut pool = POOL.lock().unwrap_or_else(PoisonError::into_inner);
        let fits = |buffer: &Aligned| (len..=2 * len).contains(&buffer.capacity());
        let best = (0..pool.len())
            .filter(|i| fits(&pool[*i]))
            .min_by_key(|i| pool[*i].capacity());
        match best {
            Some(i) => {
                let mut buffer = pool.remove(i);
                buffer.len = len;
                Self(buffer)
            }
            None => Self(Aligned::zeros(len)),
        }
    }

    /// `len` zeros.
    pub fn zeros(len: usize) -> Self {
        let mut buffer = Self::take(len);
        buffer.as_mut_slice().fill(0.0);
        buffer
    }

    /// The numbers.
    pub fn as_slice(&self) -> &[f32] {
        self.0.as_slice()
    }

    /// The numbers.
    pub fn as_mut_slice(&mut self) -> &mut [f32] {
        self.0.as_mut_slice()
    }
}

impl Drop for Pooled {
    fn drop(&mut self) {
        let buffer = std::mem::take(&mut self.0);
        let mut pool = POOL.lock().unwrap_or_else(PoisonError::into_inner);
        if buffer.capacity() == 0 {
            return;
        }
        // The first has lain longest without fitting anything.
        if pool.len() >= POOLED {
            pool.remove(0);
        }
        pool.push(buffer);
    }
}

/// A stretch of memory from which buffers are cut one after the other.
#[derive(Debug)]
pub struct Arena<'a>(&'a mut [f32]);

impl<'a> Arena<'a> {
    /// An arena over `memory`.
    pub fn new(memory: &'a mut [f32]) -> Self {
        Self(memory)
    }

    /// A buffer of `len` numbers, whose values are left over from earlier use.
    ///
    /// # Panics
    /// If the arena is used up: [`with_arena`] was asked for too little.
    pub fn take(&mut self, len: usize) -> &'a mut [f32] {
        let (head, rest) = std::mem::take(&mut self.0).split_at_mut(len.div_ceil(LINE) * LINE);
        self.0 = rest;
        &mut head[..len]
    }
}

thread_local! {
    static MEMORY: RefCell<Aligned> = RefCell::default();
}

/// Calls `f` with this thread's arena of at least `len` numbers, buffers rounded
/// up to cache lines.
///
/// # Panics
/// If `f` calls it again.
pub fn with_arena<T>(len: usize, f: impl FnOnce(&mut Arena<'_>) -> T) -> T {
    MEMORY.with_borrow_mut(|memory| {
        if memory.len < len {
            *memory = Aligned::zeros(len);
        }
        f(&mut Arena::new(memory.as_mut_slice()))
    })
}
