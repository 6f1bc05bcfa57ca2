//! All reading and writing of files: projects and scenes, pictures, records and reports.
//!
//! - [`open`] and [`read`] take regular files only: a pipe or a device could block for ever. A file that ends before the
//!   size that it had when it was opened is an error, so no loader takes half a file for a whole one.
//! - [`write_atomically`] and [`Replacement`] write a file whole or not at all, and [`TemporaryFolder`] a folder.
//!   [`check_outputs`] finds out before the work whether that will succeed.
//! - [`Resumable`] is for long outputs that a later run continues after a kill: the bytes written so far stay beside the file until
//!   it is complete.
//! - [`abandon`] removes half-written files when the program is ended from outside. Leftovers of a killed program are removed when a
//!   file is next written into the same folder.
//! - [`confine`] restricts all of these to a folder, for the whole process: functions that open files need no parameter for it and
//!   cannot forget the check.
//! - [`fault`] makes these functions fail at a chosen call, for tests.

mod confine;
pub mod fault;
mod input;
mod output;
mod resumable;
mod target;
mod temporary;

pub use confine::{check_place, confine, confined_to, outside, read_so_far, record_files_read, refused};
pub use input::{Input, open, read, read_if_there};
pub use output::{Replacement, create_folder, write_atomically};
pub use resumable::{Growing, Resumable};
pub use target::{OutputError, check_folder, check_outputs};
pub use temporary::{TemporaryFolder, abandon};
