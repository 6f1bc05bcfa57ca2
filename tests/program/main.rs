//! The program `curitiba` as its users start it: commands, their output and files, faults and memory.

mod bench;
#[cfg(unix)]
#[macro_use]
mod capped;
mod cli;
mod compare;
mod crop;
mod deep;
mod display;
mod faults;
#[cfg(unix)]
mod memory;
#[cfg(unix)]
mod memory_of_drivers;
mod outputs;
mod report;
mod scenes;
mod survey;
mod tune;
mod visibility;
