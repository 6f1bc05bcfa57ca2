//! Asking for large blocks of memory: a refusal is an error that says how much was asked for, never an abort.

/// A number of bytes as `12.3 MiB`.
#[must_use]
pub fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

/// Memory that was asked for and refused, by the system or by the allocator of the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{} of memory are refused: raise --max-memory, or the system's limit (`ulimit -v`)", mebibytes(*bytes))]
pub struct Refused {
    /// How much was asked for.
    pub bytes: u64,
}

impl Refused {
    /// Of `count` items.
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

/// An empty list with room for so many items.
///
/// # Errors
/// If there is not so much memory.
pub fn with_capacity<T>(count: usize) -> Result<Vec<T>, Refused> {
    let mut list = Vec::new();
    list.try_reserve_exact(count).map_err(|_| Refused::items::<T>(count))?;
    Ok(list)
}

/// A list of so many zeros. The system hands out zeros: pages are touched when they are first written.
///
/// # Errors
/// If there is not so much memory.
pub fn zeroed<T: bytemuck::Zeroable>(count: usize) -> Result<Vec<T>, Refused> {
    bytemuck::allocation::try_zeroed_vec(count).map_err(|()| Refused::items::<T>(count))
}

/// A list of so many equal items.
///
/// # Errors
/// If there is not so much memory.
pub fn filled<T: Clone>(item: T, count: usize) -> Result<Vec<T>, Refused> {
    let mut list = with_capacity(count)?;
    list.resize(count, item);
    Ok(list)
}

/// Makes a list longer, at the end; room for no more is asked for.
///
/// # Errors
/// If there is not so much memory.
pub fn resize<T: Clone>(list: &mut Vec<T>, count: usize, item: T) -> Result<(), Refused> {
    list.try_reserve_exact(count.saturating_sub(list.len())).map_err(|_| Refused::items::<T>(count))?;
    list.resize(count, item);
    Ok(())
}

/// A copy of a list.
///
/// # Errors
/// If there is not so much memory.
pub fn copied<T: Copy>(items: &[T]) -> Result<Vec<T>, Refused> {
    let mut list = with_capacity(items.len())?;
    list.extend_from_slice(items);
    Ok(list)
}

/// Whether so much could be had at once. What is asked for is given back: for work of crates that take what they get, whose
/// need is estimated first.
///
/// # Errors
/// If there is not so much memory.
pub fn probe(bytes: u64) -> Result<(), Refused> {
    let refused = Refused { bytes };
    let count = usize::try_from(bytes).map_err(|_| refused)?;
    let block: Vec<u8> = with_capacity(count).map_err(|_| refused)?;
    // Asked for in earnest: a list that nobody looks at would be left out.
    std::hint::black_box(&block);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

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
