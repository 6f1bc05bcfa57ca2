#![no_main]

use curitiba_fuzz::fuzz_targets;
use libfuzzer_sys::fuzz_target;

fuzz_target!(init: curitiba_fuzz::start(), |input: &[u8]| {
    fuzz_targets::shader::shader(input);
});
