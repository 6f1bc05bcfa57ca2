//! The processor mode that Embree's manual recommends.
#![allow(unsafe_code, reason = "the control register of vector arithmetic has no safe interface")]

/// While a value of this type lives, denormal numbers are flushed to zero, as Embree's manual recommends.
pub struct Flush(u32);

impl Flush {
    pub fn on() -> Self {
        let saved = control();
        set_control(saved | 0x8040);
        Self(saved)
    }
}

impl Drop for Flush {
    fn drop(&mut self) {
        set_control(self.0);
    }
}

#[cfg(target_arch = "x86_64")]
fn control() -> u32 {
    let mut value = 0_u32;
    // SAFETY: stores four bytes at a valid address.
    unsafe { std::arch::asm!("stmxcsr [{}]", in(reg) &raw mut value, options(nostack)) };
    value
}

#[cfg(target_arch = "x86_64")]
fn set_control(value: u32) {
    // SAFETY: only the bits for denormals differ from the thread's earlier value; the bench's own code does not depend on them.
    unsafe { std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const value, options(nostack)) };
}

#[cfg(not(target_arch = "x86_64"))]
fn control() -> u32 {
    0
}

#[cfg(not(target_arch = "x86_64"))]
fn set_control(_: u32) {}
