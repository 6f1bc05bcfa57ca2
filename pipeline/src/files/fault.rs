//! Faults on demand, for tests: a disk that is full from the n-th write on, a reader that fails or ends early at the n-th
//! call. Nothing in the program arms them.
//!
//! An armed fault concerns only the files below one folder, so tests that run at the same time do not meet each other's faults.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The kind of fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// The n-th call that opens or reads a file fails; the others succeed.
    ReadFails,
    /// The n-th call that reads, and all later ones of that file, find its end.
    ReadEndsEarly,
    /// The n-th call that creates, writes, synchronises or renames a file fails, and every later one: the disk is full.
    DiskFull,
}

#[derive(Debug)]
struct Plan {
    folder: PathBuf,
    fault: Fault,
    at: u64,
    calls: AtomicU64,
    struck: AtomicU64,
}

static ARMED: AtomicBool = AtomicBool::new(false);
static PLAN: Mutex<Option<Arc<Plan>>> = Mutex::new(None);
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// An armed fault; dropping it disarms the fault.
#[derive(Debug)]
pub struct Armed {
    plan: Arc<Plan>,
    _alone: MutexGuard<'static, ()>,
}

/// Arms a fault for the files below `folder`, at call number `at`, counted from 0. Waits while another fault is armed.
#[must_use]
pub fn arm(folder: &Path, fault: Fault, at: u64) -> Armed {
    let alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let plan = Arc::new(Plan { folder, fault, at, calls: AtomicU64::new(0), struck: AtomicU64::new(0) });
    *current() = Some(Arc::clone(&plan));
    ARMED.store(true, Ordering::SeqCst);
    Armed { plan, _alone: alone }
}

impl Armed {
    /// Number of calls counted.
    #[must_use]
    pub fn calls(&self) -> u64 {
        self.plan.calls.load(Ordering::SeqCst)
    }

    /// Number of calls that failed.
    #[must_use]
    pub fn struck(&self) -> u64 {
        self.plan.struck.load(Ordering::SeqCst)
    }
}

impl Drop for Armed {
    fn drop(&mut self) {
        ARMED.store(false, Ordering::SeqCst);
        *current() = None;
    }
}

fn current() -> MutexGuard<'static, Option<Arc<Plan>>> {
    PLAN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The armed fault that concerns one open file, if any.
#[derive(Debug, Default)]
pub(super) struct Watch {
    plan: Option<Arc<Plan>>,
    ended: bool,
}

/// The armed fault that concerns the file at `path`; empty unless a test armed one.
pub(super) fn watch(path: &Path) -> Watch {
    if !ARMED.load(Ordering::Relaxed) {
        return Watch::default();
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let real = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let plan = current().clone().filter(|plan| real.starts_with(&plan.folder));
    Watch { plan, ended: false }
}

impl Plan {
    /// Counts a call. Returns whether it must fail: call number `at`, and with `ever_after` all later ones.
    fn strikes(&self, ever_after: bool) -> bool {
        let call = self.calls.fetch_add(1, Ordering::SeqCst);
        let strikes = call == self.at || ever_after && call > self.at;
        self.struck.fetch_add(u64::from(strikes), Ordering::SeqCst);
        strikes
    }
}

impl Watch {
    /// Called before a file is opened for reading.
    pub fn on_open(&mut self) -> io::Result<()> {
        match &self.plan {
            Some(plan) if plan.fault == Fault::ReadFails && plan.strikes(false) => Err(failed()),
            _ => Ok(()),
        }
    }

    /// Called before each read. Returns `false` if the read must find the end of the file.
    pub fn on_read(&mut self) -> io::Result<bool> {
        let Some(plan) = &self.plan else { return Ok(true) };
        match plan.fault {
            Fault::ReadFails if plan.strikes(false) => Err(failed()),
            Fault::ReadEndsEarly => {
                self.ended |= plan.strikes(false);
                Ok(!self.ended)
            }
            _ => Ok(true),
        }
    }

    /// Called before each call that changes the disk.
    pub fn on_write(&mut self) -> io::Result<()> {
        match &self.plan {
            Some(plan) if plan.fault == Fault::DiskFull && plan.strikes(true) => {
                Err(io::Error::new(io::ErrorKind::StorageFull, "no space left on device (a test asked for it)"))
            }
            _ => Ok(()),
        }
    }
}

fn failed() -> io::Error {
    io::Error::other("input/output error (a test asked for it)")
}
