//! The program's global allocator: it counts allocated bytes and refuses allocations beyond `--max-memory`.
//!
//! A refusal, by this allocator or by the system (`ulimit -v`), is a null pointer, as with every allocator. Large allocations of
//! this program use `try_reserve` and report an error. Code that cannot handle a refusal (growing lists of the standard library,
//! other crates) aborts the process; [`end_with_an_error`] turns such an abort into an error message and exit code 1. Aborts of
//! threads whose allocations were never refused stay aborts.
//!
//! Of memory outside this heap, the count includes what is reported to [`outside`], but not stacks and code. It does not include freed memory
//! that the C library keeps. `tests/program/memory.rs` checks that the whole process exceeds the limit by at most a tenth.
#![allow(unsafe_code, reason = "an allocator, a signal handler and the calls that end a process have no safe form")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicI64, AtomicU64, Ordering};

/// Size in bytes from which a block is counted at once. Smaller blocks are added up per thread and counted in batches of this size.
const BATCH: i64 = 64 << 10;

/// Bytes counted so far. Each thread may hold up to [`BATCH`] bytes more or less than it has added here; see `OWN`.
static HELD: AtomicI64 = AtomicI64::new(0);
/// Limit of [`HELD`], bytes; `i64::MAX` for none.
static LIMIT: AtomicI64 = AtomicI64::new(i64::MAX);

/// Environment variable with which a test makes the allocator refuse one large block: the block's number, from 0. Only tests set it.
const REFUSE_AT_VARIABLE: &str = "CURITIBA_TEST_REFUSE_BLOCK";
/// Number of the large block that is refused; `u64::MAX` for none.
static REFUSE_AT: AtomicU64 = AtomicU64::new(u64::MAX);
/// Number of requests for large blocks, for growth of large blocks, and by [`outside`], since [`REFUSE_AT`] was set.
static LARGE_BLOCKS: AtomicU64 = AtomicU64::new(0);

