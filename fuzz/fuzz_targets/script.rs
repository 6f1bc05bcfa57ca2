#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(init: curitiba_fuzz::start(), |input: &[u8]| {
    curitiba_fuzz::script::script(input);
});
