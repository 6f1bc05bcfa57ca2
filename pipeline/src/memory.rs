//! Allocation of large blocks: a failure is an error that names the requested size, never an abort.

use std::sync::OnceLock;

/// Formats a number of bytes as `12.3 MiB`.
#[must_use]
pub fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

/// An allocation that the system, or the program's own allocator, refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{} of memory are refused: raise --max-memory, or the system's limit (`ulimit -v`)", mebibytes(*bytes))]
pub struct Refused {
    /// Requested size.
    pub bytes: u64,
}

impl Refused {
    /// The refusal of `count` items of type `T`.
    #[must_use]
    pub fn items<T>(count: usize) -> Self {
        Self { bytes: (count as u64).saturating_mul(size_of::<T>() as u64) }
    }
}

impl From<Refused> for std::io::Error {
    fn from(refused: Refused) -> Self {
        Self::new(std::io::ErrorKind::OutOfMemory, refused)
    }
}

/// An empty list with room for `count` items.
///
/// # Errors
/// If there is too little memory.
pub fn with_capacity<T>(count: usize) -> Result<Vec<T>, Refused> {
    let mut list = Vec::new();
    list.try_reserve_exact(count).map_err(|_| Refused::items::<T>(count))?;
    Ok(list)
}

/// A list of `count` zeros. The system provides zeroed pages, which are touched only when they are first written.
///
/// # Errors
/// If there is too little memory.
pub fn zeroed<T: bytemuck::Zeroable>(count: usize) -> Result<Vec<T>, Refused> {
    bytemuck::allocation::try_zeroed_vec(count).map_err(|()| Refused::items::<T>(count))
}

/// A list of `count` equal items.
///
/// # Errors
/// If there is too little memory.
pub fn filled<T: Clone>(item: T, count: usize) -> Result<Vec<T>, Refused> {
    let mut list = with_capacity(count)?;
    list.resize(count, item);
    Ok(list)
}

/// Resizes a list to `count` items, without spare capacity.
///
/// # Errors
/// If there is too little memory.
pub fn resize<T: Clone>(list: &mut Vec<T>, count: usize, item: T) -> Result<(), Refused> {
    list.try_reserve_exact(count.saturating_sub(list.len())).map_err(|_| Refused::items::<T>(count))?;
    list.resize(count, item);
    Ok(())
}

/// A copy of a list.
///
/// # Errors
/// If there is too little memory.
pub fn copied<T: Copy>(items: &[T]) -> Result<Vec<T>, Refused> {
    let mut list = with_capacity(items.len())?;
    list.extend_from_slice(items);
    Ok(list)
}

/// Tests whether `bytes` of memory can be allocated at once, and frees them again. For crates that do not check their allocations: the
/// memory that they need is estimated, and tested before the call.
///
/// # Errors
/// If there is too little memory.
pub fn probe(bytes: u64) -> Result<(), Refused> {
    let refused = Refused { bytes };
    let count = usize::try_from(bytes).map_err(|_| refused)?;
    let block: Vec<u8> = with_capacity(count).map_err(|_| refused)?;
    // Keeps the compiler from removing an allocation that is never read.
    std::hint::black_box(&block);
    Ok(())
}

/// Counter of the process's memory that does not come from its allocator.
static OUTSIDE: OnceLock<fn(i64) -> bool> = OnceLock::new();

/// Sets the counter of memory that the process holds outside of its global allocator, such as that of a graphics driver which computes on
/// the processor. `counter` gets the number of bytes added, or removed if negative, and returns whether they may be held; if not, they
/// are not counted. Only the first call has an effect.
pub fn count_outside_by(counter: fn(i64) -> bool) {
    _ = OUTSIDE.set(counter);
}

/// Counts memory that the process holds outside of its allocator. `bytes` are added to the count, or removed from it if negative.
/// Without [`count_outside_by`] nothing is counted.
///
/// # Errors
/// If the counter refuses the bytes; they are then not counted.
pub fn outside(bytes: i64) -> Result<(), Refused> {
    match OUTSIDE.get() {
        Some(counter) if !counter(bytes) => Err(Refused { bytes: bytes.unsigned_abs() }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_outside_of_the_allocator_is_counted_by_the_first_who_offers() {
        assert_eq!(outside(i64::MAX), Ok(()), "nobody counts");
        count_outside_by(|bytes| bytes < 100);
        count_outside_by(|_| false);
        assert_eq!((outside(99), outside(-500)), (Ok(()), Ok(())));
        assert_eq!(outside(100), Err(Refused { bytes: 100 }));
    }

    #[test]
    fn more_than_there_can_be_is_an_error_that_says_how_much() {
        let count = isize::MAX as usize / 16;
        assert_eq!(with_capacity::<[f32; 4]>(count).expect_err("refused"), Refused { bytes: 16 * count as u64 });
        assert!(zeroed::<[f32; 4]>(usize::MAX).is_err() && filled(1_u64, count).is_err() && probe(u64::MAX).is_err());
        let message = probe(1 << 62).expect_err("refused").to_string();
        assert!(message.contains("4398046511104.0 MiB") && message.contains("--max-memory"), "{message}");
        assert_eq!(zeroed::<u32>(3), Ok(vec![0; 3]));
        assert_eq!(filled(7_u32, 2), Ok(vec![7; 2]));
        assert_eq!(copied(&[1, 2]), Ok(vec![1, 2]));
        let mut list = vec![1];
        assert_eq!((resize(&mut list, 3, 9), list), (Ok(()), vec![1, 9, 9]));
    }
}