thread_local! {
    /// Net bytes of small blocks of this thread that are not yet in [`HELD`].
    static OWN: Cell<i64> = const { Cell::new(0) };
    /// Why an allocation of this thread was refused last. It is not reset: reporting the refusal allocates memory too, and
    /// succeeds.
    static REFUSED: Cell<Refused> = const { Cell::new(Refused::No) };
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Refused {
    No,
    ByLimit,
    BySystem,
    ByTest,
}

/// The system's allocator with counting and a limit.
pub struct Counting;

/// Sets the limit from now on. Small blocks may exceed it by a sixteenth and [`BATCH`] bytes, so that an error can still be reported.
pub fn limit(bytes: u64) {
    LIMIT.store(i64::try_from(bytes).unwrap_or(i64::MAX), Ordering::Relaxed);
}

/// From now on the block that [`REFUSE_AT_VARIABLE`] names is refused; none if the variable is not set.
pub fn refuse_as_the_environment_says() {
    let number = std::env::var(REFUSE_AT_VARIABLE).ok().and_then(|number| number.parse().ok());
    REFUSE_AT.store(number.unwrap_or(u64::MAX), Ordering::Relaxed);
}

/// Returns whether a test refuses this large block. Large blocks are counted only if a test refuses one of them.
fn a_test_refuses() -> bool {
    let at = REFUSE_AT.load(Ordering::Relaxed);
    if at == u64::MAX || LARGE_BLOCKS.fetch_add(1, Ordering::Relaxed) != at {
        return false;
    }
    REFUSED.set(Refused::ByTest);
    // Tells the test that a block with the requested number was reached.
    write_error(b"a test refuses memory\n");
    true
}

/// Counts bytes of a large block at once; returns `false` if that would exceed the limit.
fn take_large(bytes: usize) -> bool {
    let bytes = bytes as i64;
    if bytes > 0 && a_test_refuses() {
        return false;
    }
    let held = HELD.fetch_add(bytes, Ordering::Relaxed).saturating_add(bytes);
    if bytes > 0 && held > LIMIT.load(Ordering::Relaxed) {
        HELD.fetch_sub(bytes, Ordering::Relaxed);
        REFUSED.set(Refused::ByLimit);
        return false;
    }
    true
}

/// Adds bytes that the process holds outside this allocator; a negative number subtracts. Returns `false`, and counts nothing, if that would
/// exceed the limit.
pub fn outside(bytes: i64) -> bool {
    match usize::try_from(bytes) {
        Ok(more) => take_large(more),
        Err(_) => {
            HELD.fetch_add(bytes, Ordering::Relaxed);
            true
        }
    }
}

fn give_back_large(bytes: usize) {
    HELD.fetch_sub(bytes as i64, Ordering::Relaxed);
}

/// Counts a block; returns `false` if that would exceed the limit.
fn take(bytes: usize) -> bool {
    if bytes as i64 >= BATCH {
        return take_large(bytes);
    }
    let own = OWN.get() + bytes as i64;
    if own < BATCH {
        OWN.set(own);
        return true;
    }
    let limit = LIMIT.load(Ordering::Relaxed);
    if HELD.load(Ordering::Relaxed).saturating_add(own) > limit.saturating_add(limit / 16).saturating_add(BATCH) {
        REFUSED.set(Refused::ByLimit);
        return false;
    }
    OWN.set(0);
    HELD.fetch_add(own, Ordering::Relaxed);
    true
}

/// Uncounts a freed block.
fn give_back(bytes: usize) {
    if bytes as i64 >= BATCH {
        return give_back_large(bytes);
    }
    let own = OWN.get() - bytes as i64;
    if own > -BATCH {
        OWN.set(own);
    } else {
        OWN.set(0);
        HELD.fetch_add(own, Ordering::Relaxed);
    }
}

/// Size in bytes from which blocks request huge pages; the C library maps each such block separately.
#[cfg(target_os = "linux")]
const LARGE_PAGES: usize = 32 << 20;

/// Requests huge pages, if the system has them. Page faults for 4 KiB each would take longer than parsing the numbers of a scene,
/// and page faults of several threads wait for each other.
#[cfg(target_os = "linux")]
fn ask_for_large_pages(block: *mut u8, bytes: usize) {
    const PAGE: usize = 4096;
    if bytes >= LARGE_PAGES && !block.is_null() {
        let within = block.addr() % PAGE;
        let start = block.wrapping_sub(within);
        // SAFETY: the range is of pages that the block lies in, which are mapped; the advice changes no byte, and may be refused.
        unsafe { libc::madvise(start.cast(), bytes + within, libc::MADV_HUGEPAGE) };
    }
}

#[cfg(not(target_os = "linux"))]
fn ask_for_large_pages(_: *mut u8, _: usize) {}

/// Counts `bytes`, allocates, and uncounts them if the system has no memory.
fn counted(bytes: usize, allocate: impl FnOnce() -> *mut u8) -> *mut u8 {
    if !take(bytes) {
        return std::ptr::null_mut();
    }
    let block = allocate();
    ask_for_large_pages(block, bytes);
    if block.is_null() {
        give_back(bytes);
        REFUSED.set(Refused::BySystem);
    }
    block
}

// SAFETY: every block comes from and goes to `System`, with the layout that the caller names; the counters are atomic or of
// one thread, have no destructor, and allocate nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller keeps the contract of `alloc`.
        counted(layout.size(), || unsafe { System.alloc(layout) })
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller keeps the contract of `alloc_zeroed`.
        counted(layout.size(), || unsafe { System.alloc_zeroed(layout) })
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        give_back(layout.size());
        // SAFETY: the block is of `System` and has this layout.
        unsafe { System.dealloc(block, layout) };
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        let (old, grown) = (layout.size(), size.saturating_sub(layout.size()));
        // Of a large block only the growth is counted: the C library is expected to remap it without a copy. A block that grows from small
        // to large is counted as both for a moment.
        let both_large = old.min(size) as i64 >= BATCH;
        if !(if both_large { take_large(grown) } else { take(size) }) {
            return std::ptr::null_mut();
        }
        // SAFETY: the block is of `System` and has this layout; the caller keeps the contract of `realloc`.
        let moved = unsafe { System.realloc(block, layout, size) };
        match (moved.is_null(), both_large) {
            (true, true) => give_back_large(grown),
            (true, false) => give_back(size),
            (false, true) => give_back_large(old.saturating_sub(size)),
            (false, false) => give_back(old),
        }
        if moved.is_null() {
            REFUSED.set(Refused::BySystem);
        }
        ask_for_large_pages(moved, size);
        moved
    }
}

/// Turns the abort after a refused allocation into an error message and exit code 1.
#[cfg(unix)]
pub fn end_with_an_error() {
    // SAFETY: the handler only reads a variable of its thread, writes and ends the process, which a handler may do.
    unsafe { libc::signal(libc::SIGABRT, on_abort as *const () as libc::sighandler_t) };
}

/// On other systems a process that aborts after a refused allocation ends with the message of the standard library.
#[cfg(not(unix))]
pub fn end_with_an_error() {}

/// Writes to the error stream, without taking memory.
#[cfg(unix)]
fn write_error(message: &[u8]) {
    // SAFETY: the pointer and the length are of one slice.
    unsafe { libc::write(libc::STDERR_FILENO, message.as_ptr().cast(), message.len()) };
}

#[cfg(not(unix))]
fn write_error(_: &[u8]) {}

#[cfg(unix)]
extern "C" fn on_abort(_: libc::c_int) {
    let message: &[u8] = match REFUSED.get() {
        // Not refused: `abort` then ends the process as without a handler.
        Refused::No => return,
        Refused::ByLimit => {
            b"error: what is needed does not fit into --max-memory\n       \
              raise --max-memory, or use a smaller --size, a smaller scene or fewer --threads\n"
        }
        Refused::BySystem => {
            b"error: the system gives no more memory\n       \
              raise its limit (`ulimit -v`), or use a smaller --size, a smaller scene or fewer --threads\n"
        }
        Refused::ByTest => b"error: memory was refused, as a test asked\n",
    };
    write_error(message);
    // SAFETY: `_exit` ends the process without running any of its code.
    unsafe { libc::_exit(1) };
}
