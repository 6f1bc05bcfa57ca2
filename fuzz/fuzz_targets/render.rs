#![no_main]

use curitiba_fuzz::body;
use libfuzzer_sys::fuzz_target;

fuzz_target!(init: curitiba_fuzz::start(), |input: &[u8]| {
    body::render(input);
});
